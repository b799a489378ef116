#!/usr/bin/env python3
"""IMAGE.bin, which begins at the flash's begin, to IMAGE.uf2. SPDX-License-Identifier: MIT OR Apache-2.0

Writes the checksum that the boot ROM expects behind the 252 bytes of the second boot stage, and fills the last sector: the boot ROM
erases a sector when its first page comes."""
import struct
import sys

FLASH, PAGE, SECTOR, BOOT2 = 0x10000000, 256, 4096, 252
RP2040 = 0xE48BFF56


def crc32(data):
    """CRC-32/MPEG-2."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1) ^ 0x04C11DB7 if crc & 0x80000000 else crc << 1
    return crc & 0xFFFFFFFF


def main(source, target):
    with open(source, "rb") as file:
        image = bytearray(file.read())
    image[BOOT2:PAGE] = struct.pack("<I", crc32(image[:BOOT2]))
    image += b"\xff" * (-len(image) % SECTOR)
    pages = [image[at : at + PAGE] for at in range(0, len(image), PAGE)]
    with open(target, "wb") as file:
        for number, page in enumerate(pages):
            at = FLASH + PAGE * number
            head = struct.pack("<8I", 0x0A324655, 0x9E5D5157, 0x2000, at, PAGE, number, len(pages), RP2040)
            file.write(head + page + bytes(476 - PAGE) + struct.pack("<I", 0x0AB16F30))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: uf2.py IMAGE.bin IMAGE.uf2")
    main(*sys.argv[1:])
