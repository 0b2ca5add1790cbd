use crate::robot::Wish;
use crate::robot::tests::{WISH, motors, robot, run};
use drivetrain::frame::CanFrame;
use drivetrain::geometry::Twist;
use drivetrain::motor::{ArmError, Condition};
use drivetrain::runner::{BusCondition, EmergencyStop};
use drivetrain::sim::{Fault, Line, Simulation};
use drivetrain::time::{Duration, Instant};

const OFF: Wish = Wish { is_on: Some(false), ..WISH };

const fn ms(ms: u64) -> Instant {
    Instant::from_micros(1_000 * ms)
}

#[test]
fn without_the_plug_of_the_wheels_the_base_rests_until_the_switch_turns_on_again() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let world = Simulation::new(1);
    let (wheels, turret) = motors(&world);
    world.fault(Fault::Unplugged(Line::Can1), ms(1_000)..ms(1_400)).unwrap();
    let mut robot = robot(&world, &STOP);
    run(&world, &mut robot, 100, OFF);
    run(&world, &mut robot, 1_200, WISH);
    assert!(!robot.lower.is_armed() && robot.lower.has(BusCondition::Silent));
    assert!(robot.upper.is_armed()); // the gimbal holds its angle

    run(&world, &mut robot, 700, WISH); // the plug is back, and the switch is still on
    assert_eq!(wheels.map(|wheel| world.motor(wheel).unwrap().command), [0; 3]);
    let degrees = world.motor(turret[0]).unwrap().position.angle().as_degrees();
    assert!((degrees - 90.0).abs() < 1.0, "{degrees}");

    run(&world, &mut robot, 200, OFF);
    run(&world, &mut robot, 1_500, WISH);
    let speed = world.chassis().unwrap().1.vx_m_s;
    assert!((speed - 0.5).abs() < 0.03, "{speed} m/s");
}

#[test]
fn a_silent_wheel_is_late_after_10_ms_and_lost_after_100() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let world = Simulation::new(1);
    let (wheels, _) = motors(&world);
    world.fault(Fault::Silent(wheels[2]), ms(1_000)..).unwrap();
    let mut robot = robot(&world, &STOP);
    run(&world, &mut robot, 100, OFF);
    run(&world, &mut robot, 1_900, WISH);
    let edges = core::iter::from_fn(|| robot.lower.device_mut().next_edge());
    let edges = edges.filter(|edge| edge.began && edge.at > ms(100));
    let edges: Vec<_> =
        edges.map(|edge| (edge.condition, edge.at.since(ms(1_000)).as_micros() / 1_000)).collect();
    assert_eq!(edges[..2], [(Condition::Late, 10), (Condition::Offline, 100)]);
    let speed = world.chassis().unwrap().1.linear().norm();
    assert!(speed < 0.02, "{speed} m/s"); // the rear wheel does not turn in this motion: the front wheels brake
}

/// Loses a wheel at 0.5 m/s. Returns from then on: the time in s until 0.01 m/s, the way in m forward and to the left, the turn in
/// degrees.
fn stop_without(wheel: usize, wish_when_lost: Wish) -> [f32; 4] {
    static STOP: EmergencyStop = EmergencyStop::new();
    let world = Simulation::new(1);
    let (wheels, _) = motors(&world);
    world.fault(Fault::Silent(wheels[wheel]), ms(1_000)..).unwrap();
    let mut robot = robot(&world, &STOP);
    run(&world, &mut robot, 100, OFF);
    run(&world, &mut robot, 900, WISH);
    let (start, _) = world.chassis().unwrap();
    run(&world, &mut robot, 101, WISH);
    assert!(!robot.lower.is_armed() && robot.upper.is_armed());
    let mut moved_s = 0.0;
    for ms in 102..=4_000_u16 {
        run(&world, &mut robot, 1, wish_when_lost);
        if world.chassis().unwrap().1.linear().norm() > 0.01 {
            moved_s = f32::from(ms) / 1_000.0;
        }
    }
    let (end, _) = world.chassis().unwrap();
    let turn = (end.angle - start.angle).as_degrees();
    [moved_s, end.x_m - start.x_m, end.y_m - start.y_m, turn]
}

#[test]
fn without_a_front_wheel_the_robot_turns_if_the_others_brake_and_rolls_on_if_all_are_disarmed() {
    let is_near = |stop: [f32; 4], expected: [f32; 4]| {
        let far = [0, 1, 2, 3].map(|i| (stop[i] - expected[i]).abs());
        assert!(far[0] < 0.1 && far[1] < 0.01 && far[2] < 0.01 && far[3] < 1.0, "{stop:?}");
    };
    is_near(stop_without(2, WISH), [0.4, 0.12, 0.0, 0.0]); // rear
    is_near(stop_without(0, WISH), [2.9, 0.33, -0.34, -55.0]); // front left
    is_near(stop_without(1, WISH), [2.9, 0.33, 0.34, 55.0]); // front right
    is_near(stop_without(0, OFF), [3.0, 0.79, 0.02, 2.0]);
}

#[test]
fn while_a_second_program_commands_the_turret_the_switch_arms_neither_bus() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let world = Simulation::new(1);
    motors(&world);
    let mut robot = robot(&world, &STOP);
    run(&world, &mut robot, 100, OFF);
    let two_amperes = CanFrame::standard(0x200, [0x06, 0x66, 0, 0, 0, 0, 0, 0]).unwrap();
    world.inject(Line::Can2, two_amperes).unwrap();
    run(&world, &mut robot, 5, OFF);
    world.advance(Duration::from_millis(1));
    let rest = Wish { twist: Twist::ZERO, ..WISH };
    let refusal = robot.step(&rest, |_, _| {});
    assert!(matches!(refusal, Some(ArmError::SecondMaster(_))), "{refusal:?}");
    assert!(!robot.lower.is_armed()); // both buses, or none
}
