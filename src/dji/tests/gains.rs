use super::*;
use crate::encoder::GearRatio;
use crate::error::ConfigError;

const fn p(kp: f32) -> PidConfig {
    PidConfig::new(kp, 0.0, 0.0)
}

/// The loops of `attach`, and those that are exchanged later: both with the same rule.
fn assert_steepest<M: Model>(config: Config<M>, steepest: f32) {
    let mut bus: Bus = Bus::new();
    let error = bus.attach(config.speed_loop(p(1.001 * steepest))).unwrap_err();
    let AttachError::Gain { parameter, value, highest, .. } = error else { panic!("{error}") };
    assert_eq!(parameter, "kp of the speed loop");
    let (down, up) =
        (f64::from(steepest) - f64::from(highest), f64::from(value) - f64::from(1.001 * steepest));
    assert!((0.0..1.0).contains(&down) && (0.0..1.0).contains(&up), "{error:?}");
    let motor = bus.attach(config.speed_loop(p(0.999 * steepest))).unwrap();
    let refused = Err(ConfigError::Range {
        parameter,
        value: value as f32,
        least: 0.0,
        most: highest as f32,
    });
    assert_eq!(bus.set_speed_loop(motor, p(1.001 * steepest)), refused);
    assert_eq!(bus.set_speed_loop(motor, p(0.999 * steepest)), Ok(()));
}

#[test]
fn a_gain_with_which_one_rpm_of_the_rotor_asks_for_the_whole_range_is_refused() {
    // Full scale over one rpm at the output shaft: 20 A * 60 / (2 pi) * 3591 / 187.
    assert_steepest(Config::<M3508>::new(1), 3_667.54);
    assert_steepest(Config::<M3508>::new(1).reversed(), 3_667.54);
    assert_steepest(Config::<M3508>::new(1).with_gear(GearRatio::DIRECT), 190.986);
    assert_steepest(Config::<M2006>::new(1), 3_437.75);
    assert_steepest(Config::<Gm6020Voltage>::new(1), 229.183);
    assert_steepest(Config::<Gm6020Current>::new(1), 28.647_9);
    // The range is that of the model: a low limit for a first try makes no gain a bad one.
    let gentle = Config::<M3508>::new(1).with_current_limit(Current::from_amperes(0.1));
    assert_steepest(gentle, 3_667.54);
}

#[test]
fn a_gain_with_which_one_count_of_the_encoder_asks_for_the_no_load_speed_is_refused() {
    // 9256 and 320 rpm over 60 s, times 8192 counts.
    let with = |kp| Config::<M3508>::new(1).position_loop(p(kp), SPEED);
    let mut bus: Bus = Bus::new();
    let error = bus.attach(with(1.265e6)).unwrap_err();
    let AttachError::Gain { parameter, value, highest, .. } = error else { panic!("{error}") };
    assert_eq!((parameter, value), ("kp of the position loop", 1_265_000));
    let arm = bus.attach(with(1.263e6)).unwrap();
    let refused = Err(ConfigError::Range {
        parameter,
        value: value as f32,
        least: 0.0,
        most: highest as f32,
    });
    assert_eq!(bus.set_position_loop(arm, p(1.265e6)), refused);
    assert_eq!(bus.set_position_loop(arm, p(1.263e6)), Ok(()));
    let yaw = |kp| Config::<Gm6020Voltage>::new(5).position_loop(p(kp), SPEED);
    assert!(bus.attach(yaw(43_700.0)).is_err());
    let steepest = bus.attach(yaw(320.0 / 60.0 * 8_192.0)).unwrap();
    bus.detach(steepest);
    assert!(bus.attach(yaw(43_680.0)).is_ok());
}

#[test]
fn gains_that_are_no_numbers_keep_their_name() {
    let mut bus: Bus = Bus::new();
    let wheel = Config::<M3508>::new(1);
    for kp in [f32::INFINITY, f32::NAN, -1.0] {
        let error = bus.attach(wheel.speed_loop(p(kp))).unwrap_err();
        assert_eq!(error.to_string(), "M3508 #1: kp is not usable");
    }
    let motor = bus.attach(wheel.speed_loop(SPEED)).unwrap();
    assert_eq!(bus.set_speed_loop(motor, p(f32::INFINITY)), Err(ConfigError::Negative("kp")));
}

