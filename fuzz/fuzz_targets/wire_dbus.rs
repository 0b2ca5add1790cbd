//! Any bytes from a receiver, at any times: values in range, or neutral.
#![no_main]

use drivetrain::time::{Duration, Instant};
use drivetrain::wire::dbus::{Dbus, Remote, Switch};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut dbus = Dbus::new();
    let mut now = Instant::START;
    for piece in data.chunks(20) {
        let Some((pause, mut bytes)) = piece.split_first() else { return };
        now = now + Duration::from_micros(u64::from(*pause) * 100);
        while let Some(remote) = dbus.read(&mut bytes, now) {
            let values =
                [remote.right.x, remote.right.y, remote.left.x, remote.left.y, remote.dial];
            assert!(values.iter().all(|value| value.abs() <= 1.0));
            assert!(remote.left_switch != Switch::Absent && remote.right_switch != Switch::Absent);
        }
        assert!(bytes.is_empty());
        assert!(dbus.is_live(now) || dbus.remote(now) == Remote::default());
        let _ = dbus.edge(now);
    }
});
