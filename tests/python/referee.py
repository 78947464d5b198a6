"""Frames of RoboMaster's referee system, made without code of ours: by struct, and by checksums of other algorithms.

Argument: a seed. Prints a JSON list of frames with what they say.
"""

import binascii
import json
import random
import struct
import sys


def mirrored(value, bits):
    return int(f"{value:0{bits}b}"[::-1], 2)


def crc16(data):
    """MCRF4XX: the CRC of the standard library runs from the highest bit on, so all is mirrored for it."""
    return mirrored(binascii.crc_hqx(bytes(mirrored(byte, 8) for byte in data), 0xFFFF), 16)


def crc8(data):
    """By long division of one number: the bits as they are sent, the first eight inverted, with eight zeros behind."""
    bits = "".join(f"{mirrored(byte, 8):08b}" for byte in data) + "0" * 8
    rest = int(bits, 2) ^ 0xFF << len(bits) - 8
    for place in range(len(bits) - 1, 7, -1):
        if rest >> place & 1:
            rest ^= 0x131 << place - 8
    return mirrored(rest, 8)


def frame(sequence, command, data):
    head = struct.pack("<BHB", 0xA5, len(data), sequence)
    whole = head + bytes([crc8(head)]) + struct.pack("<H", command) + data
    return whole + struct.pack("<H", crc16(whole))


def main():
    dice = random.Random(int(sys.argv[1]))
    word = lambda: dice.randrange(1 << 16)
    byte = lambda: dice.randrange(1 << 8)
    real = lambda: struct.unpack("<f", struct.pack("<f", dice.uniform(-1e3, 1e3)))[0]
    told = []
    for number in range(400):
        sequence, appended = byte(), bytes(byte() for _ in range(dice.choice([0, 0, 1, 40])))
        say = lambda command, data, said: told.append(
            {"frame": frame(sequence, command, data + appended).hex(), "sequence": sequence, "said": said}
        )
        head = [byte(), byte()] + [word() for _ in range(5)]
        outputs, speed = dice.randrange(8), real()
        if number % 2 == 0:
            # V1.x; longer than that it is another version.
            appended = b""
            say(0x0201, struct.pack("<BB5HB", *head, outputs), ["robot", *head, outputs, None])
        else:
            say(0x0201, struct.pack("<BB5HfB", *head, speed, outputs), ["robot", *head, outputs, speed])
        heat = [word(), word(), word()]
        say(0x0202, struct.pack("<HHfHHH", word(), word(), real(), *heat), ["power", *heat])
        pose = [real(), real(), real()]
        say(0x0203, struct.pack("<fff", *pose), ["pose", *pose])
        shot = [byte(), byte(), byte(), real()]
        say(0x0207, struct.pack("<BBBf", *shot), ["shot", *shot])
        allowance = [word(), word(), word()]
        say(0x0208, struct.pack("<HHH", *allowance), ["allowance", *allowance])
        kind, stage, left = dice.randrange(16), dice.randrange(16), word()
        stamp = dice.randrange(1 << 64)
        say(0x0001, struct.pack("<BHQ", kind | stage << 4, left, stamp), ["game", kind, stage, left])
    print(json.dumps(told))


if __name__ == "__main__":
    main()
