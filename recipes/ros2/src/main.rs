//! A ROS 2 node over `drivetrain`, by the pure-Rust client `ros2-client`: no ROS has to be installed.
//!
//! ```text
//! cargo run --release -- robot 60      the node: /cmd_vel in, /odom and /joint_states out, for 60 s, on simulated motors
//! cargo run --release -- pilot         drives it from another process, and judges what it says
//! ```
//!
//! | topic | type | |
//! |---|---|---|
//! | `/cmd_vel` | `geometry_msgs/Twist` | expires after 250 ms; one with NaN takes the last one away |
//! | `/odom` | `nav_msgs/Odometry` | 50 Hz, `odom` to `base_link` |
//! | `/joint_states` | `sensor_msgs/JointState` | 50 Hz, the four wheels |
//!
//! Axes and units of both are the same (REP 103): x forward, y left, m/s and rad/s. No topic arms the robot.

mod messages;
mod node;
mod pilot;
mod robot;

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["robot", seconds] => robot::run(seconds.parse()?),
        ["pilot"] => pilot::run(),
        _ => Err("usage: ros2-robot robot SECONDS | ros2-robot pilot".into()),
    }
}
