//! Any frame, any time, any call: the bus keeps its promises.
#![no_main]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, M2006, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::CanDevice;
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{AngularVelocity, Current};
use embedded_can::{ExtendedId, Frame, StandardId};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut bus = Bus::new();
    let speed = PidConfig::new(2.0, 5.0, 0.01);
    let Ok(wheel) = bus.attach(Config::<M3508>::new(1).speed_loop(speed)) else { return };
    let Ok(feeder) = bus.attach(Config::<M2006>::new(2).reversed()) else { return };
    let Ok(yaw) = bus.attach(Config::<Gm6020Voltage>::new(7).position_loop(speed, speed)) else { return };
    let limits = [(0x200, [16_384_u16, 10_000, 0, 0]), (0x2FF, [0, 0, 25_000, 0])];

    let mut now = 0_u64;
    for step in data.as_chunks::<14>().0 {
        let [op, flags, id_high, id_low, length, time, payload @ ..] = *step;
        // Forward, and sometimes back.
        let jump = u64::from(time) << (flags & 31);
        now = if flags & 32 == 0 { now.wrapping_add(jump) } else { now.saturating_sub(jump) };
        let at = Instant::from_micros(now);
        let raw = u16::from_be_bytes([id_high, id_low]);
        let value = f32::from_bits(u32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]]));
        match op % 12 {
            0..=2 => {
                let length = usize::from(length % 9);
                let id = 0x1F0 + raw % 0x20;
                let frame = match (flags >> 6, StandardId::new(id), ExtendedId::new(u32::from(id))) {
                    (0 | 1, Some(id), _) => CanFrame::new(id, &payload[..length]),
                    (2, Some(id), _) => CanFrame::new_remote(id, length),
                    (_, _, Some(id)) => CanFrame::new(id, &payload[..length]),
                    _ => None,
                };
                if let Some(frame) = frame {
                    _ = bus.ingest(&frame, at);
                }
            }
            3 => _ = bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(value)),
            4 => _ = bus.set_current(feeder, Current::from_amperes(value)),
            5 => _ = bus.set_angle(yaw, drivetrain::units::Angle::from_radians(value)),
            6 => _ = bus.arm(at),
            7 => match flags & 3 {
                0 => bus.emergency_stop(),
                1 => bus.clear_emergency_stop(),
                2 => bus.disarm(),
                _ => bus.relax(wheel),
            },
            8 => _ = bus.zero(yaw),
            9 => bus.detach(feeder),
            _ => {
                let dt_s = if flags & 1 == 0 { 0.001 } else { value };
                bus.update(Tick::new(at, dt_s));
                let mut sent = 0;
                let any_armed = bus.motors().any(|(motor, _)| bus.is_motor_armed(motor));
                while let Some(frame) = bus.next_frame() {
                    sent += 1;
                    assert!(sent <= 5, "bounded");
                    let words = frame.bytes().chunks_exact(2).map(|word| i16::from_be_bytes([word[0], word[1]]));
                    let (_, limits) = limits.iter().find(|(id, _)| frame.header() == *id).expect("an id in use");
                    for (word, limit) in words.zip(limits) {
                        assert!(word.unsigned_abs() <= *limit, "{word} is above {limit}");
                        assert!(word == 0 || any_armed, "moves while disarmed");
                    }
                    if flags & 2 != 0 {
                        assert!(bus.requeue(&frame));
                    }
                }
            }
        }
    }
});
