//! Any frame, any time, any call: the bus keeps its promises.
#![no_main]

use drivetrain::motor::CanDevice;
use drivetrain::time::{Instant, Tick};
use drivetrain_fuzz::{Input, Watched};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    let mut bus = Watched::new();
    let mut now = 1_000;
    while !input.is_empty() {
        match input.byte() {
            0..=79 => {
                now = input.time(now);
                if let Some(frame) = input.frame() {
                    _ = bus.ingest(&frame, Instant::from_micros(now));
                }
            }
            // Every motor is heard, as it should be, and arming has a chance.
            80..=99 => hear_all(&mut bus, now, input.byte()),
            100..=149 => {
                let motor = input.byte();
                bus.set(motor.into(), input.target());
            }
            150..=159 => _ = bus.arm(Instant::from_micros(now)),
            160..=163 => bus.disarm(),
            164..=167 => bus.emergency_stop(),
            168..=170 => bus.clear_emergency_stop(),
            // What was left over, whatever has come since the update.
            171..=172 => send(&mut bus, input.byte()),
            173..=175 => while bus.next_edge().is_some() {},
            176..=179 => bus.relax(input.byte().into()),
            180..=183 => bus.zero(input.byte().into()),
            184..=187 => bus.plug(input.byte().into()),
            // All is well for some milliseconds.
            188..=199 => {
                let (motor, target) = (input.byte(), input.target());
                for _ in 0..input.byte() % 16 {
                    now += 1_000;
                    hear_all(&mut bus, now, 0);
                    bus.set(motor.into(), target);
                    bus.update(Tick::new(Instant::from_micros(now), 0.001));
                    send(&mut bus, 0);
                }
            }
            _ => {
                now = input.time(now);
                let step = Tick::new(Instant::from_micros(now), input.step_s());
                bus.update(step);
                send(&mut bus, input.byte());
            }
        }
    }
});

fn hear_all(bus: &mut Watched, now: u64, angle: u8) {
    use drivetrain::frame::CanFrame;
    for id in [0x201, 0x202, 0x203, 0x209, 0x20B] {
        if let Some(frame) = CanFrame::standard(id, [angle & 0x1F, 0, 0, angle, 0, 0, 25, 0]) {
            _ = bus.ingest(&frame, Instant::from_micros(now));
        }
    }
}

/// Takes the frames; each bit of `refused` is one that the driver gives back.
fn send(bus: &mut Watched, refused: u8) {
    for turn in 0..6 {
        let Some(frame) = bus.next_frame(turn) else { return };
        if refused & (1 << turn) != 0 {
            assert!(bus.requeue(&frame));
        }
        // A full driver: the rest waits.
        if refused & 0xC0 == 0xC0 {
            return;
        }
    }
    panic!("more than five frames between two updates");
}
