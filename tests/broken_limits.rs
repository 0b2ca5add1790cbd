//! A limit that is NaN, infinite or below zero: each function that takes one. None of them is taken as no limit.

#![cfg(test)]

#[expect(dead_code, reason = "shared with the tests of arming")]
#[path = "arming/own.rs"]
mod own;

use drivetrain::chassis::{
    Chassis, ChassisLimits, Differential, Kinematics, ModeConfig, Modes, Omni, PowerBuffer,
    PowerFit, PowerModel, Swerve,
};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M3508};
use drivetrain::error::ConfigError;
use drivetrain::frame::CanFrame;
use drivetrain::geometry::{Twist, Vec2};
use drivetrain::motor::{HealthConfig, Ingest, TargetError};
#[cfg(feature = "hal")]
use drivetrain::pwm::BrushedConfig;
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity, Current, Voltage};
use embedded_can::ErrorKind;
use proptest::prelude::*;
use std::cell::Cell;

/// Limits that are none, and count as zero where there is no way to refuse them.
const BROKEN: [f32; 4] = [f32::NAN, -f32::NAN, f32::NEG_INFINITY, -80.0];
/// Values that no parameter may have.
const NOT_FINITE: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

fn model() -> PowerModel {
    PowerModel::new(1.0, 0.475, 0.065, 0.001).unwrap()
}

fn load(torque: f32, speed_rad_s: f32) -> (f32, AngularVelocity) {
    (torque, AngularVelocity::from_rad_per_s(speed_rad_s))
}

// With a NaN limit taken as no limit, every other test passed: the motors would have had all the power there is.
#[test]
fn a_power_limit_that_is_none_lets_no_torque_through() {
    for limit_w in BROKEN {
        let (scale, power_w) = model().cut([load(10.0, 30.0); 4], limit_w);
        assert!(scale.abs() < 1e-9 && power_w > 0.0, "{limit_w}: {scale} {power_w}");
        // Without losses that are there anyway, the limit of zero holds.
        let mechanical = PowerModel::new(0.0, 1.0, 1.0, 0.0).unwrap();
        let (scale, power_w) = mechanical.cut([load(10.0, 30.0); 4], limit_w);
        assert!(scale.abs() < 1e-9 && power_w == 0.0, "{limit_w}: {scale} {power_w}");
    }
    // An infinite one is a number above all others, and cuts what is none itself all the same.
    let (scale, power_w) = model().cut([load(10.0, 30.0); 4], f32::INFINITY);
    assert!(scale >= 1.0 && power_w.is_finite(), "{scale} {power_w}");
    let (scale, _) = model().cut([load(f32::NAN, 30.0)], f32::INFINITY);
    assert!(scale.abs() < 1e-9, "{scale}");
}

proptest! {
    /// Law: what counts as zero is zero, whatever the loads.
    #[test]
    fn a_power_limit_that_is_none_cuts_as_a_limit_of_zero(
        loads in proptest::collection::vec((-20.0_f32..20.0, -60.0_f32..60.0), 0..6),
    ) {
        let loads = loads.into_iter().map(|(torque, speed)| load(torque, speed));
        let zero = model().cut(loads.clone(), 0.0);
        for limit_w in BROKEN {
            prop_assert_eq!(model().cut(loads.clone(), limit_w), zero);
        }
    }
}

#[test]
fn a_power_buffer_allows_with_a_limit_that_is_none_what_it_allows_with_zero() {
    let gains = PidConfig::new(2.0, 0.5, 0.0).with_output_limit(120.0);
    for limit_w in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -80.0] {
        let mut buffer = PowerBuffer::new(20.0, gains).unwrap();
        let mut zero = buffer;
        for energy_j in [Some(60.0), Some(20.0), None, Some(f32::NAN), Some(3.0)] {
            let allowed_w = buffer.allowance_w(limit_w, energy_j, 0.01);
            let expected_w = zero.allowance_w(0.0, energy_j, 0.01);
            assert!((allowed_w - expected_w).abs() < 1e-6, "{limit_w}: {allowed_w} W");
        }
        // What is allowed is a limit in turn.
        let allowed_w = buffer.allowance_w(limit_w, None, 0.01);
        assert!(model().cut([load(10.0, 30.0); 4], allowed_w).0.abs() < 1e-9);
    }
}

