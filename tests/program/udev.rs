//! The udev rules, as the real udev understands them: a USB serial chip is plugged into a /sys and a /dev that are made up for it.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::process::Command;

const RULES: &str = include_str!("../../configs/udev/95-slamd.rules");
/// What brltty's rules do with the chips that it takes for braille displays.
const BRLTTY: &str = r#"SUBSYSTEM!="usb", GOTO="brltty_end"
ENV{PRODUCT}=="1a86/7523/*|10c4/ea60/*", ENV{BRLTTY_BRAILLE_DRIVER}="bm", GOTO="brltty_run"
GOTO="brltty_end"
LABEL="brltty_run"
TAG+="systemd"
ACTION=="add", ENV{SYSTEMD_WANTS}+="brltty-device@.service"
LABEL="brltty_end"
"#;

/// What udev made of the USB device and of the port, and what is in /dev then.
struct Plugged {
    usb: String,
    tty: String,
}

impl Plugged {
    /// Plugs a chip in where these are our rules; none where that cannot be done.
    fn new(rules: &str, chip: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("90-brltty-device.rules"), BRLTTY).unwrap();
        std::fs::write(folder.path().join("95-slamd.rules"), rules).unwrap();
        let (vendor, product) = chip.split_once(':').unwrap();
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/udev/plug.sh");
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", script, vendor, product]).arg(folder.path());
        let output = command.output();
        let works = |what: &str, argument: &str| {
            Command::new(what).arg(argument).arg("true").output().is_ok_and(|output| output.status.success())
        };
        let has_udev = Command::new("udevadm").arg("--version").output().is_ok();
        if !works("unshare", "--mount") || !has_udev {
            println!("not tested: this needs udevadm (Debian's package udev) and, for a /sys of its own, root");
            return None;
        }
        let output = output.unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let (usb, tty) = text.split_once("== tty\n").unwrap_or_else(|| panic!("{output:?}"));
        Some(Self { usb: usb.into(), tty: tty.into() })
    }

    /// What udev has to say against our rules.
    fn complaints(&self) -> Vec<&str> {
        const WORDS: [&str; 6] = ["Invalid", "Unknown", "no matching label", "no effect", "takes", "Failed"];
        let lines = self.usb.lines().chain(self.tty.lines());
        lines.filter(|line| line.contains("95-slamd.rules:") && WORDS.iter().any(|word| line.contains(word))).collect()
    }
}

/// The chips of the boards that we name: clones with a CH340, a CP2102 and an FT232R, and Arduino's own.
const CHIPS: [&str; 6] = ["1a86:7523", "10c4:ea60", "0403:6001", "2341:0042", "2341:0010", "2a03:0042"];

#[test]
fn the_board_gets_its_name_and_no_other_program_claims_it() {
    for chip in CHIPS {
        let Some(plugged) = Plugged::new(RULES, chip) else { return };
        let Plugged { usb, tty } = &plugged;
        assert_eq!(plugged.complaints(), [""; 0]);
        assert!(tty.contains("NODE 660 dialout '/dev/ttyUSB0'"), "{chip}: {tty}");
        assert!(tty.contains("'/dev/slamd-ring' -> 'ttyUSB0'"), "{chip}: {tty}");
        assert!(tty.contains("\nID_MM_PORT_IGNORE=1\n") && tty.contains("\nTAGS=:systemd:"), "{chip}: {tty}");
        assert!(usb.contains("\nID_MM_DEVICE_IGNORE=1\n"), "{chip}: {usb}");
        assert!(!usb.contains("\nSYSTEMD_WANTS=") && !usb.contains("\nBRLTTY_"), "{chip}: {usb}");
    }
}

#[test]
fn what_is_not_ours_is_left_alone() {
    let Some(Plugged { usb, tty }) = Plugged::new(RULES, "1a86:55d4") else { return };
    assert!(!tty.contains("slamd-ring' ->") && !tty.contains("ID_MM_") && !usb.contains("ID_MM_"), "{tty}");
    // Were our rules before brltty's, or not there, brltty would have the board.
    let Plugged { usb, tty } = Plugged::new("", "1a86:7523").unwrap();
    assert!(usb.contains("\nSYSTEMD_WANTS=brltty-device@.service\n"), "{usb}");
    assert!(!tty.contains("slamd-ring' ->"), "{tty}");
}

#[test]
fn a_breach_is_noticed() {
    for (from, to) in
        [("SYMLINK+=", "SIMLINK+="), ("LABEL=\"slamd_end\"", ""), ("GROUP=\"dialout\"", "GROUP=\"nobodys\"")]
    {
        assert!(RULES.contains(from));
        let Some(plugged) = Plugged::new(&RULES.replace(from, to), "1a86:7523") else { return };
        assert!(!plugged.complaints().is_empty(), "{to} is not noticed: {}", plugged.usb);
    }
}
