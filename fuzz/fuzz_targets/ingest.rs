//! Any frame, any time, any call: the bus keeps its promises.
#![no_main]

use drivetrain::motor::Devices;
use drivetrain::time::{Instant, Tick};
use drivetrain_fuzz::{Clock, Input, Watched};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    let mut bus = Watched::new(input.good_frames());
    let mut clock = Clock::new(1_000);
    let mut now = clock.read();
    // Of the time that goes on by itself; each millisecond takes long.
    let mut left_ms = 1_000;
    while !input.is_empty() {
        match input.byte() {
            0..=79 => {
                now = clock.pass(&mut input);
                if let Some(frame) = input.frame() {
                    _ = Devices::ingest(&mut bus, &frame, Instant::from_micros(now));
                }
            }
            // Every motor is heard, as it should be, and arming has a chance.
            80..=99 => hear_all(&mut bus, now, input.byte()),
            100..=149 => {
                let motor = input.byte();
                bus.set(motor.into(), input.target());
            }
            150..=157 => _ = bus.arm(Instant::from_micros(now)),
            158..=159 => bus.arm_only(input.byte()),
            160..=162 => Devices::disarm(&mut bus),
            163 => Devices::trip(&mut bus),
            164..=167 => Devices::emergency_stop(&mut bus),
            168..=170 => Devices::clear_emergency_stop(&mut bus),
            // What was left over, whatever has come since the update.
            171..=172 => send(&mut bus, input.byte()),
            173..=175 => while Devices::next_edge(&mut bus).is_some() {},
            176..=179 => bus.relax(input.byte().into()),
            180..=183 => bus.zero(input.byte().into()),
            184..=187 => bus.plug(input.byte().into()),
            188..=199 => now = go_on(&mut bus, &mut clock, &mut input, &mut left_ms),
            _ => {
                now = clock.pass(&mut input);
                let step = Tick::new(Instant::from_micros(now), input.step_s());
                Devices::update(&mut bus, step);
                send(&mut bus, input.byte());
            }
        }
    }
});

/// A fraction of a second in which each motor is heard each millisecond, on a good clock as a rule.
fn go_on(bus: &mut Watched, clock: &mut Clock, input: &mut Input, left_ms: &mut u32) -> u64 {
    let (how, target, length) = (input.byte(), input.target(), input.byte());
    let (keeps_its_clock, is_careless, is_led) =
        (how & 0x80 != 0, how & 0x40 != 0, how & 0x20 == 0);
    let mut now = clock.read();
    let span_ms = u32::from(if length < 160 { length % 16 } else { length }).min(*left_ms);
    *left_ms -= span_ms;
    for _ in 0..span_ms {
        now = if keeps_its_clock { clock.go_on() } else { clock.go_well() };
        hear_all(bus, now, 0);
        if is_careless {
            _ = bus.arm(Instant::from_micros(now));
        }
        if is_led {
            bus.set((how & 0x1F).into(), target);
        }
        Devices::update(bus, Tick::new(Instant::from_micros(now), 0.001));
        send(bus, 0);
    }
    now
}

fn hear_all(bus: &mut Watched, now: u64, angle: u8) {
    use drivetrain::frame::CanFrame;
    for id in [0x201, 0x202, 0x203, 0x209, 0x20B] {
        if let Some(frame) = CanFrame::standard(id, [angle & 0x1F, 0, 0, angle, 0, 0, 25, 0]) {
            _ = Devices::ingest(bus, &frame, Instant::from_micros(now));
        }
    }
}

/// Takes the frames; each bit of `refused` is one that the driver gives back.
fn send(bus: &mut Watched, refused: u8) {
    for turn in 0..6 {
        let Some(frame) = Devices::next_frame(bus, turn) else { return };
        if refused & (1 << turn) != 0 {
            assert!(Devices::requeue(bus, &frame));
        }
        // A full driver: the rest waits.
        if refused & 0xC0 == 0xC0 {
            return;
        }
    }
    panic!("more than five frames between two updates");
}