#[test]
fn a_power_buffer_refuses_a_reserve_and_a_share_that_are_none() {
    let gains = PidConfig::new(2.0, 0.0, 0.0);
    let refused = |name| Err(ConfigError::Negative(name));
    for bad in NOT_FINITE.into_iter().chain([-0.1]) {
        assert_eq!(PowerBuffer::new(bad, gains), refused("reserve_j"), "{bad}");
        let buffer = PowerBuffer::new(20.0, gains).unwrap();
        assert_eq!(buffer.with_blind_share(bad), refused("blind_share"), "{bad}");
    }
    for bad in NOT_FINITE {
        let limited = PowerBuffer::new(20.0, gains.with_output_limit(bad));
        assert!(matches!(limited, Err(ConfigError::Loop(_, _))), "{bad}");
        for parameter in 0..4 {
            let [mut k0, mut k1, mut k2, mut k3] = [1.0; 4];
            *[&mut k0, &mut k1, &mut k2, &mut k3][parameter] = bad;
            let name = ["k0", "k1", "k2", "k3"][parameter];
            assert_eq!(PowerModel::new(k0, k1, k2, k3), Err(ConfigError::Negative(name)), "{bad}");
        }
    }
}

/// A fit that starts from a factor that is none forgets nothing, and learns all the same.
#[test]
fn a_forgetting_factor_that_is_none_is_one() {
    let truth = PowerModel::new(1.0, 1.0, 2.0, 0.01).unwrap();
    let learned = |forgetting| {
        let mut fit = PowerFit::new(PowerModel::new(0.0, 1.0, 1.0, 0.0).unwrap(), forgetting);
        for step in 0..2_000_u16 {
            let wheel = load(f32::from(step % 7), f32::from(step % 50));
            fit.learn([wheel; 4], 4.0 * truth.power_w(wheel));
        }
        assert_eq!(fit.rejected(), 0);
        fit
    };
    let never = learned(1.0);
    assert!((never.model().power_w(load(3.0, 25.0)) - truth.power_w(load(3.0, 25.0))).abs() < 0.05);
    for bad in NOT_FINITE.into_iter().chain([-1.0, 0.0, 0.89, 1.1]) {
        assert_eq!(learned(bad), never, "{bad}");
    }
}

#[test]
fn a_wheel_limit_that_is_none_stops_all_wheels_of_any_layout() {
    let two = Differential::new(0.05, 0.2).unwrap();
    let three = Omni::three(0.05, 0.2).unwrap();
    let swerve = Swerve::new(0.05, [Vec2::new(0.3, 0.0), Vec2::new(-0.3, 0.0)]).unwrap();
    let twist = Twist::new(1.0, 0.0, -1.0);
    let limit = AngularVelocity::from_rad_per_s;
    for bad in BROKEN.into_iter().chain([0.0]) {
        let still = AngularVelocity::ZERO;
        let wheels = two.inverse(twist);
        assert_eq!(two.desaturate(wheels, limit(bad)), ([still; 2], 0.0), "{bad}");
        let wheels = three.inverse(twist);
        assert_eq!(three.desaturate(wheels, limit(bad)), ([still; 3], 0.0), "{bad}");
        let modules = swerve.inverse(twist);
        let (told, factor) = swerve.desaturate(modules, limit(bad));
        assert!(
            factor == 0.0 && told.iter().all(|module| module.velocity == still),
            "{bad}: {told:?}"
        );
        assert!(told.iter().zip(modules).all(|(told, module)| told.angle == module.angle));
    }
    let wheels = two.inverse(twist);
    assert_eq!(two.desaturate(wheels, limit(f32::INFINITY)), (wheels, 1.0));
}

