//! The node on the robot, here with simulated motors in real time.

use crate::messages::{
    Header, JointState, Odometry, Pose, Quaternion, Time, Twist as TwistMessage, Vector3,
};
use crate::node::{domain, node, publisher, subscription};
use drivetrain::chassis::{Chassis, ChassisLimits, Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, MotorConfig, SimError, Simulation, Wheel};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use std::error::Error;
use std::thread::sleep;

/// Age at which a command expires: the process of the driver may have ended. ROS's `diff_drive_controller` has the same.
pub const EXPIRY: Duration = Duration::from_millis(500);
/// Acceleration and braking of the chassis, in m/s².
pub const ACCELERATION_M_S2: f32 = 2.0;
const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0); // A per rad/s, A per rad
const NAMES: [&str; 4] = ["front_left", "front_right", "rear_left", "rear_right"];
const TICKS_PER_REPORT: u32 = 20;

/// The newest command and its age.
#[derive(Debug, Default)]
struct Command(Option<(Twist<Body>, Instant)>);

impl Command {
    /// Takes a message that arrived at `now`. A number that is not finite takes the command before it away, too.
    #[expect(clippy::cast_possible_truncation, reason = "f32 resolves a speed to a millionth")]
    fn hear(&mut self, message: &TwistMessage, now: Instant) {
        let parts = [message.linear.x, message.linear.y, message.angular.z];
        let [x, y, turn] = parts.map(|part| part as f32);
        let is_finite = [x, y, turn].iter().all(|part| part.is_finite());
        self.0 = is_finite.then(|| (Twist::new(x, y, turn), now));
    }

    /// Returns the motion; zero if the command has expired, and unless all wheels are armed: if a wheel is lost, the others brake.
    fn motion(&self, now: Instant, is_armed: bool) -> Twist<Body> {
        let fresh = self.0.filter(|(_, at)| is_armed && now.since(*at) <= EXPIRY);
        fresh.map_or(Twist::ZERO, |(motion, _)| motion)
    }
}

fn header(now: Instant, frame: &str) -> Header {
    let micros = now.as_micros();
    let sec = i32::try_from(micros / 1_000_000).unwrap_or(i32::MAX);
    let nanosec = u32::try_from(micros % 1_000_000).unwrap_or(0) * 1_000;
    Header { stamp: Time { sec, nanosec }, frame_id: frame.into() }
}

/// `place` is x and y in m and the heading in rad.
fn odometry([x, y, heading]: [f64; 3], moving: Twist<Body>, now: Instant) -> Odometry {
    let (sine, cosine) = (heading / 2.0).sin_cos();
    let mut message = Odometry { header: header(now, "odom"), ..Odometry::default() };
    message.child_frame_id = "base_link".into();
    message.pose.pose = Pose {
        position: Vector3 { x, y, z: 0.0 },
        orientation: Quaternion { x: 0.0, y: 0.0, z: sine, w: cosine },
    };
    message.twist.twist = TwistMessage {
        linear: Vector3 { x: moving.vx_m_s.into(), y: moving.vy_m_s.into(), z: 0.0 },
        angular: Vector3 { x: 0.0, y: 0.0, z: moving.wz_rad_s.into() },
    };
    message
}

fn joint_state(bus: &Bus, wheels: MecanumWheels<Handle<M3508>>, now: Instant) -> JointState {
    let mut message = JointState { header: header(now, ""), ..JointState::default() };
    for (name, wheel) in NAMES.iter().zip(wheels.into_array()) {
        let Some(state) = bus.state(wheel) else { continue };
        message.name.push((*name).into());
        message.position.push(state.position.as_angle().as_radians().into());
        message.velocity.push(state.velocity.as_rad_per_s().into());
        message.effort.push(state.torque_nm.into());
    }
    message
}

