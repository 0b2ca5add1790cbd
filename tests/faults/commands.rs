//! F34 to F43: what is asked for.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{Rig, SPEED, armed, at_ms, at_once, feedback, rpm, step, ticks_since, words};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Current, Gm6020Voltage, M2006, M3508, Model};
use drivetrain::encoder::{GearRatio, Position};
use drivetrain::motor::{ArmError, TargetError};
use drivetrain::runner::EmergencyStop;
use drivetrain::sim::{Fault, Line, Simulation};
use drivetrain::time::Tick;
use drivetrain::units::{Angle, Current, Voltage};

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f34_a_setpoint_that_is_not_finite_gives_zero_at_once_and_is_counted,
    f35_gains_and_limits_that_make_no_sense_are_named,
    f36_conversions_saturate_symmetrically_and_monotonically,
    f37_each_model_has_its_own_scale,
    f38_a_gear_of_zero_and_a_torque_constant_that_makes_no_sense_are_refused,
    f39_wind_up_is_bounded_and_unwinds_at_once,
    f40_a_change_of_target_kind_under_load_does_not_jump,
    f41_a_refused_command_says_why_and_is_not_kept,
    f43_an_emergency_stop_is_zero_at_the_next_pack_until_cleared_and_armed,
    f64_a_gimbal_whose_yaw_is_lost_is_not_followed,
];

const BAD: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

#[cfg_attr(test, test)]
fn f34_a_setpoint_that_is_not_finite_gives_zero_at_once_and_is_counted() {
    let loops = (PidConfig::new(3.0, 0.0, 0.0), SPEED);
    let (mut bus, [wheel]) = armed([Config::new(1).position_loop(loops.0, loops.1)]);
    bus.zero(wheel).unwrap();
    let (mut refused, mut ms) = (0, 1);
    for bad in BAD {
        type Set = fn(&mut Bus, drivetrain::dji::Handle<M3508>, f32) -> Result<(), TargetError>;
        let kinds: [Set; 4] = [
            |bus, wheel, value| bus.set_current(wheel, Current::from_amperes(value)),
            |bus, wheel, value| bus.set_velocity(wheel, rpm(value)),
            |bus, wheel, value| bus.set_angle(wheel, Angle::from_radians(value)),
            |bus, wheel, value| {
                bus.set_position(wheel, Position::new(1, Angle::from_radians(value)))
            },
        ];
        for set in kinds {
            ms += 2;
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            set(&mut bus, wheel, 1.0).unwrap();
            assert_ne!(step(&mut bus, ms).unwrap()[0], 0);
            assert_eq!(set(&mut bus, wheel, bad), Err(TargetError::NotFinite));
            assert_eq!(step(&mut bus, ms + 1).unwrap()[0], 0, "at once");
            refused += 1;
        }
    }
    assert_eq!(bus.state(wheel).unwrap().refused_targets, refused);
    bus.set_velocity(wheel, rpm(10.0)).unwrap();
    assert!(step(&mut bus, ms + 2).unwrap()[0] > 0, "works on");
    safe_after(1);
    saw(format!("{refused} refused, zero at once, works on"));
}

#[cfg_attr(test, test)]
fn f35_gains_and_limits_that_make_no_sense_are_named() {
    let mut bus = Bus::new();
    let mut refused = |config: Config<M3508>| bus.attach(config).unwrap_err().to_string();
    for bad in [f32::NAN, f32::INFINITY, -1.0] {
        let wheel = Config::<M3508>::new(1);
        for (speed, name) in [
            (PidConfig::new(bad, 0.0, 0.0), "kp"),
            (PidConfig::new(0.0, bad, 0.0), "ki"),
            (PidConfig::new(0.0, 0.0, bad), "kd"),
        ] {
            assert_eq!(refused(wheel.speed_loop(speed)), format!("M3508 #1: {name} is not usable"));
            let position = wheel.position_loop(speed, SPEED);
            assert_eq!(refused(position), format!("M3508 #1: {name} is not usable"));
        }
        let limit = refused(wheel.with_current_limit(Current::from_amperes(bad)));
        assert_eq!(limit, "M3508 #1: command limit is not usable");
    }
    let reversed = PidConfig::new(1.0, 0.0, 0.0).with_output_range(1.0, -1.0);
    assert!(refused(Config::new(1).speed_loop(reversed)).contains("is not usable"));
    // The same in a `const`, where `panic!` with the message makes it a compile error.
    const REFUSED: bool = Bus::new()
        .attach(Config::<M3508>::new(1).speed_loop(PidConfig::new(-1.0, 0.0, 0.0)))
        .is_err();
    const { assert!(REFUSED) };
    saw(refused(Config::new(1).speed_loop(reversed)));
}