#[test]
fn limits_of_a_chassis_that_are_none_are_refused_and_those_before_hold() {
    let mut chassis = Chassis::new(Differential::new(0.05, 0.2).unwrap());
    let speed = AngularVelocity::from_rad_per_s;
    let limits = ChassisLimits::new().with_acceleration(3.0, 9.0).with_wheel_speed(speed(5.0));
    chassis.set_limits(limits).unwrap();
    for bad in [f32::NAN, f32::NEG_INFINITY, 0.0, -1.0] {
        for (limits, name) in [
            (limits.with_acceleration(bad, 9.0), "linear_m_s2"),
            (limits.with_acceleration(3.0, bad), "angular_rad_s2"),
            (limits.with_wheel_speed(speed(bad)), "wheel speed"),
            (limits.with_command_timeout(bad), "command timeout"),
        ] {
            assert_eq!(limits.validate(), Err(ConfigError::NotAboveZero(name)), "{bad}");
            assert_eq!(chassis.set_limits(limits), Err(ConfigError::NotAboveZero(name)), "{bad}");
        }
    }
    // For ever, or as good as that: a dead program would drive on.
    for too_long_s in [f32::INFINITY, f32::MAX, 3_600.0, 1.000_001] {
        let limits = limits.with_command_timeout(too_long_s);
        let refused =
            ConfigError::Limit { parameter: "command timeout in s", value: too_long_s, most: 1.0 };
        assert_eq!(limits.validate(), Err(refused), "{too_long_s}");
        assert_eq!(chassis.set_limits(limits), Err(refused), "{too_long_s}");
    }
    assert_eq!(limits.with_command_timeout(1.0).validate(), Ok(()));
    let mut fastest = 0.0_f32;
    for step in 0..2_000_u16 {
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        let now = Instant::from_micros(1_000 * u64::from(step));
        let before = chassis.reference();
        let [left, _] = chassis.update([None; 2], Tick::new(now, 0.001));
        assert!((chassis.reference() - before).linear().norm() <= 3.001e-3);
        fastest = fastest.max(left.as_rad_per_s());
    }
    assert!((fastest - 5.0).abs() < 1e-3, "{fastest}");
}

#[test]
fn modes_refuse_what_is_none() {
    let config = ModeConfig::new(PidConfig::new(6.0, 0.0, 0.1));
    for bad in NOT_FINITE.into_iter().chain([-0.1]) {
        for (config, name) in [
            (config.with_rotor(bad, 0.0, 0.0), "the rotor's base"),
            (config.with_rotor(6.0, bad, 0.0), "the rotor's swing"),
            (config.with_rotor(6.0, 0.0, bad), "the rotor's frequency"),
            (config.with_gimbal_timeout(bad), "the gimbal's timeout"),
            (config.with_transition(bad), "the transition"),
        ] {
            assert_eq!(Modes::new(config).err(), Some(ConfigError::Negative(name)), "{bad}");
        }
        let limited = ModeConfig::new(PidConfig::new(6.0, 0.0, 0.1).with_output_limit(bad));
        assert!(matches!(Modes::new(limited), Err(ConfigError::Loop(_, _))), "{bad}");
    }
}

