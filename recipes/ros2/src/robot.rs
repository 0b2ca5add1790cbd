//! The node on the robot: `cmd_vel` in; `odom` and `joint_states` out, 50 times a second. Here with simulated motors, in real time.

use crate::messages::{
    Header, JointState, Odometry, Pose, Quaternion, Time, Twist as TwistMessage, Vector3,
};
use crate::node::{node, topic};
use drivetrain::chassis::{Chassis, ChassisLimits, Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::{Body, Twist, Vec2};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, MotorConfig, Simulation, Wheel};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use std::error::Error;
use std::thread::sleep;

/// A command that is older is none: the pilot's process may have ended.
const FRESH: Duration = Duration::from_millis(250);
const SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0);
const NAMES: [&str; 4] = ["front_left", "front_right", "rear_left", "rear_right"];

/// Takes the motion in the plane; `None` if a number is not finite.
#[expect(clippy::cast_possible_truncation, reason = "f32 is exact enough for a speed")]
fn motion(message: &TwistMessage) -> Option<Twist<Body>> {
    let parts = [message.linear.x, message.linear.y, message.angular.z];
    let [x, y, turn] = parts.map(|part| part as f32);
    parts.iter().all(|part| part.is_finite()).then(|| Twist::new(x, y, turn))
}

fn header(now: Instant, frame: &str) -> Header {
    let micros = now.as_micros();
    let sec = i32::try_from(micros / 1_000_000).unwrap_or(i32::MAX);
    let nanosec = u32::try_from(micros % 1_000_000).unwrap_or(0) * 1_000;
    Header { stamp: Time { sec, nanosec }, frame_id: frame.into() }
}

fn odometry(chassis: &Chassis<Mecanum>, now: Instant) -> Odometry {
    let (pose, moving) = (chassis.pose(), chassis.measured());
    let position = pose.position().to_vec();
    let (sine, cosine) = f64::from(pose.heading().angle().as_radians() / 2.0).sin_cos();
    let mut message = Odometry { header: header(now, "odom"), ..Odometry::default() };
    message.child_frame_id = "base_link".into();
    message.pose.pose = Pose {
        position: Vector3 { x: position.x.into(), y: position.y.into(), z: 0.0 },
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
    for (name, wheel) in NAMES.iter().zip(wheels) {
        let Some(state) = bus.state(wheel) else { continue };
        message.name.push((*name).into());
        message.position.push(state.position.as_angle().as_radians().into());
        message.velocity.push(state.velocity.as_rad_per_s().into());
        message.effort.push(state.torque_nm.into());
    }
    message
}

/// Runs for so many seconds.
pub fn run(seconds: u64) -> Result<(), Box<dyn Error>> {
    let mut node = node("robot")?;
    let commands = topic(&node, "cmd_vel", "geometry_msgs", "Twist")?;
    let commands = node.create_subscription::<TwistMessage>(&commands, None)?;
    let odom = topic(&node, "odom", "nav_msgs", "Odometry")?;
    let odom = node.create_publisher::<Odometry>(&odom, None)?;
    let joints = topic(&node, "joint_states", "sensor_msgs", "JointState")?;
    let joints = node.create_publisher::<JointState>(&joints, None)?;

    let world = Simulation::new(1);
    let wheel = |id, x, y: f32| -> Result<Wheel, Box<dyn Error>> {
        let wheel = Wheel::mecanum(world.attach(MotorConfig::m3508(id))?, 0.076, Vec2::new(x, y));
        Ok(if y < 0.0 { wheel.reversed() } else { wheel })
    };
    let floor = [
        wheel(2, 0.2, 0.18)?,
        wheel(1, 0.2, -0.18)?,
        wheel(3, -0.2, 0.18)?,
        wheel(4, -0.2, -0.18)?,
    ];
    world.attach_chassis(ChassisConfig::new(&floor).with_mass_kg(20.0))?;
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
        .with_acceleration(2.0, 8.0)
        .with_wheel_speed(AngularVelocity::from_rpm(400.0));
    chassis.set_limits(limits)?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);

    let start = std::time::Instant::now();
    let mut heard: Option<(Twist<Body>, Instant)> = None;
    let mut ticks = 0_u32;
    while start.elapsed().as_secs() < seconds {
        // The simulated time follows the real one.
        world.advance(Duration::from_micros(500));
        let ahead = world.now().since(Instant::START).as_micros();
        let real = u64::try_from(start.elapsed().as_micros())?;
        sleep(std::time::Duration::from_micros(ahead.saturating_sub(real)));
        let now = world.now();
        while let Some((message, _)) = commands.take()? {
            // One that is no motion takes the last one away, as a bus of motors does.
            heard = motion(&message).map(|motion| (motion, now));
        }
        runner.poll(32);
        let Some(tick) = runner.due() else { continue };
        // This robot arms by itself, which only a simulated one may: no topic arms a real one.
        let _not_yet = runner.is_armed() || runner.arm(tick).is_ok();
        let fresh = heard.filter(|(_, at)| now.since(*at) <= FRESH);
        chassis.set_body(fresh.map_or(Twist::ZERO, |(motion, _)| motion));
        chassis.drive(runner.device_mut(), wheels, tick);
        runner.tick(tick);
        ticks += 1;
        if ticks.is_multiple_of(20) {
            // Nobody listens, perhaps: that is no error of the robot.
            _ = odom.publish(odometry(&chassis, now));
            _ = joints.publish(joint_state(runner.device(), wheels, now));
        }
    }
    Ok(())
}
