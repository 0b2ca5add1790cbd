//! A mecanum robot on the simulated floor: what the wheels are told, and where the body truly goes.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::geometry::{Body, Pose2, Twist, Vec2, World};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Controller, Line, MotorConfig, Simulation, Wheel};
use drivetrain::time::Duration;
use drivetrain::units::AngularVelocity;

const WHEEL_RADIUS_M: f32 = 0.076;
const FRONT_LEFT_M: Vec2 = Vec2::new(0.2, 0.18);
/// The ground holds 2 Nm a wheel, so 5 A: more only makes it spin.
const SPEED: PidConfig = PidConfig::new(4.0, 20.0, 0.0).with_output_limit(5.0);
const IDS: MecanumWheels<u8> =
    MecanumWheels { front_left: 2, front_right: 1, rear_left: 3, rear_right: 4 };
const ON_THE_RIGHT: MecanumWheels<bool> =
    MecanumWheels { front_left: false, front_right: true, rear_left: false, rear_right: true };

type Robot<'a> = Runner<Nb<Controller<'a>>, &'a Simulation, Bus>;

/// The front wheels on the first bus, the rear wheels on the line that is given.
struct Car<'a> {
    world: &'a Simulation,
    robots: [Robot<'a>; 2],
    wheels: MecanumWheels<(Line, Handle<M3508>)>,
    mecanum: Mecanum,
}

impl<'a> Car<'a> {
    fn new(world: &'a Simulation, rear: Line) -> Self {
        let front = Line::Can1;
        let lines = MecanumWheels {
            front_left: front,
            front_right: front,
            rear_left: rear,
            rear_right: rear,
        };
        let motors = IDS
            .zip(lines)
            .map(|(id, line)| world.attach(MotorConfig::m3508(id).with_line(line)).unwrap());
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
        let mut buses = [Bus::new(), Bus::new()];
        let wheels = IDS.zip(lines).zip(ON_THE_RIGHT).map(|((id, line), on_the_right)| {
            let config = Config::<M3508>::new(id).speed_loop(SPEED);
            let config = if on_the_right { config.reversed() } else { config };
            (line, buses[usize::from(line == Line::Can2)].attach(config).unwrap())
        });
        let [first, second] = buses;
        let robots = [(Line::Can1, first), (Line::Can2, second)]
            .map(|(line, bus)| Runner::new(Nb(world.controller_on(line)), world.clock(), bus));
        Self { world, robots, wheels, mecanum: Mecanum::new(WHEEL_RADIUS_M, FRONT_LEFT_M).unwrap() }
    }

    fn robot(&mut self, line: Line) -> &mut Robot<'a> {
        &mut self.robots[usize::from(line == Line::Can2)]
    }

    fn drive(&mut self, twist: Twist<Body>, millis: u64) -> (Pose2<World>, Twist<Body>) {
        for _ in 0..10 * millis {
            self.world.advance(Duration::from_micros(100));
            let targets = self.mecanum.inverse(twist);
            for ((line, handle), target) in self.wheels.zip(targets).into_array() {
                let _disarmed = self.robot(line).device_mut().set_velocity(handle, target);
            }
            for robot in &mut self.robots {
                robot.poll(16);
                if let Some(tick) = robot.due() {
                    let _missing = robot.is_armed() || robot.arm(tick).is_ok();
                    robot.tick(tick);
                }
            }
        }
        self.world.chassis().unwrap()
    }

    fn speeds(&mut self) -> MecanumWheels<AngularVelocity> {
        self.wheels.map(|(line, handle)| self.robot(line).device().state(handle).unwrap().velocity)
    }
}

fn close(measured: f32, wanted: f32, tolerance: f32) -> bool {
    (measured - wanted).abs() <= tolerance
}

#[test]
fn the_body_goes_where_the_wheels_are_told_in_every_direction() {
    let directions = [
        Twist::new(1.0, 0.0, 0.0),
        Twist::new(-1.0, 0.0, 0.0),
        Twist::new(0.0, 1.0, 0.0),
        Twist::new(0.0, -1.0, 0.0),
        Twist::new(0.0, 0.0, 2.0),
        Twist::new(0.0, 0.0, -2.0),
        Twist::new(0.6, -0.4, 1.0),
    ];
    for wanted in directions {
        let world = Simulation::new(3);
        let mut car = Car::new(&world, Line::Can1);
        let state = car.drive(wanted, 1_000);
        let twist = state.1;
        assert!(close(twist.vx_m_s, wanted.vx_m_s, 0.02), "{wanted:?}: {state:?}");
        assert!(close(twist.vy_m_s, wanted.vy_m_s, 0.02), "{wanted:?}: {state:?}");
        assert!(close(twist.wz_rad_s, wanted.wz_rad_s, 0.04), "{wanted:?}: {state:?}");
        let wheels = car.mecanum.inverse(wanted);
        let largest =
            wheels.into_array().into_iter().fold(0.0_f32, |m, w| m.max(w.as_rad_per_s().abs()));
        for (target, measured) in wheels.zip(car.speeds()).into_array() {
            let error = (measured - target).abs().as_rad_per_s();
            assert!(error < 0.02 * largest, "{wanted:?}: {measured:?} and not {target:?}");
        }
    }
}

#[test]
fn wheels_on_two_buses_carry_one_chassis() {
    let world = Simulation::new(4);
    let mut car = Car::new(&world, Line::Can2);
    let state = car.drive(Twist::new(0.5, 0.5, 0.0), 1_000);
    assert!(close(state.1.vx_m_s, 0.5, 0.02) && close(state.1.vy_m_s, 0.5, 0.02), "{state:?}");
    for line in [Line::Can1, Line::Can2] {
        assert!((world.traffic(line).load() - 0.34).abs() < 0.05); // three frames a millisecond each
    }
}

#[test]
fn after_a_second_forward_the_body_is_where_its_speed_says() {
    let world = Simulation::new(5);
    let mut car = Car::new(&world, Line::Can1);
    let (start, _) = car.drive(Twist::new(1.0, 0.0, 0.0), 500);
    let (end, _) = car.drive(Twist::new(1.0, 0.0, 0.0), 1_000);
    assert!((end.x_m - start.x_m - 1.0).abs() < 0.02, "{start:?} {end:?}");
    assert!(end.y_m.abs() < 0.01 && end.angle.as_radians().abs() < 0.01, "{end:?}");
    let stopped = car.drive(Twist::ZERO, 1_000);
    assert!(stopped.1.vx_m_s.abs() < 0.01, "{stopped:?}");
}
