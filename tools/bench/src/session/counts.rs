//! Counts of a session, by name.

use super::Session;

impl Session {
    /// Counts of the runner and of the DJI bus, by name.
    pub(crate) fn counts(&mut self) -> Vec<(&'static str, u64)> {
        let (s, bus) = (self.runner.statistics(), self.runner.device().counters());
        let counts = [
            ("received", s.received),
            ("taken", s.taken),
            ("unrelated", s.unrelated),
            ("malformed", s.malformed),
            ("receive_errors", s.receive_errors.total()),
            ("bad_length", bus.bad_length),
            ("bad_field", bus.bad_field),
            ("unattached", bus.unattached),
            ("packed", bus.packed),
            ("superseded", s.superseded),
            ("offered", s.offered),
            ("sent", s.sent),
            ("refused", s.refused),
            ("send_errors", s.send_errors.total()),
            ("bus_losses", s.bus_losses),
        ];
        counts.map(|(name, count)| (name, count.into())).into()
    }

    /// Errors of receiving and sending, by the kinds of `embedded-can`.
    pub(crate) fn errors(&mut self) -> Vec<(&'static str, u64)> {
        let statistics = self.runner.statistics();
        let (heard, sent) = (statistics.receive_errors, statistics.send_errors);
        let kinds = [
            ("overrun", heard.overrun, sent.overrun),
            ("bit", heard.bit, sent.bit),
            ("stuff", heard.stuff, sent.stuff),
            ("crc", heard.crc, sent.crc),
            ("form", heard.form, sent.form),
            ("acknowledge", heard.acknowledge, sent.acknowledge),
            ("other", heard.other, sent.other),
        ];
        kinds.map(|(name, heard, sent)| (name, u64::from(heard) + u64::from(sent))).into()
    }
}
