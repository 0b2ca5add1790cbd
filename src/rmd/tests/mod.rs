//! Facts of the models and the codec of commands and answers. The bytes are the examples of the manual V4.2, unless said otherwise.

use super::*;

#[test]
fn the_models_of_the_table_are_valid() {
    for model in Model::ALL {
        let again = Model::new(model.name(), model.torque_constant(), model.max_current_a());
        assert_eq!(again, Ok(*model));
    }
}

#[test]
fn commands_are_those_of_the_manual() {
    for (command, data) in [
        (Command::Off, [0x80, 0, 0, 0, 0, 0, 0, 0]),
        (Command::Stop, [0x81, 0, 0, 0, 0, 0, 0, 0]),
        (Command::ReleaseBrake, [0x77, 0, 0, 0, 0, 0, 0, 0]),
        (Command::LockBrake, [0x78, 0, 0, 0, 0, 0, 0, 0]),
        (Command::Reset, [0x76, 0, 0, 0, 0, 0, 0, 0]),
        (Command::Torque(100), [0xA1, 0, 0, 0, 0x64, 0, 0, 0]),
        (Command::Torque(-100), [0xA1, 0, 0, 0, 0x9C, 0xFF, 0, 0]),
        (Command::Velocity(10_000), [0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]),
        (Command::Velocity(-10_000), [0xA2, 0, 0, 0, 0xF0, 0xD8, 0xFF, 0xFF]),
        (Command::Position(36_000, 500), [0xA4, 0, 0xF4, 0x01, 0xA0, 0x8C, 0, 0]),
        (Command::Position(-36_000, 500), [0xA4, 0, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF]),
        (Command::ReadFeedback, [0x9C, 0, 0, 0, 0, 0, 0, 0]),
        (Command::ReadAngle, [0x92, 0, 0, 0, 0, 0, 0, 0]),
        (Command::ReadState, [0x9A, 0, 0, 0, 0, 0, 0, 0]),
        (Command::SetTimeout(0), [0xB3, 0, 0, 0, 0, 0, 0, 0]),
        (Command::SetTimeout(1_000), [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0]),
    ] {
        assert_eq!(command.encode(), data, "{command:?}");
    }
}

#[test]
fn answers_are_read_as_the_manual_says() {
    let forward = [0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0];
    let back = [0x32, 0x9C, 0xFF, 0x0C, 0xFE, 0xD3, 0xFF];
    for ([a, b, c, d, e, f, g], sign) in [(forward, 1), (back, -1)] {
        for code in [0x9C, 0xA1, 0xA2, 0xA4, 0xA8] {
            let feedback = Feedback::decode(&[code, a, b, c, d, e, f, g]).unwrap();
            let values = [feedback.current, feedback.velocity_dps, feedback.angle_deg];
            assert_eq!((feedback.temperature_c, values), (50, [100 * sign, 500 * sign, 45 * sign]));
            assert!((feedback.torque_nm(&Model::X8_120) - 2.4 * f32::from(sign)).abs() < 1e-5);
        }
        // The answer to a single-turn position has an encoder there.
        assert_eq!(Feedback::decode(&[0xA6, a, b, c, d, e, f, g]), None);
    }
    // `myactuator_rmd`, the opposite of its test.
    let back = [0x92, 0, 0, 0, 0x60, 0x73, 0xFF, 0xFF];
    assert_eq!(Feedback::decode_angle(&back), Some(-36_000));
    assert_eq!(Feedback::decode_angle(&[0x9A; 8]), None);
    assert_eq!(State::decode(&[0x9A, 0, 0, 0, 0, 0, 0, 0]), None, "a question");
    assert_eq!(State::decode(&[0x9B, 0x32, 0, 1, 0xE5, 1, 4, 0]), None);
    let unpowered = State::decode(&[0x9A, 20, 0, 0, 0, 0, 4, 0]).unwrap();
    assert_eq!((unpowered.supply_v, unpowered.errors), (0.0, 4));
    let cold = State::decode(&[0x9A, 0xF6, 0, 0, 0xE5, 1, 0, 0x30]).unwrap();
    assert_eq!((cold.temperature_c, cold.is_brake_open, cold.errors), (-10, false, 0x3000));
}

#[test]
fn bad_configurations_are_refused_with_the_limit() {
    use crate::motor::ImpedanceControl;
    use crate::time::Duration;
    use crate::units::AngularVelocity;
    use std::string::ToString;
    for constant in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = Model::new("mine", constant, 1.0).unwrap_err();
        assert_eq!(error.parameter(), "torque constant");
    }
    for current in [0.0, 0.009, -1.0, 328.0, f32::NAN, f32::INFINITY] {
        let error = Model::new("mine", 1.0, current).unwrap_err();
        assert_eq!(error.parameter(), "largest current in A");
    }
    let torque = |id, limit| {
        Motor::new(Model::X8_60, id, ImpedanceControl::new(limit).unwrap())
            .map_err(|error| error.to_string())
            .err()
    };
    assert_eq!(torque(0, 1.0), Some("id 0: 1 to 32 are allowed".into()));
    assert_eq!(torque(33, 1.0), Some("id 33: 1 to 32 are allowed".into()));
    assert_eq!(torque(32, 30.0), None);
    assert!(torque(1, 30.1).is_some_and(|text| text.starts_with("torque limit in Nm 30.1: ")));
    assert!(torque(1, 0.07).is_some(), "less than a count");
    for limit in [0.0, -1.0, 572.0, f32::NAN, f32::INFINITY] {
        let limit = AngularVelocity::from_rad_per_s(limit);
        assert!(Motor::new(Model::X8_60, 1, Mode::velocity(limit)).is_err(), "{limit:?}");
        assert!(Motor::new(Model::X8_60, 1, Mode::position_velocity(limit)).is_err());
    }
    let motor = Motor::new(Model::X8_60, 1, ImpedanceControl::new(1.0).unwrap()).unwrap();
    let error = motor.with_timeout(Duration::from_millis(9)).unwrap_err().to_string();
    assert_eq!(error, "time-out 9000: 10000 to 60000000 are allowed");
    assert!(motor.with_timeout(Duration::from_secs(60)).is_ok());
}
