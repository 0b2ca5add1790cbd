//! The bytes of the messages, against those that `rosbags` wrote from ROS's own definitions (`tests/data/generate.py`).

use byteorder::LittleEndian;
use ros2_client::Message;
use ros2_robot::messages::{
    Header, JointState, Odometry, Pose, PoseWithCovariance, Quaternion, Time, Twist,
    TwistWithCovariance, Vector3,
};

/// Header of CDR: little endian.
const HEAD: [u8; 4] = [0, 1, 0, 0];

fn bytes(message: &impl Message) -> Vec<u8> {
    let body = cdr_encoding::to_vec::<_, LittleEndian>(message).unwrap();
    [&HEAD[..], &body].concat()
}

const TWIST: Twist = Twist {
    linear: Vector3 { x: 0.5, y: -0.25, z: 3.0 },
    angular: Vector3 { x: 4.0, y: 5.0, z: -1.5 },
};

/// `from`, `from` + 1, and so on.
fn covariance(from: u8) -> ([f64; 32], [f64; 4]) {
    let at = |place: usize| f64::from(from) + place as f64;
    (std::array::from_fn(at), std::array::from_fn(|place| at(32 + place)))
}

fn header(frame: &str) -> Header {
    Header { stamp: Time { sec: 7, nanosec: 20_000_000 }, frame_id: frame.into() }
}

#[test]
fn a_twist_has_the_bytes_of_ros() {
    assert_eq!(bytes(&TWIST), include_bytes!("data/twist.cdr"));
}

#[test]
fn an_odometry_has_the_bytes_of_ros() {
    let orientation = Quaternion { x: 0.0, y: 0.0, z: 0.6, w: 0.8 };
    let pose = Pose { position: Vector3 { x: 1.0, y: 2.0, z: 3.0 }, orientation };
    let odometry = Odometry {
        header: header("odom"),
        child_frame_id: "base_link".into(),
        pose: PoseWithCovariance { pose, covariance: covariance(0) },
        twist: TwistWithCovariance { twist: TWIST, covariance: covariance(100) },
    };
    assert_eq!(bytes(&odometry), include_bytes!("data/odometry.cdr"));
}

#[test]
fn joint_states_have_the_bytes_of_ros() {
    let joints = JointState {
        header: header(""),
        name: vec!["front_left".into(), "rear".into()],
        position: vec![1.0, 2.0],
        velocity: vec![3.0, 4.0],
        effort: vec![5.0, 6.0],
    };
    assert_eq!(bytes(&joints), include_bytes!("data/joint_states.cdr"));
}
