# Runs in a mount namespace of its own, as root: plugs a USB serial chip into a /sys and a /dev that are made up, and asks the real udev what it makes of it.
# $1, $2: vendor and product; $3: a folder of rules, beside those of the system. Prints what `udevadm test` says of the USB device, then of the port.
set -eu
for place in /run /dev /sys; do mount -t tmpfs tmpfs "$place"; done
mkdir -p /run/udev/rules.d /sys/bus/usb/devices /sys/bus/usb-serial /sys/class/tty
cp "$3"/*.rules /run/udev/rules.d/
mkdir -p /dev/bus/usb/001
mknod /dev/null c 1 3
mknod /dev/bus/usb/001/002 c 189 1
mknod /dev/ttyUSB0 c 188 0

usb=/sys/devices/platform/soc/usb1/1-1
tty=$usb/1-1:1.0/ttyUSB0/tty/ttyUSB0
mkdir -p "$tty"
printf 'MAJOR=189\nMINOR=1\nDEVNAME=bus/usb/001/002\nDEVTYPE=usb_device\nPRODUCT=%s/%s/264\nBUSNUM=001\nDEVNUM=002\n' "$1" "$2" > "$usb/uevent"
printf '%s\n' "$1" > "$usb/idVendor"
printf '%s\n' "$2" > "$usb/idProduct"
printf '0264\n' > "$usb/bcdDevice"
printf '00\n' > "$usb/bDeviceClass"
printf 'USB Serial\n' > "$usb/product"
printf 'DEVTYPE=usb_interface\nINTERFACE=255/1/2\n' > "$usb/1-1:1.0/uevent"
printf '00\n' > "$usb/1-1:1.0/bInterfaceNumber"
printf 'ff\n' > "$usb/1-1:1.0/bInterfaceClass"
: > "$usb/1-1:1.0/ttyUSB0/uevent"
printf '0\n' > "$usb/1-1:1.0/ttyUSB0/port_number"
printf 'MAJOR=188\nMINOR=0\nDEVNAME=ttyUSB0\n' > "$tty/uevent"
ln -s /sys/bus/usb "$usb/subsystem"
ln -s /sys/bus/usb "$usb/1-1:1.0/subsystem"
ln -s /sys/bus/usb-serial "$usb/1-1:1.0/ttyUSB0/subsystem"
ln -s /sys/class/tty "$tty/subsystem"
ln -s "$tty" /sys/class/tty/ttyUSB0

export SYSTEMD_DEVICE_VERIFY_SYSFS=0
echo "== usb"
udevadm test --action=add "$usb" 2>&1
echo "== tty"
udevadm test --action=add "$tty" 2>&1
for node in /dev/ttyUSB0 /dev/slamd-ring; do
  [ ! -e "$node" ] || stat -c 'NODE %a %G %N' "$node"
done
