//! Any frame, any time, any call: the joints keep their promises.
#![no_main]

use drivetrain::frame::CanFrame;
use drivetrain::motor::CanDevice;
use drivetrain::snake::{Command, Config, Joints, Settings};
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{ExtendedId, Frame, StandardId};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut joints = Joints::new().with_frames_per_update(2, 3);
    let attached = [1, 2, 12].map(|id| joints.attach(Config::new(id)));
    let [Ok(first), Ok(second), Ok(last)] = attached else { return };

    let mut now = 0_u64;
    for step in data.as_chunks::<14>().0 {
        let [op, flags, register, length, id, time, payload @ ..] = *step;
        // Forward, and sometimes back.
        let jump = u64::from(time) << (flags & 31);
        now = if flags & 32 == 0 { now.wrapping_add(jump) } else { now.saturating_sub(jump) };
        let at = Instant::from_micros(now);
        let bits = u32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]]);
        let value = f32::from_bits(bits);
        let joint = [first, second, last][usize::from(id) % 3];
        match op % 12 {
            // Mostly replies, sometimes anything.
            0..=3 => {
                let mut bytes = payload;
                if flags & 64 == 0 {
                    (bytes[0], bytes[1]) = (4, register % 0x12);
                }
                let length = if flags & 128 == 0 { 6 } else { usize::from(length % 9) };
                let id = u16::from(id % 16);
                let frame = match (op, StandardId::new(id), ExtendedId::new(u32::from(id))) {
                    (0..=100, Some(id), _) => CanFrame::new(id, &bytes[..length]),
                    (101..=150, Some(id), _) => CanFrame::new_remote(id, length),
                    (_, _, Some(id)) => CanFrame::new(id, &bytes[..length]),
                    _ => None,
                };
                if let Some(frame) = frame {
                    _ = joints.ingest(&frame, at);
                }
            }
            4 => {
                let turns = Angle::from_turns(value);
                _ = joints.set_position(joint, drivetrain::encoder::Position::from_angle(turns));
            }
            5 => {
                _ = joints.set_pulses(joint, bits.cast_signed());
                _ = joints.set_speed(joint, AngularVelocity::from_rad_per_s(value));
            }
            6 => _ = joints.arm(at),
            7 => match flags & 3 {
                0 => joints.emergency_stop(),
                1 => joints.clear_emergency_stop(),
                2 => joints.disarm(),
                _ => joints.relax(joint),
            },
            8 => match flags & 3 {
                0 => _ = joints.zero(joint),
                1 => {
                    _ = joints.set_settings(joint, Settings::new().with_current(bits.cast_signed()))
                }
                2 => _ = joints.answer(joint),
                _ => joints.detach(last),
            },
            _ => {
                let dt_s = if flags & 1 == 0 { 0.001 } else { value };
                joints.update(Tick::new(at, dt_s));
                let mut sent = 0;
                loop {
                    let awaited: Vec<_> = joints
                        .joints()
                        .map(|(joint, name)| (name.id(), joints.awaited(joint)))
                        .collect();
                    let Some(frame) = joints.next_frame() else { break };
                    sent += 1;
                    assert!(sent <= 12 + 2 + 3, "bounded");
                    let command = Command::decode(frame.data()).expect("a command");
                    let owes = |(id, register): &(u8, Option<_>)| {
                        u32::from(*id) == frame.header() && register.is_some()
                    };
                    assert!(!awaited.iter().any(owes), "sent while an answer is due");
                    let of =
                        joints.joints().find(|(_, name)| u32::from(name.id()) == frame.header());
                    let armed = of.is_some_and(|(joint, _)| joints.is_joint_armed(joint));
                    assert!(command.is_safe() || armed, "moves while disarmed");
                    if flags & 2 != 0 {
                        assert!(joints.requeue(&frame));
                    }
                }
            }
        }
    }
});
