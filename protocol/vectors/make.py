#!/usr/bin/env python3
"""Makes the golden vectors from the tables of ../README.md with struct, zlib.crc32 and its own
COBS, so they check the Rust crate independently.

Usage: python3 make.py (writes the .toml files beside it)
"""
import struct, zlib, pathlib

HERE = pathlib.Path(__file__).parent

def cobs(data):
    out, block = bytearray(), bytearray()
    for byte in data:
        if byte:
            block.append(byte)
        else:
            out += bytes([len(block) + 1]) + block
            block.clear()
    return bytes(out + bytes([len(block) + 1]) + block)

def frame(kind, seq, payload):
    body = bytes([kind, seq]) + payload
    return cobs(body + struct.pack("<I", zlib.crc32(body))) + b"\0"

def padded(text):
    return text.encode().ljust(16, b"\0")

GOOD = {
    "hello-uno": (0x01, 0, struct.pack("<BBIIBIII", 1, 0, 0xDEADBEEF, 1_000_000, 32, 1440, 3, 0x12345678) + b"\x01\x02\x03\x04\x05\x06\x07\x08" + padded("mega2560") + padded("1.2.3")),
    "hello-drives": (0x01, 0, struct.pack("<BBIIBIII", 1, 1, 7, 1_000_000, 16, 1440, 1, 9) + bytes(8) + padded("mega2560") + padded("0.2.0")),
    "geometry-two_of_eight": (0x02, 1, struct.pack("<BB", 8, 2) + struct.pack("<hhhHB", 150, 0, 0, 1250, 0) + struct.pack("<hhhHB", -106, -106, -13500, 1250, 3)),
    "sonar-every_echo_code": (0x10, 2, struct.pack("<IBBii", 0xFFFFFFFF, 3, 1, -5, 2_000_000_000) + b"".join(struct.pack("<BH", i, e) for i, e in enumerate([0, 5831, 0xFFFF, 0xFFFE, 0xFFFD, 0xFFFC, 0xFFFB]))),
    "sonar-nobody_answers": (0x10, 3, struct.pack("<IBBii", 0, 0, 0, 0, 0)),
    "encoder-backwards": (0x11, 4, struct.pack("<IiiB", 123_456, -1, -2_147_483_648, 0)),
    "status-all_known": (0x12, 5, struct.pack("<IIIIhHQ", 1_000_000, 40, 1, 2, 2150, 5020, 1 << 63)),
    "status-nothing_known": (0x12, 6, struct.pack("<IIIIhHQ", 0, 0, 0, 0, 0x7FFF, 0, 0)),
    "fault-pin_stuck": (0x13, 7, struct.pack("<IBB", 77, 12, 1)),
    "motion-driving": (0x14, 11, struct.pack("<IBhhhh", 5_000_000, 1, 250, -250, 247, -251)),
    "motion-obstacle": (0x14, 12, struct.pack("<IBhhhh", 0xFFFFFFFF, 3, 0, 0, -32_768, 32_767)),
    "time_response-plain": (0x20, 8, struct.pack("<HII", 0x00FF, 1_000, 1_020)),
    "ack-refused": (0x30, 9, struct.pack("<BBB", 0x84, 200, 2)),
    "config_value-negative": (0x31, 10, struct.pack("<Bi", 4, -1)),
    "log-umlaut": (0x3F, 255, b"\x02" + "Grüße".encode()),
    "hello_request-plain": (0x81, 0, bytes([1, 0])),
    "start-plain": (0x82, 1, b""),
    "stop-plain": (0x83, 2, b""),
    "config_set-plain": (0x84, 3, struct.pack("<Bi", 9, 115_200)),
    "config_get-plain": (0x85, 4, bytes([9])),
    "geometry_request-plain": (0x86, 5, b""),
    "drive-forward": (0x87, 8, struct.pack("<hhHB", 300, 280, 300, 1)),
    "drive-limits": (0x87, 9, struct.pack("<hhHB", -2000, 2000, 1000, 255)),
    "time_request-plain": (0x90, 6, struct.pack("<H", 0xABCD)),
    "heartbeat-plain": (0x91, 7, b""),
}

BAD = {
    "bad-crc": (frame(0x82, 1, b"")[:-2] + b"\x7f\0", "crc"),
    "bad-stuffing": (b"\x09\x01\x02\0", "malformed"),
    "bad-too_short": (cobs(b"\x82\x01\x03") + b"\0", "malformed"),
    "bad-too_long": (b"\x01" * 300 + b"\0", "malformed"),
    "bad-sonar_length": (frame(0x10, 0, bytes(15)), "message"),
    "bad-drive_speed": (frame(0x87, 0, struct.pack("<hhHB", 2001, 0, 300, 1)), "message"),
    "bad-drive_valid_short": (frame(0x87, 0, struct.pack("<hhHB", 100, 100, 49, 1)), "message"),
    "bad-drive_valid_long": (frame(0x87, 0, struct.pack("<hhHB", 100, 100, 1001, 1)), "message"),
    "bad-drive_length": (frame(0x87, 0, struct.pack("<hhH", 100, 100, 200)), "message"),
    "bad-motion_state": (frame(0x14, 0, struct.pack("<IBhhhh", 1, 7, 0, 0, 0, 0)), "message"),
    "bad-motion_speed": (frame(0x14, 0, struct.pack("<IBhhhh", 1, 1, 0, -2001, 0, 0)), "message"),
    "bad-unknown_type": (frame(0x7E, 0, b"\x01"), "message"),
}

for name, (kind, seq, payload) in GOOD.items():
    text = f'type = {kind:#04x}\nseq = {seq}\npayload = "{payload.hex()}"\nframe = "{frame(kind, seq, payload).hex()}"\n'
    (HERE / f"{name}.toml").write_text(text)
for name, (data, error) in BAD.items():
    (HERE / f"{name}.toml").write_text(f'frame = "{data.hex()}"\nerror = "{error}"\n')
