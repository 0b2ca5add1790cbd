//! When feedback and targets count as too old.

use crate::Shared;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Timeouts;
use drivetrain::time::{Duration, Instant, Tick};

/// What a motor is asked for, on the wire's scale.
const ASKED: i16 = 1_000;

/// What stands for a word where the target was refused.
pub const REFUSED: i32 = i32::MAX;

const fn armed_with(timeouts: Timeouts) -> (Bus, Handle<M3508>) {
    let mut bus = Bus::new().with_timeouts(timeouts);
    match bus.attach(Config::new(1).with_opening(Duration::ZERO)) {
        Ok(motor) => (bus, motor),
        Err(_) => panic!("not attached"),
    }
}

/// Hears a motor and arms it, updates and sets a target, and updates again, each at its time in µs: the word that is sent then,
/// or [`REFUSED`] when the target was.
fn word((bus, motor): &mut (Bus, Handle<M3508>), times: &[u64; 3]) -> i32 {
    let [heard, set, updated] = times.map(Instant::from_micros);
    if let Some(rest) = CanFrame::standard(0x201, [0; 8]) {
        _ = bus.ingest(&rest, heard);
    }
    if bus.arm(heard).is_err() {
        return i32::MIN;
    }
    bus.update(Tick::new(set, 0.001));
    while bus.next_frame().is_some() {}
    if bus.set_raw(*motor, ASKED).is_err() {
        return REFUSED;
    }
    bus.update(Tick::new(updated, 0.001));
    bus.next_frame().map_or(0, |frame| {
        let [high, low, ..] = *frame.bytes();
        i32::from(i16::from_be_bytes([high, low]))
    })
}

/// Feedback is late after 1 s and targets are too old after 100 ms, so that either can be the first.
#[unsafe(no_mangle)]
extern "C" fn word_at(times: &[u64; 3]) -> i32 {
    const LATE: Duration = Duration::from_secs(1);
    const TIMEOUTS: Timeouts = match Timeouts::new().with_feedback(LATE, LATE) {
        Ok(timeouts) => timeouts,
        Err(_) => panic!("refused"),
    };
    static SETUP: Shared<(Bus, Handle<M3508>)> = Shared::new(armed_with(TIMEOUTS));
    word(SETUP.get(), times)
}
