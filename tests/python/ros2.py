"""A ROS 2 node of zenoh-ros2-sdk that hears a robot's topics, drives it, and disarms it.

Types are those of rosbags, by which hashes and bytes are compared, too: ros2.py PORT FOLDER
"""

import json
import os
import pathlib
import sys
import time

import zenoh_ros2_sdk.message_registry as registry
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession

PORT, FOLDER = int(sys.argv[1]), pathlib.Path(sys.argv[2]) / "messages"
TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/rosout": "rcl_interfaces/msg/Log",
    "/signals/odometry_heading": "std_msgs/msg/Float64",
}
TRIGGER = ("# nothing\n", "bool success\nstring message\n")

# rosbags knows no services: this is what hiroz has.
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"

store = get_typestore(Stores.ROS2_JAZZY)
# The SDK would clone the definitions; rosbags has them.
for name in store.types:
    package, kind, message = name.split("/")
    if kind != "msg":
        continue
    text = store.generate_msgdef(name, ros_version=2)[0].split("=" * 80)[0]
    path = FOLDER / package / "msg" / f"{message}.msg"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
registry.get_registry(str(FOLDER))

heard = {}
session = ZenohSession.get_instance("127.0.0.1", PORT)


def listen(topic, kind):
    told = {"count": 0, "same_hash": False, "same_cdr": False}
    heard[topic] = told

    def hear(message):
        told["count"] += 1
        told["names"] = [str(name) for name in getattr(message, "name", [])] if kind.endswith("JointState") else []

    subscriber = ROS2Subscriber(topic, kind, hear, router_port=PORT)

    # The bytes as they came: read and written again by rosbags they are the same.
    def raw(sample):
        data = bytes(sample.payload.to_bytes())
        message = store.deserialize_cdr(data, kind)
        told["same_cdr"] = bytes(store.serialize_cdr(message, kind)) == data
        told["same_hash"] = str(sample.key_expr).endswith("/" + store.hash_rihs01(kind))

    key = f"0{topic}/**"
    return subscriber, session.session.declare_subscriber(key, raw)


def main():
    keep = [listen(*topic) for topic in TOPICS.items()]
    time.sleep(2.5)
    twist = ROS2Publisher("/cmd_vel", "geometry_msgs/msg/Twist", router_port=PORT)
    vector = session.store.types["geometry_msgs/msg/Vector3"]
    time.sleep(0.5)
    for count in range(150):
        speed = 0.0 if count < 10 or count >= 140 else 0.5
        twist.publish(linear=vector(x=speed, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0))
        time.sleep(0.02)
    disarm = ROS2ServiceClient("/disarm", "std_srvs/srv/Trigger", *TRIGGER, router_port=PORT)
    time.sleep(0.3)
    answer = disarm.call(structure_needs_at_least_one_member=0)
    heard["disarm"] = {
        "success": bool(answer and answer.success),
        "same_hash": disarm.type_hash == TRIGGER_HASH,
    }
    time.sleep(0.5)
    print(json.dumps(heard), flush=True)
    return len(keep) - len(TOPICS)


status = 1
try:
    status = main()
finally:
    # Threads of the session do not end by themselves.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
