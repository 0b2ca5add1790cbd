/// After a trip, nobody may have asked for so long.
const PAUSE_US: u64 = 100_000;

/// When a request to arm counts, apart from the crate: always before the first trip since the last arming, otherwise when the
/// last request or trip lies 100 ms back.
#[derive(Debug, Default, Clone, Copy)]
pub struct Gesture {
    tripped: bool,
    last: u64,
    granted: bool,
}

impl Gesture {
    pub fn trip(&mut self, now: u64) {
        (self.tripped, self.last, self.granted) = (true, now, false);
    }

    /// Notes a request; tells whether it counts.
    pub fn ask(&mut self, now: u64) -> bool {
        self.granted = !self.tripped || now.checked_sub(self.last) >= Some(PAUSE_US);
        self.last = now;
        self.granted
    }

    /// Notes that the last request was granted; it has to be one that counts.
    pub fn grant(&mut self) {
        assert!(self.granted, "armed without a new request: {self:?}");
        self.tripped = false;
    }
}
