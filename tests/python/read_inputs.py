"""Reads the inputs of a record, by docs/replay.md alone: prints what each bus heard and what its motors were given."""

import json
import struct
import sys

from mcap_ros2.reader import read_ros2_messages

START, TICK, FRAME, COMMAND, REQUEST = 1, 2, 3, 7, 8
FIRST_LINE = 8
TARGETS = [
    "Coast", "Current", "Duty", "Speed", "Angle", "TotalAngle", "Torque", "Impedance", "Motion", "Brake", "Handbrake",
]


def entries(words):
    """Kind, place, byte and words of each entry."""
    at = 0
    while at < len(words):
        kind, place, length, more = words[at].to_bytes(4, "little")
        yield kind, place, more, words[at + 1 : at + 1 + length]
        at += 1 + length
    assert at == len(words), "the last entry is not whole"


def mix(number, data):
    """FNV-1a, 64 bits."""
    for byte in data:
        number = (number ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return number


def main(path):
    words = []
    for message in read_ros2_messages(path, topics=["/inputs"]):
        words += message.ros_msg.words
    buses, ticks = {}, {}
    for kind, place, more, rest in entries(words):
        bus = buses.setdefault(place, {"frames": 0, "hash": 0, "times": [], "halves": 0, "given": {}})
        if kind in (START, TICK):
            ticks[place] = rest[0] | rest[1] << 32
            bus["halves"] += kind == TICK
        elif kind == FRAME:
            at, key, low, high = rest
            # The newest 32 bits of its time, near the tick's.
            behind = (at - ticks[place] + 2**31) % 2**32 - 2**31
            data = struct.pack("<II", low, high)[:more]
            bus["frames"] += 1
            bus["hash"] = mix(bus["hash"], struct.pack("<IB", key, more) + data)
            bus["times"].append(ticks[place] + behind)
        elif kind == COMMAND:
            text = struct.pack(f"<{len(rest)}I", *rest)
            name = TARGETS[text[0]]
            given = bus["given"].setdefault(str(more), {})
            given[name] = given.get(name, 0) + 1
    print(json.dumps(buses))


main(sys.argv[1])
