"""Writes the messages of tests/messages.rs with rosbags 0.11.9 (pip install rosbags), from the definitions of ROS 2 Jazzy."""
from pathlib import Path

import numpy
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
kind = lambda name: store.types[name]
vector, time = kind("geometry_msgs/msg/Vector3"), kind("builtin_interfaces/msg/Time")
point, quaternion = kind("geometry_msgs/msg/Point"), kind("geometry_msgs/msg/Quaternion")
header = lambda frame: kind("std_msgs/msg/Header")(time(7, 20_000_000), frame)
covariance = lambda begin: numpy.arange(begin, begin + 36, dtype=numpy.float64)
array = lambda *values: numpy.array(values, dtype=numpy.float64)

twist = kind("geometry_msgs/msg/Twist")(vector(0.5, -0.25, 3.0), vector(4.0, 5.0, -1.5))
pose = kind("geometry_msgs/msg/Pose")(point(1.0, 2.0, 3.0), quaternion(0.0, 0.0, 0.6, 0.8))
odometry = kind("nav_msgs/msg/Odometry")(
    header("odom"), "base_link",
    kind("geometry_msgs/msg/PoseWithCovariance")(pose, covariance(0)),
    kind("geometry_msgs/msg/TwistWithCovariance")(twist, covariance(100)),
)
joints = kind("sensor_msgs/msg/JointState")(header(""), ["front_left", "rear"], array(1, 2), array(3, 4), array(5, 6))

here = Path(__file__).parent
for name, message in (("twist", twist), ("odometry", odometry), ("joint_states", joints)):
    (here / f"{name}.cdr").write_bytes(bytes(store.serialize_cdr(message, message.__msgtype__)))