#[test]
fn a_motor_with_a_limit_that_is_none_is_not_attached() {
    let speed = PidConfig::new(0.6, 6.0, 0.0);
    let refused = |outcome: Result<(), String>| assert!(outcome.is_err());
    for bad in [f32::NAN, f32::NEG_INFINITY, 0.0, -1.0] {
        let mut bus = Bus::new();
        let attach = |bus: &mut Bus, config| {
            bus.attach::<M3508>(config).map(|_| ()).map_err(|error| error.to_string())
        };
        let config = Config::<M3508>::new(1);
        refused(attach(&mut bus, config.with_current_limit(Current::from_amperes(bad))));
        refused(attach(&mut bus, config.speed_loop(speed.with_output_limit(bad))));
        refused(attach(&mut bus, config.speed_loop(speed.with_slew_limit(bad))));
        refused(attach(&mut bus, config.speed_loop(speed.with_integral_limit(bad))));
        refused(attach(&mut bus, config.position_loop(speed.with_output_limit(bad), speed)));
        let config = Config::<Gm6020Voltage>::new(1);
        for config in [
            config.with_voltage_limit(Voltage::from_volts(bad)),
            config.with_nominal_voltage(Voltage::from_volts(bad)),
        ] {
            refused(bus.attach(config).map(|_| ()).map_err(|error| error.to_string()));
        }
        // While it runs too: the loop stays as it was.
        let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(speed)).unwrap();
        let outcome = bus.set_speed_loop(wheel, speed.with_output_limit(bad));
        let name = outcome.map_err(|error| error.parameter());
        assert!(name.is_err_and(|name| name.starts_with("output_")), "{bad}: {outcome:?}");
        assert_eq!(bus.motors().count(), 1);
    }
}

/// What is looked for in a motor is refused where it makes no sense, by each kind of motor.
#[test]
fn a_health_configuration_that_makes_no_sense_is_refused() {
    static HOLD: HealthConfig = HealthConfig::new().with_stall_hold(f32::NAN);
    static EFFORT: HealthConfig =
        HealthConfig::new().with_stall(f32::NAN, 0.02, Duration::from_millis(500));
    static SPEED: HealthConfig =
        HealthConfig::new().with_stall(0.5, f32::INFINITY, Duration::from_millis(500));
    static SOFT: HealthConfig = HealthConfig::new()
        .with_soft_limits(Angle::from_radians(f32::NAN), Angle::from_radians(1.0));
    static HEAT: HealthConfig = HealthConfig::new().with_temperatures(90, 80);
    for (config, name) in [
        (&HOLD, "stall hold"),
        (&EFFORT, "stall effort"),
        (&SPEED, "stall speed"),
        (&SOFT, "soft limits"),
        (&HEAT, "health temperatures"),
    ] {
        assert_eq!(own::own(1).with_health(config).err(), Some(name));
        let outcome = Bus::new().attach(Config::<M3508>::new(1).with_health(config));
        assert!(outcome.is_err_and(|error| error.to_string().contains(name)), "{name}");
        #[cfg(feature = "hal")]
        assert!(BrushedConfig::new(1).with_health(config).validate().is_err(), "{name}");
    }
}

#[cfg(feature = "hal")]
#[test]
fn a_motor_on_pins_with_a_limit_that_is_none_is_refused() {
    use drivetrain::pwm::RcPwm;
    use embedded_hal::pwm::{ErrorType, SetDutyCycle};
    struct Channel;
    impl ErrorType for Channel {
        type Error = core::convert::Infallible;
    }
    impl SetDutyCycle for Channel {
        fn max_duty_cycle(&self) -> u16 {
            20_000
        }
        fn set_duty_cycle(&mut self, _: u16) -> Result<(), Self::Error> {
            Ok(())
        }
    }
    let speed = AngularVelocity::from_rad_per_s;
    let motor = BrushedConfig::new(1).with_encoder(1_320.0, 16);
    for bad in NOT_FINITE.into_iter().chain([0.0, -0.5]) {
        assert!(motor.with_limit(bad).validate().is_err(), "{bad}");
        assert!(motor.with_no_load_speed(speed(bad)).validate().is_err(), "{bad}");
        assert!(motor.with_velocity_filter(bad).validate().is_err() == (bad != 0.0), "{bad}");
        assert!(RcPwm::new(Channel).with_full_speed(speed(bad)).is_err(), "{bad}");
    }
    assert!(motor.with_limit(0.5).with_no_load_speed(speed(30.0)).validate().is_ok());
}

