//! `ros2-robot robot` runs the node of the robot until it is killed; `ros2-robot drive 0.5` publishes `/cmd_vel` at 50 Hz until it is.

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["robot"] => ros2_robot::robot::run(),
        ["drive", speed_m_s] => ros2_robot::driver::run(speed_m_s.parse()?),
        _ => Err("usage: ros2-robot robot | ros2-robot drive SPEED_IN_M_PER_S".into()),
    }
}