/// In a `const` the same refusal is one of the compiler. A gain in words per rpm, taken as A per rad/s, is possible.
#[test]
fn the_check_runs_in_the_compiler_and_takes_what_physics_takes() {
    const fn takes(kp: f32) -> bool {
        let mut bus = Bus::new();
        bus.attach(Config::<M3508>::new(1).speed_loop(p(kp))).is_ok()
    }
    const TAKEN: [bool; 3] = [takes(10.0), takes(3_600.0), takes(4_000.0)];
    assert_eq!(TAKEN, [true, true, false]);
}

/// A loop in raw units needs no type of its own: the same loop in A per rad/s sends the same words.
#[test]
#[expect(clippy::cast_possible_truncation, reason = "at most 2000 rpm")]
fn a_speed_loop_in_words_per_rpm_and_its_conversion_send_the_same_words() {
    use crate::dji::WordGains;
    let (kp, ki) = (8.0_f64, 5.0);
    let wheel = Config::<M3508>::new(1).with_opening(Duration::ZERO);
    let gains = WordGains::per_rotor_rpm(8.0, 5.0, 0.0).speed_loop(&wheel);
    let mut bus: Bus = Bus::new();
    let motor = bus.attach(wheel.speed_loop(gains)).unwrap();
    let (target_rpm, mut sum, mut before, mut worst) = (100.0_f64, 0.0, None, 0.0_f64);
    for ms in 1..=2_000 {
        let now = Instant::from_micros(1_000 * ms);
        // A rotor that comes up to speed and swings around it.
        let rpm = (1_920.0 * (1.0 - (-(ms as f64) / 300.0).exp()) + 40.0 * (ms as f64 / 9.0).sin())
            as i16;
        let [high, low] = rpm.to_be_bytes();
        let frame = CanFrame::standard(0x201, [0, 0, high, low, 0, 0, 30, 0]).unwrap();
        _ = bus.ingest(&frame, now);
        if ms == 1 {
            bus.arm(now).unwrap();
        }
        bus.set_velocity(motor, AngularVelocity::from_rpm(100.0)).unwrap();
        bus.update(Tick::new(now, 0.001));
        let word =
            bus.next_frame().map(|frame| i16::from_be_bytes([frame.bytes()[0], frame.bytes()[1]]));
        let error = target_rpm * 3591.0 / 187.0 - f64::from(rpm);
        // By the trapezoid, as the controller of this crate, whose first step has no interval yet.
        sum += 0.001 * (error + before.unwrap_or(-error)) / 2.0;
        before = Some(error);
        let raw = (kp * error + ki * sum).round();
        worst = worst.max((f64::from(word.unwrap()) - raw).abs());
    }
    assert!(worst <= 1.0, "{worst} words");
}

#[test]
fn a_position_loop_refuses_the_options_of_a_setpoint() {
    for option in [
        p(10.0).with_tracking(30.0),
        p(10.0).with_period(360.0),
        p(10.0).with_derivative_on_error(),
        p(10.0).with_feed_forward(1.0, 0.0),
    ] {
        let mut bus: Bus = Bus::new();
        let refused = bus.attach(Config::<M3508>::new(1).position_loop(option, p(1.0)));
        let parameter = "option of the setpoint";
        let motor = crate::motor::MotorName::new("M3508", 1);
        assert_eq!(refused.unwrap_err(), AttachError::Parameter { motor, parameter });
        let config = Config::<M3508>::new(1).position_loop(p(10.0), option);
        let motor = bus.attach(config).unwrap();
        let refused = Err(ConfigError::Unusable(parameter));
        assert_eq!(bus.set_position_loop(motor, option), refused);
        assert_eq!(bus.set_speed_loop(motor, option), Ok(()));
    }
}
