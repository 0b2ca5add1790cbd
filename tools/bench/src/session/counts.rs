//! Counts of a session, by name.

use super::Session;
use embedded_can::ErrorKind;

impl Session {
    /// Counts of the runner and of the DJI bus, by name.
    pub(crate) fn counts(&mut self) -> Vec<(&'static str, u64)> {
        let (s, bus) = (self.runner.statistics(), self.runner.device().counters());
        let counts = [
            ("received", s.received),
            ("taken", s.taken),
            ("unrelated", s.unrelated),
            ("malformed", s.malformed),
            ("receive_errors", s.receive_errors()),
            ("bad_length", bus.bad_length),
            ("bad_field", bus.bad_field),
            ("unattached", bus.unattached),
            ("packed", bus.packed),
            ("superseded", s.superseded),
            ("offered", s.offered),
            ("sent", s.sent),
            ("refused", s.refused),
            ("send_errors", s.send_errors()),
            ("bus_losses", s.bus_losses),
        ];
        counts.map(|(name, count)| (name, count.into())).into()
    }

    /// Errors of receiving and sending, by the kinds of `embedded-can`.
    pub(crate) fn errors(&mut self) -> Vec<(&'static str, u64)> {
        let statistics = self.runner.statistics();
        let kinds = [
            ("overrun", ErrorKind::Overrun),
            ("bit", ErrorKind::Bit),
            ("stuff", ErrorKind::Stuff),
            ("crc", ErrorKind::Crc),
            ("form", ErrorKind::Form),
            ("acknowledge", ErrorKind::Acknowledge),
            ("other", ErrorKind::Other),
        ];
        let count = |kind| {
            u64::from(statistics.receive_errors_of(kind))
                + u64::from(statistics.send_errors_of(kind))
        };
        kinds.map(|(name, kind)| (name, count(kind))).into()
    }
}