#[cfg_attr(test, test)]
fn f36_conversions_saturate_symmetrically_and_monotonically() {
    for reversed in [false, true] {
        let config = if reversed { Config::new(1).reversed() } else { Config::new(1) };
        let (mut bus, [wheel]) = armed([config]);
        let mut ms = 1;
        let mut raw = |amperes: f32| {
            ms += 1;
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            bus.set_current(wheel, Current::from_amperes(amperes)).unwrap();
            step(&mut bus, ms).map_or(0, |words| words[0])
        };
        let sign = if reversed { -1 } else { 1 };
        let rising = [
            0.0,
            f32::MIN_POSITIVE / 2.0,
            1e-3,
            0.1,
            1.0,
            19.99,
            20.0,
            20.01,
            50.0,
            1e30,
            f32::MAX,
        ];
        let mut last = 0;
        for amperes in rising {
            let value = sign * raw(amperes);
            assert_eq!(sign * raw(-amperes), -value, "{amperes}");
            assert!(value >= last && value <= 16_384, "{amperes}: {value}");
            last = value;
        }
        assert_eq!((last, raw(-0.0)), (16_384, 0));
        for (ms, word, limited) in [(40, i16::MIN, -16_384), (42, i16::MAX, 16_384), (44, -1, -1)] {
            _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(ms));
            step(&mut bus, ms - 1);
            bus.set_raw(wheel, word).unwrap();
            assert_eq!(step(&mut bus, ms).unwrap()[0], sign * limited);
        }
    }
    saw("3.4e38 A is 16384 and -3.4e38 A is -16384; -32768 is -16384");
}

/// That the wrong unit does not compile is shown by the `compile_fail` examples of `Model` and `branded`.
#[cfg_attr(test, test)]
fn f37_each_model_has_its_own_scale() {
    fn raw_of<M: Model<Command = Current>>(base: u16) -> i16 {
        let mut bus = Bus::new();
        let motor = bus.attach(at_once::<M>(1)).unwrap();
        _ = bus.ingest(&feedback(base + 1, 0, 0), at_ms(1));
        bus.arm(at_ms(1)).unwrap();
        bus.set_current(motor, Current::from_amperes(1.0)).unwrap();
        bus.update(Tick::new(at_ms(2), 0.001));
        words(&bus.next_frame().unwrap())[0]
    }
    let raw = [raw_of::<M2006>(0x200), raw_of::<M3508>(0x200), raw_of::<Gm6020Current>(0x204)];
    assert_eq!(raw, [1_000, 819, 5_461]);
    saw(format!("1 A is {raw:?} on M2006, M3508, GM6020"));
}

#[cfg_attr(test, test)]
fn f38_a_gear_of_zero_and_a_torque_constant_that_makes_no_sense_are_refused() {
    for (rotor, output) in [(0, 1), (1, 0), (0, 0)] {
        assert!(GearRatio::new(rotor, output).is_err(), "{rotor}:{output}");
    }
    let mut bus = Bus::new();
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let wheel = Config::<M3508>::new(1).with_torque_constant(bad);
        let error = bus.attach(wheel).unwrap_err().to_string();
        assert_eq!(error, "M3508 #1: torque constant is not usable");
        let yaw = Config::<Gm6020Voltage>::new(1).with_nominal_voltage(Voltage::from_volts(bad));
        let error = bus.attach(yaw).unwrap_err().to_string();
        assert_eq!(error, "GM6020 (voltage) #1: nominal voltage is not usable");
    }
    saw("gears with a 0, constants of 0, -1, NaN, infinity: refused by name");
}

