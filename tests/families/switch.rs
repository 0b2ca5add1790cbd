//! A program that disarms, or stops, in each tick while a switch is off: the drive is asked for its settings all the same, and the
//! switch arms.

use crate::motors::FAMILIES;
use crate::station::Station;

/// What the program does in each tick while the switch is off.
type Off = fn(&mut Station);

const OFF: [(&str, Off); 2] = [
    ("disarm", |station| station.device.disarm()),
    ("emergency stop", |station| station.device.emergency_stop()),
];

#[test]
fn a_switch_that_is_off_in_each_tick_arms_when_it_turns_on() {
    for family in &FAMILIES {
        for (mode, make) in family.modes.iter().chain(family.others) {
            for (what, off) in OFF {
                let mut station = make();
                // Off from the start, and off again after a drive.
                for round in 0..2 {
                    for _ in 0..1_000 {
                        off(&mut station);
                        station.step();
                        assert!(station.rests(), "{} {mode}, {what}", family.name);
                    }
                    station.device.clear_emergency_stop();
                    station.steps(150, |_| {});
                    let armed = station.device.arm(station.now());
                    assert_eq!(armed, Ok(()), "{} {mode}, {what}, round {round}", family.name);
                    station.steps(400, |station| _ = station.device.set(1.0));
                    assert!(station.device.is_armed(), "{} {mode}, {what}", family.name);
                }
            }
        }
    }
}

/// The switch alone: no tick without a disarm before the request to arm.
#[test]
fn no_tick_without_a_disarm_is_needed_before_arming() {
    for family in &FAMILIES {
        for (mode, make) in family.modes {
            let mut station = make();
            station.steps(1_000, |station| station.device.disarm());
            let armed = station.device.arm(station.now());
            assert_eq!(armed, Ok(()), "{} {mode}", family.name);
        }
    }
}

/// `docs/motors.md` has this time.
#[test]
fn a_tenth_of_a_second_off_is_enough_to_arm_again() {
    for family in &FAMILIES {
        for (mode, make) in family.modes {
            let mut station = make().driven();
            station.steps(100, |station| station.device.disarm());
            let armed = station.device.arm(station.now());
            assert_eq!(armed, Ok(()), "{} {mode}", family.name);
        }
    }
}
