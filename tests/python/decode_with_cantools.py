"""Reads DBC files with cantools and compares them with what Rust says is in them.

Arguments: the folder of the DBC files; a file of JSON lines. A line is either a message,
{"bus", "message", ...}, or a frame with its values, {"bus", "id", "extended", "data", "values"}.
"""

import json
import math
import sys
from pathlib import Path

import cantools


def same(ours, theirs):
    """Numbers that JSON cannot write are words."""
    if isinstance(ours, str):
        ours = float(ours)
    if math.isnan(ours):
        return math.isnan(theirs)
    return theirs == ours or math.isclose(theirs, ours, rel_tol=1e-12, abs_tol=1e-12)


def check_message(database, line):
    """Everything that a file says of a message beside its numbers."""
    message = database.get_message_by_name(line["message"])
    theirs = {
        "id": message.frame_id,
        "extended": message.is_extended_frame,
        "length": message.length,
        "senders": sorted(message.senders),
        "signals": {
            signal.name: {
                "unit": signal.unit or "",
                "receivers": sorted(signal.receivers),
                "choices": {str(raw): str(text) for raw, text in (signal.choices or {}).items()},
                "float": signal.is_float,
                "switch": signal.is_multiplexer,
                "present_if": signal.multiplexer_ids or [],
            }
            for signal in message.signals
        },
    }
    for key, value in theirs.items():
        assert value == line[key], f"{line['message']}: {key} is {value}, not {line[key]}"


def check_frame(database, line):
    """Every value of a frame."""
    mask = 0x80000000 if line["extended"] else 0
    message = next(
        m for m in database.messages
        if (m.frame_id | (0x80000000 if m.is_extended_frame else 0)) == line["id"] | mask
    )
    decoded = message.decode(bytes.fromhex(line["data"]), decode_choices=False)
    assert decoded.keys() == line["values"].keys(), f"{line}: {sorted(decoded)}"
    for name, ours in line["values"].items():
        assert same(ours, decoded[name]), f"{line}: {name} is {decoded[name]}"


def main():
    folder, lines = Path(sys.argv[1]), Path(sys.argv[2])
    databases, counts = {}, {}
    for text in lines.open(encoding="utf-8"):
        line = json.loads(text)
        bus = line["bus"]
        if bus not in databases:
            databases[bus] = cantools.database.load_file(folder / f"{bus}.dbc", strict=True)
        if "message" in line:
            check_message(databases[bus], line)
        else:
            check_frame(databases[bus], line)
            counts[bus] = counts.get(bus, 0) + 1
    assert databases, "nothing to compare"
    for bus, count in counts.items():
        messages = len(databases[bus].messages)
        print(f"{bus}: {count} frames of {messages} messages decoded to the same values")


main()
