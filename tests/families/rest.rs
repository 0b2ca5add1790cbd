//! Each frame after an event that ends the driving is rest to a foreign decoder: in each mode of each family, at each
//! millisecond of the first 130 from the arming on and at four moments later; the fuzz target `drives` draws others.

use crate::motors::FAMILIES;
use crate::station::Station;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    Disarm,
    EmergencyStop,
    LostTarget,
    LostFeedback,
    BadSteps,
    ClockBack,
}

const EVENTS: [Event; 6] = [
    Event::Disarm,
    Event::EmergencyStop,
    Event::LostTarget,
    Event::LostFeedback,
    Event::BadSteps,
    Event::ClockBack,
];

/// How long the event takes until it is one, in ms: the time-outs of the motor, and a step that is held once.
const fn delay_ms(event: Event) -> u32 {
    match event {
        Event::LostTarget => 101,
        Event::LostFeedback => 11,
        Event::BadSteps => 1,
        Event::Disarm | Event::EmergencyStop | Event::ClockBack => 0,
    }
}

fn rests_after(mode: &str, make: fn() -> Station, event: Event, moment_ms: u32) {
    let mut station = make().armed();
    let mut was_driven = false;
    station.steps(moment_ms, |station| {
        _ = station.device.set(1.0);
        was_driven |= !station.rests();
    });
    assert!(was_driven || moment_ms < 400, "{mode}: driven by {:?}", station.frames);
    match event {
        Event::Disarm => station.device.disarm(),
        Event::EmergencyStop => station.device.emergency_stop(),
        Event::LostFeedback => station.is_deaf = true,
        Event::BadSteps => station.dt_s = f32::NAN,
        Event::ClockBack => station.now_us -= 5_000,
        Event::LostTarget => {}
    }
    for ms in 0..130 {
        if event != Event::LostTarget {
            _ = station.device.set(1.0);
        }
        // The clock goes back once, and on from there.
        if event == Event::ClockBack && ms == 0 {
            station.step_here()
        } else {
            station.step()
        }
        let frames = &station.frames;
        assert!(
            ms < delay_ms(event) || station.rests(),
            "{mode}: {event:?} at {moment_ms} ms, {ms} ms later: {frames:?}"
        );
    }
}

/// Through enabling, opening, and the places of the questions.
fn every_frame_is_rest(name: &str) {
    let family = FAMILIES.iter().find(|family| family.name == name).unwrap();
    for (mode, make) in family.modes {
        for event in EVENTS {
            for moment_ms in (0..130).chain([223, 400, 433, 467]) {
                rests_after(&format!("{name}, {mode}"), *make, event, moment_ms);
            }
        }
    }
}

macro_rules! sweeps {
    ($($test:ident $family:literal,)*) => {
        $(
            #[test]
            fn $test() {
                every_frame_is_rest($family);
            }
        )*
        #[test]
        fn each_family_is_swept() {
            assert_eq!(FAMILIES.map(|family| family.name), [$($family),*]);
        }
    };
}

sweeps! {
    every_frame_to_damiao_after_an_event_is_rest "damiao",
    every_frame_to_robstride_after_an_event_is_rest "robstride",
    every_frame_to_vesc_after_an_event_is_rest "vesc",
    every_frame_to_lk_after_an_event_is_rest "lk",
    every_frame_to_rmd_after_an_event_is_rest "rmd",
    every_frame_to_odrive_after_an_event_is_rest "odrive",
}