fn simulated() -> Result<Simulation, SimError> {
    let world = Simulation::new(1);
    let wheel = |id, x, y: f32| -> Result<Wheel, SimError> {
        let wheel = Wheel::mecanum(world.attach(MotorConfig::m3508(id))?, 0.076, Vec2::new(x, y));
        Ok(if y < 0.0 { wheel.reversed() } else { wheel })
    };
    let wheels = [
        wheel(2, 0.2, 0.18)?,
        wheel(1, 0.2, -0.18)?,
        wheel(3, -0.2, 0.18)?,
        wheel(4, -0.2, -0.18)?,
    ];
    world.attach_chassis(ChassisConfig::new(&wheels).with_mass_kg(20.0))?;
    Ok(world)
}

/// Runs until the process is killed.
pub fn run() -> Result<(), Box<dyn Error>> {
    let mut node = node("robot", domain()?)?;
    let commands = subscription::<TwistMessage>(&mut node, "cmd_vel")?;
    let odom = publisher::<Odometry>(&mut node, "odom")?;
    let truth = publisher::<Odometry>(&mut node, "ground_truth")?;
    let joints = publisher::<JointState>(&mut node, "joint_states")?;

    let world = simulated()?;
    let mut bus = Bus::new();
    let config = |id| Config::<M3508>::new(id).speed_loop(SPEED);
    let wheels = MecanumWheels {
        front_left: bus.attach(config(2))?,
        front_right: bus.attach(config(1).reversed())?,
        rear_left: bus.attach(config(3))?,
        rear_right: bus.attach(config(4).reversed())?,
    };
    let mut chassis = Chassis::new(Mecanum::new(0.076, Vec2::new(0.2, 0.18))?);
    let limits = ChassisLimits::new()
        .with_acceleration(ACCELERATION_M_S2, 8.0)
        .with_wheel_speed(AngularVelocity::from_rpm(400.0));
    chassis.set_limits(limits)?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);

    let start = std::time::Instant::now();
    let mut command = Command::default();
    let mut ticks = 0_u32;
    loop {
        // The simulated time follows the real one.
        world.advance(Duration::from_micros(500));
        let ahead = world.now().since(Instant::START).as_micros();
        let real = u64::try_from(start.elapsed().as_micros())?;
        sleep(std::time::Duration::from_micros(ahead.saturating_sub(real)));
        let now = world.now();
        while let Some((message, _)) = commands.take()? {
            command.hear(&message, now);
        }
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        // Arms by itself, as only a simulated robot may.
        let is_armed = runner.is_armed() || runner.arm(tick).is_ok();
        chassis.set_body(command.motion(tick.now(), is_armed));
        chassis.drive(runner.device_mut(), wheels, tick);
        runner.tick(tick);
        ticks = ticks.wrapping_add(1);
        if ticks.is_multiple_of(TICKS_PER_REPORT) {
            let (pose, (body, twist)) = (chassis.pose(), world.chassis().ok_or("no chassis")?);
            let (at, heading) = (pose.position().to_vec(), pose.heading().angle().as_radians());
            let place = [at.x.into(), at.y.into(), heading.into()];
            // The next message replaces one that could not leave.
            _ = odom.publish(odometry(place, chassis.measured(), now));
            _ = joints.publish(joint_state(runner.device(), wheels, now));
            let place = [body.x_m, body.y_m, body.angle.as_radians()].map(f64::from);
            _ = truth.publish(odometry(place, twist, now));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ahead(x: f64) -> TwistMessage {
        TwistMessage { linear: Vector3 { x, ..Vector3::default() }, ..TwistMessage::default() }
    }

    #[test]
    fn a_command_holds_for_its_time_and_one_that_is_not_finite_stops() {
        let at = |ms| Instant::START + Duration::from_millis(ms);
        let mut command = Command::default();
        assert_eq!(command.motion(at(0), true), Twist::ZERO);
        command.hear(&ahead(0.5), at(100));
        assert_eq!(command.motion(at(600), true), Twist::new(0.5, 0.0, 0.0));
        assert_eq!(command.motion(at(601), true), Twist::ZERO);
        assert_eq!(command.motion(at(600), false), Twist::ZERO, "a wheel is lost");
        // The last one is finite as f64 only.
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            command.hear(&ahead(0.5), at(700));
            command.hear(&ahead(bad), at(701));
            assert_eq!(command.motion(at(702), true), Twist::ZERO, "{bad}");
        }
    }
}
