//! Facts of the models and the codec of commands and answers.

use super::*;
use crate::error::ConfigError;

#[test]
fn the_models_of_the_table_are_valid() {
    for model in Model::ALL {
        let again = Model::new(
            model.name(),
            model.series(),
            model.gear(),
            model.torque_constant(),
            model.encoder_bits(),
        );
        assert_eq!(again, Ok(*model));
    }
}

/// The manual: 2048 counts are 16.5 A of an MF and 33 A of an MG.
#[test]
fn the_largest_current_is_that_of_the_manual() {
    for (series, amperes) in [(Series::Mf, 16.5), (Series::Mg, 33.0)] {
        assert!((series.amperes_per_count() * 2_048.0 - amperes).abs() < 1e-5);
    }
}

#[test]
fn a_current_beyond_the_range_is_its_end() {
    for (current, sent) in [(i16::MAX, 2_048), (2_049, 2_048), (-2_049, -2_048), (i16::MIN, -2_048)]
    {
        assert_eq!(Command::Torque(current).encode(), Command::Torque(sent).encode());
    }
}

/// Commands that are read back are no feedback, and feedback at another temperature than 0 °C is none of them.
#[test]
fn a_command_reads_like_a_command_and_feedback_does_not() {
    use super::codec::is_command;
    for command in [
        Command::Off,
        Command::Run,
        Command::Torque(-2_048),
        Command::Velocity(-123_456, 100),
        Command::Position(1_234_567, 99),
        Command::ReadFeedback,
        Command::ReadState,
        Command::ReadAngle,
        Command::ClearErrors,
    ] {
        let data = command.encode();
        assert!(is_command(&data, || 100), "{command:?}");
        let warm = [data[0], 1, data[2], data[3], data[4], data[5], data[6], data[7]];
        assert!(!is_command(&warm, || 100), "{command:?}");
    }
    assert!(!is_command(&[0xA1, 0, 0, 0, 5, 0, 1, 0], || 0), "feedback with an encoder");
    assert!(!is_command(&[0xA2, 0, 101, 0, 5, 0, 1, 0], || 100), "feedback with a current");
}

#[test]
fn an_encoder_value_beyond_its_bits_is_refused() {
    let model = Model::new("of 14 bits", Series::Mf, 1.0, 0.3, 14).unwrap();
    let of = |encoder| Feedback { temperature_c: 20, current: 0, velocity_dps: 0, encoder };
    assert_eq!(of(0x3FFF).phase(&model), Some(0xFFFC));
    assert_eq!(of(0x4000).phase(&model), None);
}

#[test]
fn bad_configurations_are_refused_with_the_limit() {
    use crate::motor::ImpedanceControl;
    use crate::units::AngularVelocity;
    use std::string::ToString;
    let model = |gear, constant, bits| Model::new("mine", Series::Mg, gear, constant, bits);
    for gear in [0.5, 0.0, -1.0, 1_001.0, f32::NAN, f32::INFINITY] {
        assert!(
            matches!(model(gear, 1.0, 16), Err(ConfigError::Range { parameter: "gear", .. })),
            "{gear}"
        );
    }
    for constant in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(
            model(1.0, constant, 16),
            Err(ConfigError::Range { parameter: "torque constant", .. })
        ));
    }
    for bits in [0, 13, 17, 18] {
        let value = bits.into();
        let refused =
            ConfigError::Range { parameter: "encoder bits", value, least: 14.0, most: 16.0 };
        assert_eq!(model(1.0, 1.0, bits), Err(refused));
    }
    let torque = |id, limit| {
        Motor::new(Model::MF9025_16T, id, ImpedanceControl::new(limit).unwrap())
            .map_err(|error| error.to_string())
            .err()
    };
    assert_eq!(torque(0, 1.0), Some("id 0: 1 to 32 are allowed".into()));
    assert_eq!(torque(33, 1.0), Some("id 33: 1 to 32 are allowed".into()));
    assert_eq!(torque(32, 5.27), None);
    assert!(torque(1, 5.3).is_some_and(|text| text.starts_with("torque limit in Nm 5.3: ")));
    assert!(torque(1, 0.002).is_some(), "less than a count");
    for limit in [0.0, -1.0, 58.0, f32::NAN, f32::INFINITY] {
        let limit = AngularVelocity::from_rad_per_s(limit);
        assert!(Motor::new(Model::MG5010E_I10, 1, Mode::velocity(limit)).is_err(), "{limit:?}");
        assert!(Motor::new(Model::MG5010E_I10, 1, Mode::position_velocity(limit)).is_err());
    }
    let slow = AngularVelocity::from_rad_per_s(1.0);
    for limit in [0.0, -1.0, 34.0, f32::NAN] {
        let mode = Mode::velocity_with_torque_limit(slow, limit);
        assert!(Motor::new(Model::MG5010E_I10, 1, mode).is_err(), "{limit}");
    }
}
