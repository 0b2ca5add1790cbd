//! What a foreign decoder reads in each frame after whatever ends the driving, at every moment from the arming on.

use crate::bench::{Bench, operation};
use crate::{index, kind, rad_per_s};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, AngleDrive, Devices, VelocityDrive};
use drivetrain::robstride::{Mode, Model, Motor};
use drivetrain::units::Angle;

/// No gains and a torque within half a count of zero; disabled; a question; the run mode; or no current. Nothing else, above all no
/// target of the drive's own loops.
fn is_rest(frame: &CanFrame) -> bool {
    let (id, data) = (frame.header(), u64::from_be_bytes(*frame.bytes()));
    match kind(frame) {
        1 => matches!(id >> 8 & 0xFFFF, 0x7FFF | 0x8000) && data & 0xFFFF_FFFF == 0,
        4 | 17 => true,
        18 => index(frame) == 0x7005 || index(frame) == 0x7006 && data & 0xFFFF_FFFF == 0,
        _ => false,
    }
}

type Set = fn(&mut Actuator<Motor>);

#[derive(Debug, Clone, Copy)]
enum Event {
    Disarm,
    EmergencyStop,
    LostTarget,
    LostFeedback,
    BadStep,
    Fault,
    LostSupply,
}

/// How long the event takes until it is one, in ms: the time-outs of the motor, and a step that is held once.
const fn delay(event: Event) -> u32 {
    match event {
        Event::Disarm | Event::EmergencyStop => 0,
        Event::LostTarget => 101,
        Event::LostFeedback => 11,
        Event::BadStep | Event::Fault | Event::LostSupply => 2,
    }
}

fn rests_after(model: Model, mode: impl Into<Mode>, set: Set, event: Event, moment: u32) {
    let mut bench = Bench::of(model, mode);
    bench.steps(150, |_| {});
    bench.own.arm(bench.now()).unwrap();
    let mut was_driven = false;
    bench.steps(moment, |bench| {
        set(&mut bench.own);
        was_driven |= bench.drive.is_enabled();
    });
    assert!(was_driven || moment < 200);
    assert!(moment < 200 || !bench.frames.iter().all(is_rest), "driven by {:?}", bench.frames);
    match event {
        Event::Disarm => Devices::disarm(&mut bench.own),
        Event::EmergencyStop => Devices::emergency_stop(&mut bench.own),
        Event::LostFeedback => bench.is_deaf = true,
        Event::BadStep => bench.dt_s = f32::NAN,
        Event::Fault => bench.drive.fail(1),
        Event::LostSupply => bench.drive.lose_supply(),
        Event::LostTarget => {}
    }
    for ms in 0..150 {
        if !matches!(event, Event::LostTarget) {
            set(&mut bench.own);
        }
        bench.step();
        if ms >= delay(event) {
            let all = bench.frames.iter().all(is_rest);
            // A drive that was not enabled yet cannot have reset, and is enabled later.
            let goes_on = matches!(event, Event::LostSupply) && !was_driven;
            assert!(all || goes_on, "{event:?} at {moment} ms, {ms} ms later: {:?}", bench.frames);
        }
    }
}

fn rests(model: Model, mode: impl Into<Mode> + Copy, set: Set) {
    for event in [
        Event::Disarm,
        Event::EmergencyStop,
        Event::LostTarget,
        Event::LostFeedback,
        Event::BadStep,
        Event::Fault,
        Event::LostSupply,
    ] {
        for moment in (0..130).chain([200, 350, 351, 352, 353, 500]) {
            rests_after(model, mode, set, event, moment);
        }
    }
}

#[test]
fn each_frame_after_the_end_of_driving_is_rest_in_the_operation_mode() {
    for model in [Model::RS02, Model::RS04, Model::CYBERGEAR] {
        rests(model, operation(), |own| _ = own.set_angle((), Angle::from_radians(1.0)));
    }
}

#[test]
fn each_frame_after_the_end_of_driving_is_rest_in_the_modes_of_the_drive() {
    for model in [Model::RS02, Model::CYBERGEAR] {
        rests(model, Mode::velocity(rad_per_s(10.0), 8.0), |own| {
            _ = own.set_velocity((), rad_per_s(5.0));
        });
        rests(model, Mode::position(rad_per_s(10.0), 8.0), |own| {
            _ = own.set_angle((), Angle::from_radians(1.0));
        });
        rests(model, Mode::current(8.0, 1.0), |own| _ = own.set_torque(2.0));
    }
}
