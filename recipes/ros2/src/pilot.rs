//! The other process: drives 0.5 m/s ahead for 2 s, falls silent, and judges what the robot says of it.

use crate::messages::{JointState, Odometry, Twist, Vector3};
use crate::node::{node, topic};
use std::error::Error;
use std::thread::sleep;
use std::time::{Duration, Instant};

pub fn run() -> Result<(), Box<dyn Error>> {
    let mut node = node("pilot")?;
    let commands = topic(&node, "cmd_vel", "geometry_msgs", "Twist")?;
    let commands = node.create_publisher::<Twist>(&commands, None)?;
    let odom = topic(&node, "odom", "nav_msgs", "Odometry")?;
    let odom = node.create_subscription::<Odometry>(&odom, None)?;
    let joints = topic(&node, "joint_states", "sensor_msgs", "JointState")?;
    let joints = node.create_subscription::<JointState>(&joints, None)?;

    // Found when the robot is heard.
    let begin = Instant::now();
    let mut first = None;
    while first.is_none() {
        if begin.elapsed() > Duration::from_secs(30) {
            return Err("the robot was not heard within 30 s".into());
        }
        first = odom.take()?.map(|(message, _)| message.pose.pose.position.x);
        sleep(Duration::from_millis(5));
    }
    let first = first.unwrap_or_default();

    let ahead = Twist { linear: Vector3 { x: 0.5, y: 0.0, z: 0.0 }, ..Twist::default() };
    let (drive, end) = (Duration::from_secs(2), Duration::from_secs(4));
    let start = Instant::now();
    let (mut fastest, mut last, mut joint_names) = (0.0_f64, None, Vec::new());
    while start.elapsed() < end {
        if start.elapsed() < drive {
            commands.publish(ahead).map_err(|error| format!("{error:?}"))?;
        }
        while let Some((message, _)) = odom.take()? {
            fastest = fastest.max(message.twist.twist.linear.x);
            last = Some(message);
        }
        while let Some((message, _)) = joints.take()? {
            joint_names = message.name;
        }
        sleep(Duration::from_millis(20));
    }
    let last = last.ok_or("no odometry")?;
    let (way, speed) = (last.pose.pose.position.x - first, last.twist.twist.linear.x);
    println!(
        "pilot: {way:.2} m ahead, {fastest:.2} m/s at most, {speed:.3} m/s 2 s after the last command"
    );
    println!("pilot: joints {}", joint_names.join(", "));
    let is_right = (0.6..1.3).contains(&way) && (0.4..0.6).contains(&fastest) && speed.abs() < 0.02;
    if is_right && joint_names.len() == 4 {
        Ok(())
    } else {
        Err("that is not what was commanded".into())
    }
}
