"""Writes a ring CSV as a ROS 2 bag, with PyPI's rosbags: make_bag.py CSV FOLDER mcap|sqlite3 joints|odometry|speeds TICKS_PER_TURN RADIUS_M BASE_M [file|message|storage]: the compression."""

import csv
import math
import sys

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

source, folder, storage, wheels = sys.argv[1:5]
ticks_per_turn, radius_m, base_m = (float(word) for word in sys.argv[5:8])
compression = sys.argv[8] if len(sys.argv) > 8 else None
store = get_typestore(Stores.ROS2_HUMBLE)
types = store.types
BEGAN_NS = 1_700_000_000_000_000_000


def header(ns, frame):
    stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def odometry(ns, pose):
    x, y, theta = pose
    make = lambda name, **fields: types[f"geometry_msgs/msg/{name}"](**fields)
    place = make(
        "Pose",
        position=make("Point", x=x, y=y, z=0.0),
        orientation=make("Quaternion", x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2)),
    )
    none = make("Vector3", x=0.0, y=0.0, z=0.0)
    return types["nav_msgs/msg/Odometry"](
        header=header(ns, "odom"),
        child_frame_id="base_link",
        pose=make("PoseWithCovariance", pose=place, covariance=np.zeros(36)),
        twist=make("TwistWithCovariance", twist=make("Twist", linear=none, angular=none), covariance=np.zeros(36)),
    )


def joints(ns, ticks):
    return types["sensor_msgs/msg/JointState"](
        header=header(ns, ""),
        name=["left_wheel_joint", "right_wheel_joint"],
        position=np.array([2 * math.pi * count / ticks_per_turn for count in ticks]),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )


def speeds(ns, radians_per_second):
    return types["sensor_msgs/msg/JointState"](
        header=header(ns, ""),
        name=["left_wheel_joint", "right_wheel_joint"],
        position=np.zeros(0),
        velocity=np.array(radians_per_second),
        effort=np.zeros(0),
    )


def sonar(ns, sensor, text):
    range_m = {"": math.nan, "inf": math.inf}.get(text)
    return types["sensor_msgs/msg/Range"](
        header=header(ns, f"sonar_{sensor}"),
        radiation_type=0,
        field_of_view=0.43,
        min_range=0.02,
        max_range=4.0,
        range=float(text) if range_m is None else range_m,
    )


rows = list(csv.DictReader(open(source, newline="")))
sensors = sum(name.startswith("r") and name[1:].isdigit() for name in rows[0])
pose, before = (0.0, 0.0, 0.0), None
plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
writer = Writer(folder, version=9, storage_plugin=plugin)
if compression:
    writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
with writer as bag:
    add = lambda topic, name: bag.add_connection(topic, name, typestore=store)
    name = "nav_msgs/msg/Odometry" if wheels == "odometry" else "sensor_msgs/msg/JointState"
    wheel_topic = add("/odom" if wheels == "odometry" else "/joint_states", name)
    text_topic = add("/chatter", "std_msgs/msg/String")
    sonars = [add(f"/sonar_{sensor}", "sensor_msgs/msg/Range") for sensor in range(sensors)]

    def write(topic, ns, message):
        bag.write(topic, ns + 2_000_000, store.serialize_cdr(message, topic.msgtype))

    last = None
    for row in rows:
        ns = BEGAN_NS + round(float(row["t_s"]) * 1e9)
        ticks = [int(row["left_ticks"]), int(row["right_ticks"])]
        left_m, right_m = (
            2 * math.pi * radius_m * (count - last) / ticks_per_turn for count, last in zip(ticks, before or ticks)
        )
        before = ticks
        turn = (right_m - left_m) / base_m
        half = 0.5 * turn
        chord_m = 0.5 * (left_m + right_m) * (math.sin(half) / half if half else 1.0)
        pose = (
            pose[0] + chord_m * math.cos(pose[2] + half),
            pose[1] + chord_m * math.sin(pose[2] + half),
            pose[2] + turn,
        )
        if wheels == "speeds":
            # One speed from just after the last row to this one.
            times = (ns,) if last is None else (ns - 99_000_000, ns)
            rolled = np.subtract(ticks, last or ticks)
            last = ticks
            spins = [2 * math.pi * count / ticks_per_turn / 0.1 for count in rolled]
            for at in times:
                write(wheel_topic, at, speeds(at, spins))
        else:
            write(wheel_topic, ns, odometry(ns, pose) if wheels == "odometry" else joints(ns, ticks))
        write(text_topic, ns, types["std_msgs/msg/String"](data="hello"))
        for sensor, topic in enumerate(sonars):
            write(topic, ns, sonar(ns, sensor, row[f"r{sensor}"]))
