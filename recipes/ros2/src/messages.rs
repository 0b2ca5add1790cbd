//! The messages, in the order of their fields in `geometry_msgs`, `nav_msgs` and `sensor_msgs`: CDR has no names.

use ros2_client::Message;
use serde::{Deserialize, Serialize};

/// A message with a topic of its own: the package and the name of its type.
pub trait TopicMessage: Message + 'static {
    const TYPE: (&'static str, &'static str);
}

impl TopicMessage for Twist {
    const TYPE: (&'static str, &'static str) = ("geometry_msgs", "Twist");
}

impl TopicMessage for Odometry {
    const TYPE: (&'static str, &'static str) = ("nav_msgs", "Odometry");
}

impl TopicMessage for JointState {
    const TYPE: (&'static str, &'static str) = ("sensor_msgs", "JointState");
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/Twist`: m/s and rad/s; x forward, y left, z up.
#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    pub linear: Vector3,
    pub angular: Vector3,
}

#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub struct Time {
    pub sec: i32,
    pub nanosec: u32,
}

/// `std_msgs/Header`.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

/// 36 numbers: serde has arrays up to 32, and CDR writes two arrays in a row like one.
pub type Covariance = ([f64; 32], [f64; 4]);

#[derive(Debug, Default, Clone, Copy, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    pub pose: Pose,
    pub covariance: Covariance,
}

#[derive(Debug, Default, Clone, Copy, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    pub twist: Twist,
    pub covariance: Covariance,
}

/// `nav_msgs/Odometry`.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub struct Odometry {
    pub header: Header,
    pub child_frame_id: String,
    pub pose: PoseWithCovariance,
    pub twist: TwistWithCovariance,
}

/// `sensor_msgs/JointState`: rad, rad/s and Nm.
#[derive(Debug, Default, Clone, Serialize, Deserialize)]
pub struct JointState {
    pub header: Header,
    pub name: Vec<String>,
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    pub effort: Vec<f64>,
}

impl Message for Twist {}
impl Message for Odometry {}
impl Message for JointState {}