#[cfg_attr(test, test)]
fn f39_wind_up_is_bounded_and_unwinds_at_once() {
    let greedy = PidConfig::new(1.0, 1e6, 0.0);
    let (mut bus, [wheel]) = armed([Config::new(1).speed_loop(greedy)]);
    let run = |bus: &mut Bus, ms, target, rotor_rpm| {
        _ = bus.ingest(&feedback(0x201, 0, rotor_rpm), at_ms(ms));
        bus.set_velocity(wheel, rpm(target)).unwrap();
        step(bus, ms).unwrap()[0]
    };
    for ms in 2..20_000 {
        let raw = run(&mut bus, ms, f32::MAX, 0); // the shaft is blocked
        assert!((0..=16_384).contains(&raw));
    }
    assert_eq!(run(&mut bus, 20_000, 400.0, 0), 16_384);
    let unwound = (20_001..20_010).any(|ms| run(&mut bus, ms, -400.0, 0) < 0);
    assert!(unwound, "nothing to unwind");
    saw("at the limit for 20 s with ki 1e6, turns around within 10 ticks");
}

#[cfg_attr(test, test)]
fn f40_a_change_of_target_kind_under_load_does_not_jump() {
    let loops = (PidConfig::new(8.0, 0.0, 0.0), PidConfig::new(0.6, 6.0, 0.0));
    let world = Simulation::new(5);
    let mut rig = Rig::with(&world, Line::Can1, 1, |config| config.position_loop(loops.0, loops.1));
    let wheel = rig.wheels[0];
    world.set_load_nm(rig.keys[0], -1.0);
    let mut going = rpm(0.0);
    let mut ahead = Position::ZERO;
    rig.run(900, |bus, ms| {
        if let Some(state) = bus.state(wheel).filter(|_| ms <= 300) {
            going = state.velocity;
        }
        _ = match ms {
            0..=300 => bus.set_current(wheel, Current::from_amperes(6.0)),
            301..=600 => bus.set_velocity(wheel, going),
            _ => {
                if let (601, Some(state)) = (ms, bus.state(wheel)) {
                    // Where a position loop with kp 8 asks for just this speed.
                    let lead = Angle::from_radians(going.as_rad_per_s() / 8.0);
                    ahead = state.position + lead;
                }
                bus.set_position(wheel, ahead)
            }
        };
    });
    for change in [300, 600] {
        let words = rig.words(0, change - 2, change + 5);
        let jump = words.windows(2).map(|pair| (pair[1] - pair[0]).abs()).max().unwrap();
        assert!(jump < 700, "at {change} ms by {jump} of 16384: {words:?}");
        saw(format!("{jump} of 16384 at {change} ms"));
    }
}

#[cfg_attr(test, test)]
fn f41_a_refused_command_says_why_and_is_not_kept() {
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    assert_eq!(bus.set_raw(wheel, 900), Err(TargetError::Disarmed));
    assert_eq!(bus.set_velocity(wheel, rpm(1.0)), Err(TargetError::NoLoop));
    _ = bus.ingest(&feedback(0x201, 0, 0), at_ms(1));
    bus.arm(at_ms(1)).unwrap();
    assert_eq!(step(&mut bus, 2), Some([0; 4]), "not kept while disarmed");
    assert_eq!(bus.set_velocity(wheel, rpm(1.0)), Err(TargetError::NoLoop));

    let world = Simulation::new(2);
    let mut rig = Rig::new(&world, Line::Can1, 1);
    world.fault(Fault::Silent(rig.keys[0]), at_ms(100)..at_ms(400)).unwrap();
    let wheel = rig.wheels[0];
    let mut errors = Vec::new();
    rig.run(600, |bus, _| errors.extend(bus.set_velocity(wheel, rpm(100.0)).err()));
    errors.dedup();
    let expected = [TargetError::Disarmed, TargetError::NoFeedback, TargetError::Relaxed];
    assert_eq!(errors, expected);
    let tick = Tick::new(world.now(), 0.001);
    rig.runner.arm(tick).unwrap();
    rig.run(50, |_, _| {});
    assert!(rig.words(0, 112, 650).iter().all(|word| *word == 0), "not kept while offline");
    saw(format!("{errors:?}; none kept"));
}