#[test]
fn a_joint_with_a_speed_that_is_none_is_refused() {
    use drivetrain::snake::{Config, Joints};
    for bad in NOT_FINITE.into_iter().chain([-0.5]) {
        let speed = AngularVelocity::from_rad_per_s(bad);
        assert!(Joints::new().attach(Config::new(1).with_speed(speed)).is_err(), "{bad}");
        let mut joints = Joints::new();
        let joint = joints.attach(Config::new(1)).unwrap();
        let outcome = joints.set_speed(joint, speed);
        let expected = if bad.is_finite() { Ok(()) } else { Err(TargetError::NotFinite) };
        assert_eq!(outcome, expected, "{bad}: set while it runs, the sign does not count");
    }
}

/// Takes everything.
#[derive(Default)]
struct Wire(Vec<CanFrame>);

impl embedded_can::nb::Can for Wire {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        self.0.push(*frame);
        Ok(None)
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

/// Four wheels at 100 rpm that are asked for 10 A, under a limit in W that comes from outside; the words of the last tick.
fn words_under(limit_w: f32) -> [i16; 4] {
    let clock = Cell::new(Instant::from_micros(1_000));
    let mut bus = Bus::new();
    let wheels: [Handle<M3508>; 4] =
        bus.attach_all([1, 2, 3, 4].map(Config::<M3508>::new)).unwrap();
    let mut runner = Runner::new(Nb(Wire::default()), &clock, bus);
    for ms in 0..400_u32 {
        clock.set(clock.get() + Duration::from_millis(1));
        for id in 0x201..=0x204 {
            // The angle goes on by what the speed says.
            let [.., a, b] = (ms * 262 % 8_192).to_be_bytes();
            let frame = CanFrame::standard(id, [a, b, 0x07, 0x80, 0, 0, 30, 0]).unwrap();
            assert_eq!(runner.ingest(&frame, clock.get()), Ingest::Taken);
        }
        let tick = Tick::new(clock.get(), 0.001);
        if ms == 0 {
            runner.arm(tick).unwrap();
        }
        for wheel in wheels {
            runner.device_mut().set_current(wheel, Current::from_amperes(10.0)).unwrap();
        }
        // All that the motors ask for gets through until the last tick.
        let limit_w = if ms == 399 { limit_w } else { 1e6 };
        runner.port_mut().0.0.clear();
        runner.tick_limited(tick, |bus| {
            let loads = wheels.map(|wheel| {
                (
                    bus.commanded_current(wheel).unwrap().as_amperes(),
                    bus.state(wheel).unwrap().velocity,
                )
            });
            let (scale, _) = model().cut(loads, limit_w);
            bus.scale_outputs(wheels, scale);
        });
    }
    let frame =
        runner.port_mut().0.0.iter().find(|frame| frame.header() == 0x200).copied().unwrap();
    let bytes = frame.bytes();
    [0, 2, 4, 6].map(|at| i16::from_be_bytes([bytes[at], bytes[at + 1]]))
}

#[test]
fn a_power_limit_that_is_none_reaches_the_wire_as_zero() {
    for limit_w in BROKEN {
        assert_eq!(words_under(limit_w), [0; 4], "{limit_w} W");
    }
    let [half, ..] = words_under(60.0);
    let whole = words_under(f32::INFINITY);
    assert!(half > 0 && whole.iter().all(|word| *word > 2 * half), "{half} of {whole:?}");
}

/// A limit that is NaN was taken as none: the loop had the whole duty.
#[cfg(feature = "hal")]
#[test]
fn a_speed_loop_of_a_brushed_motor_with_a_limit_of_nan_is_refused() {
    use drivetrain::pwm::BrushedConfig;
    let motor = BrushedConfig::new(1).with_encoder(1_320.0, 16);
    let speed = PidConfig::new(0.02, 0.4, 0.0);
    assert!(motor.with_speed_loop(speed.with_output_limit(f32::NAN)).validate().is_err());
    assert!(motor.with_speed_loop(speed.with_output_range(f32::NAN, 1.0)).validate().is_err());
    assert!(motor.with_speed_loop(speed.with_output_range(-1.0, f32::NAN)).validate().is_err());
    assert!(motor.with_speed_loop(speed).validate().is_ok());
}
