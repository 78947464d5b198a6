"""Reads a record with the package mcap-ros2-support: no code of ours.

Argument: the file. Prints one JSON object: for each topic the number of its messages, the time and the
fields of the first and the last of them, and their sums; NaN as null.
"""

import json
import math
import sys

from mcap_ros2.reader import read_ros2_messages


def plain(value):
    return None if isinstance(value, float) and math.isnan(value) else value


def main():
    topics = {}
    for message in read_ros2_messages(sys.argv[1]):
        fields = {name: getattr(message.ros_msg, name) for name in message.ros_msg.__slots__}
        fields = {name: plain(value) for name, value in fields.items()}
        found = topics.setdefault(message.channel.topic, {"count": 0, "sums": {}})
        found["count"] += 1
        found["last"] = {"at": message.log_time_ns, **fields}
        found.setdefault("first", found["last"])
        for name, value in fields.items():
            if isinstance(value, float):
                found["sums"][name] = found["sums"].get(name, 0.0) + value
    print(json.dumps(topics))


main()
