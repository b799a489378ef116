"""Prints as JSON what a bag holds: `facts.py mcap|rosbags BAG`, one word for each of two readers that know nothing of each other."""

import json
import math
import sys
from pathlib import Path


def with_mcap(path):
    """Topic, type, log time in nanoseconds and message, in the order of the file; mcap and mcap-ros2-support."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    import yaml

    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        header, channels = reader.get_header(), reader.get_summary().channels.values()
        assert header.profile == "ros2" and header.library.startswith("slamd "), header
        assert all(channel.message_encoding == "cdr" for channel in channels)
        assert all(schema.encoding == "ros2msg" for schema in reader.get_summary().schemas.values())
        for channel in channels:
            (quality,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert (quality["durability"] == 1) == (channel.topic in ("/map", "/tf_static", "/path", "/robot_description")), channel
        for schema, channel, record, message in reader.iter_decoded_messages(log_time_order=False):
            yield channel.topic, schema.name, record.log_time, message


def with_rosbags(path):
    """The same, in order of time; rosbags. The definitions beside the messages are those of ROS 2 Jazzy, by their hashes."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([Path(path)]) as reader:
        jazzy = get_typestore(Stores.ROS2_JAZZY)
        for connection in reader.connections:
            name = connection.msgtype
            assert reader.typestore.hash_rihs01(name) == jazzy.hash_rihs01(name), name
            # Reliable, and never late.
            (quality,) = connection.ext.offered_qos_profiles
            assert quality.reliability.name == "RELIABLE" and quality.deadline.sec == 9223372036, quality
        for connection, at, data in reader.messages():
            yield connection.topic, connection.msgtype, at, reader.deserialize(data, connection.msgtype)


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def numbers(thing, names):
    return [float(getattr(thing, name)) for name in names]


def pose(thing):
    return numbers(thing.position, "xyz") + numbers(thing.orientation, "xyzw")


def transform(thing):
    return numbers(thing.translation, "xyz") + numbers(thing.rotation, "xyzw")


class Facts:
    def __init__(self):
        self.topics, self.frames, self.ranges, self.diagnostics, self.first_error = {}, {}, {}, {}, {}
        self.map, self.pose, self.odom, self.fields = None, None, None, {}
        self.path, self.description, self.rays, self.points = None, None, {}, 0
        self.in_order, self.last, self.latest_stamp = True, 0, 0

    def take(self, topic, kind, at, message):
        self.in_order &= at >= self.last
        self.last = at
        count, _ = self.topics.get(topic, (0, ""))
        self.topics[topic] = (count + 1, kind)
        if hasattr(message, "header"):
            assert ns(message.header.stamp) <= at, (topic, at)
        if topic in ("/tf", "/tf_static"):
            for part in message.transforms:
                self.frames[part.child_frame_id] = (part.header.frame_id, ns(part.header.stamp), transform(part.transform))
        elif topic == "/map":
            info = message.info
            size = [info.width, info.height, float(info.resolution)]
            self.map = [message.header.frame_id, *size, pose(info.origin), [int(cell) for cell in message.data]]
        elif topic == "/pose":
            self.pose = self.placed(message)
        elif topic == "/odom":
            twist = message.twist
            velocity = numbers(twist.twist.linear, "xyz") + numbers(twist.twist.angular, "xyz")
            self.odom = [*self.placed(message), message.child_frame_id, velocity, [float(value) for value in twist.covariance]]
        elif topic == "/diagnostics":
            self.diagnose(message, at)
        elif topic == "/path":
            self.path = [message.header.frame_id, len(message.poses), pose(message.poses[-1].pose)]
        elif topic == "/robot_description":
            self.description = message.data
        elif topic == "/scan":
            assert len(message.ranges) == 360 and message.header.frame_id == "base_link", message.header
            for index, ray in enumerate(message.ranges):
                if not math.isnan(ray):
                    self.rays[index] = self.rays.get(index, 0) + 1
        elif topic == "/points":
            assert [field.name for field in message.fields] == ["x", "y", "z"] and message.point_step == 12
            assert len(message.data) == 12 * message.width
            self.points += message.width
        else:
            self.range(topic, message)

    def placed(self, message):
        covariance = [float(value) for value in message.pose.covariance]
        return [message.header.frame_id, ns(message.header.stamp), pose(message.pose.pose), covariance]

    def diagnose(self, message, at):
        for status in message.status:
            level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
            values = {pair.key: pair.value for pair in status.values}
            self.diagnostics[status.name] = [level, status.message, status.hardware_id, values]
            if level == 2:
                self.first_error.setdefault(status.name, at)

    def range(self, topic, message):
        """Counts of finite, infinite and missing ranges, and of those that are there though the sensor had been found faulty."""
        fixed = [message.header.frame_id, int(message.radiation_type)]
        fixed += numbers(message, ("field_of_view", "min_range", "max_range", "variance"))
        assert self.fields.setdefault(topic, fixed) == fixed
        count = self.ranges.setdefault(topic, [0, 0, 0, 0])
        found = self.first_error.get("slamd: " + topic[1:])
        if found is not None and ns(message.header.stamp) > found and not math.isnan(message.range):
            count[3] += 1
        if math.isfinite(message.range):
            assert fixed[3] - 1e-6 <= message.range <= fixed[4] + 1e-6, message
            count[0] += 1
        else:
            count[1 if math.isinf(message.range) else 2] += 1


facts = Facts()
for found in {"mcap": with_mcap, "rosbags": with_rosbags}[sys.argv[1]](sys.argv[2]):
    facts.take(*found)
json.dump(vars(facts), sys.stdout)