#[cfg_attr(test, test)]
fn f43_an_emergency_stop_is_zero_at_the_next_pack_until_cleared_and_armed() {
    // In the middle of a tick: between update and sending.
    let (mut bus, [wheel]) = armed([Config::new(1)]);
    bus.set_raw(wheel, 700).unwrap();
    bus.update(Tick::new(at_ms(2), 0.001));
    bus.emergency_stop();
    assert_eq!(words(&bus.next_frame().unwrap()), [0; 4]);
    assert_eq!(bus.arm(at_ms(2)), Err(ArmError::Stopped));

    // From an interrupt.
    static STOP: EmergencyStop = EmergencyStop::new();
    let world = Simulation::new(2);
    let mut rig = Rig::new(&world, Line::Can1, 2);
    rig.runner = rig.runner.with_emergency_stop(&STOP);
    rig.drive(300);
    std::thread::spawn(|| STOP.set()).join().unwrap();
    rig.drive(200);
    // What the tick before handed over may still be on its way.
    assert!(rig.first_zero(0, 300) < at_ms(302));
    assert!(rig.words(0, 302, 500).iter().all(|word| *word == 0));
    let tick = Tick::new(world.now(), 0.001);
    assert_eq!(rig.runner.arm(tick), Err(ArmError::Stopped));
    rig.runner.clear_emergency_stop();
    rig.drive(20);
    let tick = Tick::new(world.now(), 0.001);
    assert_eq!(rig.runner.arm(tick), Err(ArmError::NotReleased), "20 ms after the stop");
    rig.drive(100);
    assert!(rig.words(0, 502, 620).iter().all(|word| *word == 0), "not before it is armed");
    rig.runner.arm(Tick::new(world.now(), 0.001)).unwrap();
    rig.drive(20);
    assert!(rig.words(0, 630, 640).iter().all(|word| *word != 0));
    safe_after(ticks_since(300, rig.first_zero(0, 300)));
    saw("zero until cleared, and armed 100 ms after that");
}

#[cfg_attr(test, test)]
fn f64_a_gimbal_whose_yaw_is_lost_is_not_followed() {
    use drivetrain::chassis::{ChassisMode, ModeConfig, Modes};
    use drivetrain::geometry::Twist;
    let follow = PidConfig::new(5.0, 0.0, 0.0);
    let config = ModeConfig::new(follow).with_gimbal_timeout(0.1).with_transition(0.0);
    for (config, acting) in [
        (config, ChassisMode::Independent),
        (config.with_relax_without_gimbal(), ChassisMode::Relax),
    ] {
        let mut modes = Modes::new(config).unwrap();
        modes.set_mode(ChassisMode::FollowGimbal);
        let mut edges = Vec::new();
        let mut step = |yaw: Option<f32>| {
            let yaw = yaw.map(Angle::from_radians);
            let body = modes.update(Twist::new(1.0, 0.0, 0.0), yaw, 0.001);
            edges.extend(modes.take_edge());
            (modes.acting(), body)
        };
        assert_eq!(step(None).0, acting, "without any yaw");
        assert_eq!(step(Some(0.2)).0, ChassisMode::FollowGimbal);
        for ms in 1..1_000 {
            let (mode, body) = step((ms % 2 == 0).then_some(f32::NAN));
            match ms {
                0..100 => assert_eq!(mode, ChassisMode::FollowGimbal, "{ms}"),
                102.. => {
                    assert_eq!(mode, acting, "{ms}");
                    assert!(body.is_none_or(
                        |body| (body.vx_m_s - 1.0).abs() < 1e-6 && body.wz_rad_s.abs() < 1e-6
                    ));
                }
                _ => {}
            }
        }
        assert_eq!(step(Some(0.2)).0, ChassisMode::FollowGimbal);
        let (lost, back) = (acting, ChassisMode::FollowGimbal);
        assert_eq!(edges, [lost, back, lost, back], "each once");
        saw(format!("{acting:?}, edges {edges:?}"));
    }
}
