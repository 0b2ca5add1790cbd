//! A process that drives the robot ahead, 50 times a second, until it is killed.

use crate::messages::{Twist, Vector3};
use crate::node::{domain, node, publisher};
use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

pub fn run(speed_m_s: f64) -> Result<(), Box<dyn Error>> {
    let mut node = node("driver", domain()?)?;
    let commands = publisher::<Twist>(&mut node, "cmd_vel")?;
    let ahead =
        Twist { linear: Vector3 { x: speed_m_s, ..Vector3::default() }, ..Twist::default() };
    loop {
        // The next command replaces one that could not leave.
        _ = commands.publish(ahead);
        sleep(Duration::from_millis(20));
    }
}
