//! The chassis over its motors, in the loop: command, CAN bus, simulated motors and floor, feedback, odometry.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::{
    Chassis, ChassisLimits, ChassisMode, Mecanum, MecanumWheels, ModeConfig, Modes,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::{Heading, Pose2, Twist, Vec2, World};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Controller, Fault, MotorConfig, Simulation, Wheel};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::Angle;

const WHEEL_RADIUS_M: f32 = 0.076;
const FRONT_LEFT_M: Vec2 = Vec2::new(0.2, 0.18);
const SPEED: PidConfig = PidConfig::new(4.0, 20.0, 0.0).with_output_limit(5.0);

struct Robot<'w> {
    world: &'w Simulation,
    runner: Runner<Nb<Controller<'w>>, &'w Simulation, Bus>,
    wheels: MecanumWheels<Handle<M3508>>,
    chassis: Chassis<Mecanum>,
}

impl<'w> Robot<'w> {
    /// With the fault, if any: the front left motor falls silent after two seconds.
    fn new(world: &'w Simulation, silent: bool) -> Self {
        let ids = MecanumWheels { front_left: 2, front_right: 1, rear_left: 3, rear_right: 4 };
        let motor = |id| world.attach(MotorConfig::m3508(id));
        let motors = ids.try_map(motor).unwrap();
        let (x, y) = (FRONT_LEFT_M.x, FRONT_LEFT_M.y);
        let wheel = |motor, x, y| Wheel::mecanum(motor, WHEEL_RADIUS_M, Vec2::new(x, y));
        world
            .attach_chassis(ChassisConfig::new(&[
                wheel(motors.front_left, x, y),
                wheel(motors.front_right, x, -y).reversed(),
                wheel(motors.rear_left, -x, y),
                wheel(motors.rear_right, -x, -y).reversed(),
            ]))
            .unwrap();
        if silent {
            let from = Instant::START + Duration::from_millis(2_000);
            let window = from..from + Duration::from_millis(8_000);
            world.fault(Fault::Silent(motors.front_left), window).unwrap();
        }
        let mut bus = Bus::new();
        let config = |id| Config::<M3508>::new(id).speed_loop(SPEED);
        let wheels = MecanumWheels {
            front_left: bus.attach(config(2)).unwrap(),
            front_right: bus.attach(config(1).reversed()).unwrap(),
            rear_left: bus.attach(config(3)).unwrap(),
            rear_right: bus.attach(config(4).reversed()).unwrap(),
        };
        let mut chassis = Chassis::new(Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M).unwrap());
        chassis.set_limits(ChassisLimits::new().with_acceleration(2.0, 10.0)).unwrap();
        let runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        Self { world, runner, wheels, chassis }
    }

    fn truth(&self) -> Pose2<World> {
        self.world.chassis().unwrap().0
    }

    fn heading(&self) -> Angle {
        self.truth().angle
    }

    fn run(&mut self, seconds: f32, mut command: impl FnMut(&mut Self, Tick)) {
        let end = self.world.now() + Duration::from_secs_f32(seconds).unwrap();
        while self.world.now() < end {
            self.world.advance(Duration::from_micros(100));
            self.runner.poll(16);
            let Some(tick) = self.runner.due() else { continue };
            if !self.runner.is_armed() {
                _ = self.runner.arm(tick);
            }
            command(self, tick);
            self.chassis.drive(self.runner.device_mut(), self.wheels, tick);
            self.runner.tick(tick);
        }
    }

    fn error_m(&self) -> f32 {
        let (pose, truth) = (self.chassis.pose(), self.truth());
        (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m)
    }
}

#[test]
fn spinning_while_driving_along_world_x_goes_straight_and_the_odometry_knows() {
    let world = Simulation::new(1);
    let mut robot = Robot::new(&world, false);
    robot.run(4.0, |robot, _| {
        let heading = Heading::new(robot.heading());
        robot.chassis.set_world(Twist::new(0.5, 0.0, 2.0), heading);
    });
    let truth = robot.truth();
    assert!(truth.x_m > 1.6 && truth.y_m.abs() < 0.08, "{truth:?}");
    assert!(robot.error_m() < 0.05, "{truth:?} {:?}", robot.chassis.pose());
}

#[test]
fn the_chassis_follows_its_gimbal() {
    let world = Simulation::new(2);
    let mut robot = Robot::new(&world, false);
    let config = ModeConfig::new(PidConfig::new(4.0, 0.0, 0.0).with_output_limit(4.0));
    let mut modes = Modes::new(config).unwrap();
    modes.set_mode(ChassisMode::FollowGimbal);
    robot.run(4.0, |robot, tick| {
        // The gimbal holds 60 degrees to the left in the world.
        let yaw = Angle::from_degrees(60.0) - robot.heading();
        match modes.update(Twist::ZERO, Some(yaw), tick.dt_s()) {
            Some(twist) => robot.chassis.set_body(twist),
            None => robot.chassis.stop(),
        }
    });
    let degrees = robot.truth().angle.as_degrees();
    assert!((degrees - 60.0).abs() < 3.0, "{degrees}");
}

#[test]
fn a_silent_wheel_is_flagged_and_refuses_and_the_position_is_followed_by_the_others() {
    let world = Simulation::new(3);
    let mut robot = Robot::new(&world, true);
    robot.run(3.0, |robot, _| robot.chassis.set_body(Twist::new(0.5, 0.0, 0.0)));
    let status = *robot.chassis.status();
    assert_eq!((status.motion_known, status.lost_wheels), (true, 1), "{status:?}");
    assert!(status.refused >= 1 && status.refusal.is_some(), "{status:?}");
    assert!(robot.error_m() < 0.1, "{:?} {:?}", robot.chassis.pose(), robot.truth());
}
