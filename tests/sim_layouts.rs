//! Omni, differential and swerve robots on the simulated floor: kinematics and floor, derived apart, agree.

#![cfg(test)]
#![cfg(feature = "sim")]

use drivetrain::chassis::{Chassis, Differential, Kinematics, ModuleMotors, Omni, Swerve};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::geometry::{Body, Pose2, Twist, Vec2, World};
use drivetrain::motor::OneOf;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{ChassisConfig, Controller, Line, MotorConfig, MotorKey, Simulation, Wheel};
use drivetrain::time::{Duration, Tick};
use drivetrain::units::{Angle, AngularVelocity};

const RADIUS_M: f32 = 0.076;
const SPEED: PidConfig = PidConfig::new(4.0, 20.0, 0.0).with_output_limit(6.0);
const MOTIONS: [(f32, f32, f32); 5] =
    [(0.8, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, -2.0), (-0.5, 0.4, 1.0), (-0.8, 0.0, 0.0)];

type Robot<'w> = Runner<Nb<Controller<'w>>, &'w Simulation, Bus>;

fn m3508(world: &Simulation, id: u8) -> MotorKey {
    world.attach(MotorConfig::m3508(id)).unwrap()
}

fn robot<const N: usize>(world: &Simulation, ids: [u8; N]) -> (Robot<'_>, [Handle<M3508>; N]) {
    let mut bus = Bus::new();
    let handles = bus.attach_all(ids.map(|id| Config::new(id).speed_loop(SPEED))).unwrap();
    (Runner::new(Nb(world.controller()), world.clock(), bus), handles)
}

fn each_tick<'w>(
    world: &'w Simulation,
    robot: &mut Robot<'w>,
    mut work: impl FnMut(&mut Robot<'w>, Tick),
) {
    for _ in 0..10_000 {
        world.advance(Duration::from_micros(100));
        robot.poll(16);
        let Some(tick) = robot.due() else { continue };
        let _missing = robot.is_armed() || robot.arm(tick).is_ok();
        work(robot, tick);
        robot.tick(tick);
    }
}

/// Drives a motion for a second.
fn drive<K, const N: usize>(
    world: &Simulation,
    layout: K,
    wheels: impl Fn([Handle<M3508>; N]) -> K::Wheels<Handle<M3508>>,
    ids: [u8; N],
    motion: Twist<Body>,
) -> (Pose2<World>, Twist<Body>)
where
    K: Kinematics<Speed = AngularVelocity>,
{
    let (mut robot, handles) = robot(world, ids);
    let mut chassis = Chassis::new(layout);
    each_tick(world, &mut robot, |robot, tick| {
        chassis.set_body(motion);
        chassis.drive(robot.device_mut(), wheels(handles), tick);
    });
    world.chassis().unwrap()
}

fn assert_moves(state: (Pose2<World>, Twist<Body>), wanted: Twist<Body>) {
    let error = state.1 - wanted;
    assert!(error.linear().norm() < 0.03, "{wanted:?}: {state:?}");
    assert!(error.wz_rad_s.abs() < 0.06, "{wanted:?}: {state:?}");
}

#[test]
fn four_omni_wheels_on_the_corners_go_where_they_are_told() {
    for (vx, vy, wz) in MOTIONS {
        let world = Simulation::new(1);
        let degrees = [45.0_f32, -45.0, 135.0, -135.0];
        let floor = [0, 1, 2, 3].map(|index: u8| {
            let (sine, cosine) = degrees[usize::from(index)].to_radians().sin_cos();
            let direction = Angle::from_degrees(degrees[usize::from(index)] + 90.0);
            let place = Vec2::new(cosine, sine) * 0.25;
            Wheel::omni(m3508(&world, index + 1), RADIUS_M, place, direction)
        });
        world.attach_chassis(ChassisConfig::new(&floor)).unwrap();
        let wanted = Twist::new(vx, vy, wz);
        let layout = Omni::four(RADIUS_M, 0.25).unwrap();
        let state = drive(&world, layout, |wheels| wheels, [1, 2, 3, 4], wanted);
        assert_moves(state, wanted);
    }
}

#[test]
fn a_differential_drive_goes_where_it_is_told_but_not_sideways() {
    for (vx, vy, wz) in MOTIONS {
        let world = Simulation::new(2);
        let side = |id, y| Wheel::plain(m3508(&world, id), RADIUS_M, Vec2::new(0.0, y));
        let floor = [side(1, 0.18), side(2, -0.18)];
        world.attach_chassis(ChassisConfig::new(&floor)).unwrap();
        let layout = Differential::new(RADIUS_M, 0.18).unwrap();
        let wanted = Twist::new(vx, vy, wz);
        let state = drive(&world, layout, core::convert::identity, [1, 2], wanted);
        assert_moves(state, Twist::new(vx, 0.0, wz));
    }
}

