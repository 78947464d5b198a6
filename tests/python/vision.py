"""Packets of rm_vision, made without code of ours.

Argument: a seed. Prints JSON: packets from a PC with what they say, and packets to a PC with what they are to say.
"""

import json
import random
import struct
import sys

from referee import crc16


def whole(packet):
    return (packet + struct.pack("<H", crc16(packet))).hex()


def main():
    dice = random.Random(int(sys.argv[1]))
    real = lambda: struct.unpack("<f", struct.pack("<f", dice.gauss(0.0, 3.0)))[0]
    heard, said = [], []
    for _ in range(500):
        tracked, number, armours = dice.randrange(2), dice.randrange(8), dice.randrange(8)
        # No radius is negative.
        numbers = [real() for _ in range(8)] + [abs(real()), abs(real()), real()]
        # The last bit is reserved.
        bits = tracked | number << 1 | armours << 4 | dice.randrange(2) << 7
        packet = struct.pack("<BB11f", 0xA5, bits, *numbers)
        heard.append({"packet": whole(packet), "says": [tracked, number, armours, *numbers]})
        blue, resets = dice.randrange(2), dice.randrange(2)
        numbers = [real() for _ in range(6)]
        packet = struct.pack("<BB6f", 0x5A, blue | resets << 1, *numbers)
        said.append({"packet": whole(packet), "says": [blue, resets, *numbers]})
    print(json.dumps({"from_pc": heard, "to_pc": said}))


main()
