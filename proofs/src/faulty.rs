//! The same functions, each with an error that is found in the field. No proof may hold here.

use crate::frames::{Wire, frame, route};
use crate::timeouts::REFUSED;
use drivetrain::dji::Bus;
use drivetrain::frame::CanFrame;

/// Takes 8192, the first angle that there is not.
#[unsafe(no_mangle)]
extern "C" fn decode_faulty(high: u32, low: u32, fields: &mut [i32; 5]) -> u32 {
    let accepted = high <= (8192 << 16) | 0xFFFF;
    let [rpm, current] = [high as i16, (low >> 16) as i16].map(i32::from);
    *fields = [(high >> 16) as i32, 0, 0, 0, 0];
    if accepted {
        let [.., temperature, error] = low.to_be_bytes().map(i32::from);
        *fields = [(high >> 16) as i32, rpm, current, temperature, error];
    }
    u32::from(accepted)
}

/// Takes speed and current for little-endian, and the right frames.
#[unsafe(no_mangle)]
extern "C" fn decode_swapped(high: u32, low: u32, fields: &mut [i32; 5]) -> u32 {
    let accepted = crate::decode(high, low, fields);
    if accepted == 1 {
        let [_, rpm, current, ..] = fields;
        [*rpm, *current] = [*rpm as i16, *current as i16].map(i16::swap_bytes).map(i32::from);
    }
    accepted
}

/// Takes the remainder, which has the sign of the dividend.
#[unsafe(no_mangle)]
extern "C" fn unwrap_faulty(previous: u32, next: u32) -> i32 {
    (i32::from(next as u16) - i32::from(previous as u16) + 4096) % 8192 - 4096
}

/// Takes more than 8 bytes, as of CAN FD, for 8.
#[unsafe(no_mangle)]
extern "C" fn frame_cut(wire: &Wire, place: &mut CanFrame) -> u32 {
    frame(&Wire { length: wire.length.min(8), ..*wire }, place)
}

/// Gives the bus another frame instead of one of 8 bytes, where there is another.
fn replaced(
    bus: &mut Bus,
    frame: &CanFrame,
    now_us: u32,
    other: impl Fn(u32, [u8; 8]) -> Option<CanFrame>,
) -> u32 {
    let other = if frame.length() == 8 { other(frame.header(), *frame.bytes()) } else { None };
    route(bus, other.as_ref().unwrap_or(frame), now_us)
}

/// Takes an extended or remote frame for a standard data frame of the same number.
#[unsafe(no_mangle)]
extern "C" fn route_by_number(bus: &mut Bus, frame: &CanFrame, now_us: u32) -> u32 {
    const NUMBER: u16 = 0x201;
    let by_number = |header, data| {
        CanFrame::standard(NUMBER, data).filter(|_| header & 0xFFFF == u32::from(NUMBER))
    };
    replaced(bus, frame, now_us, by_number)
}

/// Takes the command frame 0x200 for feedback of the first motor: their ids lie side by side.
#[unsafe(no_mangle)]
extern "C" fn route_command(bus: &mut Bus, frame: &CanFrame, now_us: u32) -> u32 {
    let next = |header, data| CanFrame::standard(0x201, data).filter(|_| header == 0x200);
    replaced(bus, frame, now_us, next)
}

/// Makes an angle of any 16 bits, instead of refusing what is none.
#[unsafe(no_mangle)]
extern "C" fn route_masked(bus: &mut Bus, frame: &CanFrame, now_us: u32) -> u32 {
    let masked = |header, [high, low, c, d, e, f, g, h]: [u8; 8]| {
        CanFrame::standard(header as u16, [high & 0x1F, low, c, d, e, f, g, h])
    };
    replaced(bus, frame, now_us, masked)
}

/// Answers rightly, and lets another motor hear something as well.
#[unsafe(no_mangle)]
extern "C" fn route_aside(bus: &mut Bus, frame: &CanFrame, now_us: u32) -> u32 {
    let said = route(bus, frame, now_us);
    if let Some(other) = CanFrame::standard(0x20B, [0x10; 8]) {
        route(bus, &other, now_us);
    }
    said
}

/// Rounds towards zero.
macro_rules! truncated {
    ($name:ident, $limit:literal, $full_scale:literal) => {
        #[unsafe(no_mangle)]
        extern "C" fn $name(bits: u32, word: &mut i16) -> u32 {
            let value = f32::from_bits(bits);
            let raw = (value * ($limit as f32 / $full_scale)) as i32;
            let raw = if raw > $limit { $limit } else { raw };
            let raw = if raw < -$limit { -$limit } else { raw };
            *word = if value.is_finite() { raw as i16 } else { 0 };
            u32::from(value.is_finite())
        }
    };
}

truncated!(word_m2006_faulty, 10_000, 10.0);
truncated!(word_m3508_faulty, 16_384, 20.0);
truncated!(word_gm6020_voltage_faulty, 25_000, 24.0);
truncated!(word_gm6020_current_faulty, 16_384, 3.0);

/// Compares stamps of 32 bits: after 71 minutes the old ones are new again.
#[unsafe(no_mangle)]
extern "C" fn word_at_faulty(times: &[u64; 3]) -> i32 {
    let [heard, set, updated] = *times;
    let near = |stamp: u64, limit: u32| (updated as u32).wrapping_sub(stamp as u32) <= limit;
    match set.checked_sub(heard) {
        Some(age) if age <= 1_000_000 => {
            let drives = updated > set && near(heard, 1_000_000) && near(set, 100_000);
            if drives { 1_000 } else { 0 }
        }
        _ => REFUSED,
    }
}

/// Takes what is near for fresh, before and after: a clock that swings drives for ever.
#[unsafe(no_mangle)]
extern "C" fn word_at_near(times: &[u64; 3]) -> i32 {
    let [heard, set, updated] = *times;
    let near = |one: u64, other: u64, limit: u64| one.abs_diff(other) <= limit;
    if !near(set, heard, 1_000_000) {
        return REFUSED;
    }
    if near(updated, heard, 1_000_000) && near(updated, set, 100_000) { 1_000 } else { 0 }
}
