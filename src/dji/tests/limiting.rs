//! Limits between the update of the loops and the frames.

use super::*;
use crate::motor::VelocityDrive;

fn amperes(bus: &Bus, motor: Handle<M3508>) -> f32 {
    bus.commanded_current(motor).unwrap().as_amperes()
}

#[test]
fn the_commanded_current_is_what_goes_on_the_wire_in_the_direction_of_the_shaft() {
    for (config, sign) in [(Config::<M3508>::at_once(1), 1), (Config::at_once(1).reversed(), -1)] {
        let (mut bus, [wheel]) = armed([config]);
        assert!(amperes(&bus, wheel).abs() < 1e-9);
        bus.set_current(wheel, Current::from_amperes(-5.0)).unwrap();
        step(&mut bus, 2);
        assert!((amperes(&bus, wheel) + 5.0).abs() < 1e-3);
        assert_eq!(sent(&mut bus), [(0x200, [sign * -4_096, 0, 0, 0])]);
        bus.detach(wheel);
        assert_eq!(bus.commanded_current(wheel), None);
    }
}

#[test]
fn outputs_are_cut_by_one_factor_and_the_others_and_the_next_update_know_nothing_of_it() {
    let (mut bus, [left, right, other]) = armed([1, 2, 3].map(Config::<M3508>::at_once));
    for (motor, raw) in [(left, 1_000), (right, -301), (other, 77)] {
        bus.set_raw(motor, raw).unwrap();
    }
    step(&mut bus, 2);
    bus.scale_outputs([left, right], 0.5);
    assert!((amperes(&bus, left) - 500.0 * 20.0 / 16_384.0).abs() < 1e-4);
    assert_eq!(sent(&mut bus), [(0x200, [500, -150, 77, 0])]);
    step(&mut bus, 3);
    assert_eq!(sent(&mut bus), [(0x200, [1_000, -301, 77, 0])]);
    step(&mut bus, 4);
    bus.scale_outputs([left, other], f32::NAN);
    assert_eq!(sent(&mut bus), [(0x200, [0, -301, 0, 0])]);
    step(&mut bus, 5);
    bus.scale_outputs([left, right, other], 1.5);
    assert_eq!(sent(&mut bus), [(0x200, [1_000, -301, 77, 0])], "nothing is raised");
}

/// Half a second below a limit that leaves a tenth: were the integral to grow meanwhile, the motor would go on to the full
/// output when the limit ends.
#[test]
fn the_speed_loop_of_a_motor_that_is_cut_does_not_wind_up() {
    let loops = PidConfig::new(0.0, 100.0, 0.0);
    for rad_per_s in [1.0, -1.0] {
        let target = AngularVelocity::from_rad_per_s(rad_per_s);
        let (mut bus, [wheel]) = armed([Config::<M3508>::at_once(1).speed_loop(loops)]);
        for ms in 2..=502 {
            assert_eq!(bus.ingest(&feedback(0x201, 0, 0), at_ms(ms)), Ingest::Taken);
            VelocityDrive::set_velocity(&mut bus, wheel, target).unwrap();
            step(&mut bus, ms);
            if ms < 502 {
                bus.scale_outputs([wheel], 0.1);
            }
        }
        // 0.1 A a tick: with what was cut to a tenth each time, and no more than that.
        let left = amperes(&bus, wheel) * rad_per_s;
        assert!((0.1..0.12).contains(&left), "{left} A at {rad_per_s} rad/s");
    }
}
