//! Any bytes from a receiver, at any times and in any split: values in range, or neutral.
#![no_main]

use core::array::from_fn;
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::dbus::{Dbus, FRAME_LENGTH, Remote, Switch};
use drivetrain_fuzz::Input;
use libfuzzer_sys::fuzz_target;

/// From the documentation: a frame counts for so long.
const DEADLINE: Duration = Duration::from_millis(100);
/// And sticks that stand so near the centre are at rest.
const DEAD_BAND: f32 = 10.0;

fuzz_target!(|data: &[u8]| {
    let (mut dbus, mut split) = (Dbus::new(), Dbus::new());
    let mut now = Instant::START;
    let (mut bytes_came, mut heard) = (0, None);
    for piece in data.chunks(20) {
        let Some((pause, mut bytes)) = piece.split_first() else { return };
        now = now + Duration::from_micros(u64::from(*pause) * 100);
        bytes_came += bytes.len();
        for byte in bytes {
            let mut one = core::slice::from_ref(byte);
            while split.read(&mut one, now).is_some() {}
        }
        while let Some(remote) = dbus.read(&mut bytes, now) {
            heard = Some(now);
            let values =
                [remote.right_x, remote.right_y, remote.left_x, remote.left_y, remote.dial];
            assert!(values.iter().all(|value| value.abs() <= 1.0), "I2: {remote:?}");
            assert!(remote.left_switch != Switch::Absent && remote.right_switch != Switch::Absent);
        }
        assert!(bytes.is_empty());
        let old = heard.is_none_or(|heard| now - heard > DEADLINE);
        assert!(!old || !dbus.is_live(now), "I4: live at {now:?}, heard {heard:?}");
        assert!(dbus.is_live(now) || dbus.remote(now) == Remote::default(), "I4");
        assert_eq!(dbus.counts(), split.counts(), "I5 or I10: it depends on the split");
        assert_eq!(dbus.remote(now), split.remote(now), "I5 or I10: it depends on the split");
        assert_eq!(dbus.edge(now), split.edge(now), "I10");
        // I6: every byte was in a frame, was skipped, or waits for the end of its frame.
        let counts = dbus.counts();
        let in_frames = FRAME_LENGTH * (counts.frames + counts.content_errors) as usize;
        let waiting = bytes_came.checked_sub(in_frames + counts.skipped_bytes as usize);
        assert!(waiting.is_some_and(|waiting| waiting < FRAME_LENGTH), "I6: {counts:?}");
    }
    now = now + DEADLINE + Duration::from_micros(1);
    assert!(!dbus.is_live(now) && dbus.remote(now) == Remote::default(), "I4: live for ever");
    good_frames_are_taken(&mut dbus, now, Input(data));
});

/// What a receiver sends after a pause is taken, whatever came before.
fn good_frames_are_taken(dbus: &mut Dbus, mut now: Instant, mut input: Input) {
    let switches = [Switch::Up, Switch::Down, Switch::Middle];
    while !input.is_empty() {
        now = now + Duration::from_millis(14);
        // 1024 and up to 660 more or less.
        let channels: [u16; 5] = from_fn(|_| 364 + u16::from_le_bytes(input.bytes()) % 1_321);
        let [right, left] = from_fn(|_| usize::from(input.byte() % 3));
        let mut bits = channels[..4]
            .iter()
            .rev()
            .fold(0_u128, |bits, channel| bits << 11 | u128::from(*channel));
        bits |= (right as u128 + 1) << 44 | (left as u128 + 1) << 46;
        bits |= u128::from(input.byte() % 2) << 96 | u128::from(input.byte() % 2) << 104;
        let mut frame = [0; FRAME_LENGTH];
        frame[..16].copy_from_slice(&bits.to_le_bytes());
        frame[16..].copy_from_slice(&channels[4].to_le_bytes());
        let remote = dbus.read(&mut &frame[..], now).expect("a whole frame");
        assert_eq!((remote.right_switch, remote.left_switch), (switches[right], switches[left]));
        let shares = channels.map(|channel| {
            let counts = f32::from(channel) - 1024.0;
            (counts.abs() - DEAD_BAND).max(0.0).copysign(counts) / (660.0 - DEAD_BAND)
        });
        let values = [remote.right_x, remote.right_y, remote.left_x, remote.left_y, remote.dial];
        let near = values.iter().zip(shares).all(|(value, share)| (value - share).abs() < 1e-6);
        assert!(near && dbus.is_live(now), "{frame:02X?}: {remote:?}, not {shares:?}");
    }
}
