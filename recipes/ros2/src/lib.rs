//! A ROS 2 node over `drivetrain`, by the pure-Rust client `ros2-client`: no ROS has to be installed.
//!
//! ```text
//! cargo run -- robot          the node of a robot with simulated motors
//! cargo run -- drive 0.5      drives it with 0.5 m/s, from a second terminal
//! ```
//!
//! | topic | type | |
//! |---|---|---|
//! | `/cmd_vel` | `geometry_msgs/Twist` | expires after 500 ms; one with NaN or infinity stops the chassis |
//! | `/odom` | `nav_msgs/Odometry` | 50 Hz, from `odom` to `base_link` |
//! | `/joint_states` | `sensor_msgs/JointState` | 50 Hz, the four wheels |
//! | `/ground_truth` | `nav_msgs/Odometry` | 50 Hz, the simulated body: a robot of steel has none |
//!
//! Axes and units of ROS (REP 103) and of `drivetrain` are the same: x forward, y left, m/s and rad/s. No topic arms the robot.
//! `ROS_DOMAIN_ID` chooses the domain, as in ROS. Processes find each other by UDP multicast.

pub mod driver;
pub mod messages;
pub mod node;
pub mod robot;