const CORNERS: [Vec2; 4] =
    [Vec2::new(0.2, 0.2), Vec2::new(0.2, -0.2), Vec2::new(-0.2, 0.2), Vec2::new(-0.2, -0.2)];
/// What the encoders show when the modules point forward.
const ZERO: Angle = Angle::from_degrees(70.0);

type Motors = ModuleMotors<OneOf<Handle<M3508>, Handle<Gm6020Voltage>>>;

/// Four modules, drive on the first bus and steering on the second.
struct Modules<'w> {
    world: &'w Simulation,
    drives: (Robot<'w>, [Handle<M3508>; 4]),
    steerings: (Robot<'w>, [Handle<Gm6020Voltage>; 4]),
    chassis: Chassis<Swerve<4>>,
    relaxed: bool,
}

impl<'w> Modules<'w> {
    fn new(world: &'w Simulation) -> Self {
        let mut ids = 1..;
        let floor = CORNERS.map(|place| {
            let id = ids.next().unwrap();
            let motor = MotorConfig::gm6020_voltage(id).with_line(Line::Can2);
            let motor = world.attach(motor.with_load_inertia_kg_m2(0.004)).unwrap();
            Wheel::steered(m3508(world, id), RADIUS_M, place, motor, ZERO)
        });
        world.attach_chassis(ChassisConfig::new(&floor)).unwrap();
        let mut bus = Bus::new();
        let angle = PidConfig::new(40.0, 0.0, 0.0);
        let rate = PidConfig::new(2.5, 20.0, 0.0);
        let config = |id| Config::<Gm6020Voltage>::new(id).position_loop(angle, rate);
        let handles = bus.attach_all([1, 2, 3, 4].map(config)).unwrap();
        let runner = Runner::new(Nb(world.controller_on(Line::Can2)), world.clock(), bus);
        Self {
            world,
            drives: robot(world, [1, 2, 3, 4]),
            steerings: (runner, handles),
            chassis: Chassis::new(Swerve::new(RADIUS_M, CORNERS).unwrap()),
            relaxed: false,
        }
    }

    /// One second of a motion, or of the lock.
    fn run(&mut self, motion: Option<Twist<Body>>) -> (Pose2<World>, Twist<Body>) {
        let Self { world, drives, steerings, chassis, relaxed } = self;
        let (drives, wheels) = drives;
        let (runner, modules) = steerings;
        let mut modules = modules.iter();
        let motors = wheels.map(|wheel| {
            let steering = OneOf::Second(*modules.next().unwrap());
            Motors::new(OneOf::First(wheel), steering, ZERO)
        });
        each_tick(world, drives, |drives, tick| {
            runner.poll(16);
            let _due = runner.due();
            let _missing = runner.is_armed() || runner.arm(tick).is_ok();
            match motion {
                Some(motion) => chassis.set_body(motion),
                None => chassis.lock(),
            }
            chassis.drive(&mut (drives.device_mut(), runner.device_mut()), motors, tick);
            if *relaxed {
                wheels.iter().for_each(|wheel| drives.device_mut().relax(*wheel));
            }
            runner.tick(tick);
        });
        self.world.chassis().unwrap()
    }
}

#[test]
fn swerve_modules_go_where_they_are_told() {
    for (vx, vy, wz) in MOTIONS {
        let world = Simulation::new(3);
        let wanted = Twist::new(vx, vy, wz);
        assert_moves(Modules::new(&world).run(Some(wanted)), wanted);
    }
}

#[test]
fn without_current_locked_modules_hold_against_a_push_and_modules_in_line_roll_away() {
    let pushed = |motion: Option<Twist<Body>>| {
        let world = Simulation::new(4);
        let mut modules = Modules::new(&world);
        let _aligned = modules.run(motion);
        modules.relaxed = true;
        let before = modules.run(motion);
        world.push_chassis(0.4 * 20.0 * 9.81, 0.0, 0.0); // the floor holds 0.8 of the weight
        modules.run(motion).0.x_m - before.0.x_m
    };
    let (locked, in_line) = (pushed(None), pushed(Some(Twist::new(0.05, 0.0, 0.0))));
    assert!(locked.abs() < 0.01, "{locked} m");
    assert!(in_line > 1.0, "{in_line} m");
}
