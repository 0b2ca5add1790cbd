/// After a trip, nobody may have asked for so long.
const PAUSE_US: u64 = 100_000;
/// A gap between two updates counts for no more: who stalls did not release the switch.
const LONGEST_STEP_US: u64 = 20_000;

/// When a request to arm counts, apart from the crate: always before the first trip since the last arming, otherwise after
/// 100 ms of updates without a request, a trip or a clock that did not move on.
#[derive(Debug, Default, Clone, Copy)]
pub struct Gesture {
    tripped: bool,
    quiet_us: u64,
    granted: bool,
}

impl Gesture {
    pub fn trip(&mut self) {
        (self.tripped, self.quiet_us, self.granted) = (true, 0, false);
    }

    /// Notes an update: by how much time moved on, if it did.
    pub fn update(&mut self, step_us: Option<u64>) {
        self.quiet_us = step_us.map_or(0, |step| self.quiet_us + step.min(LONGEST_STEP_US));
    }

    /// Notes a request; tells whether it counts.
    pub fn ask(&mut self) -> bool {
        self.granted = !self.tripped || self.quiet_us >= PAUSE_US;
        self.quiet_us = 0;
        self.granted
    }

    /// Notes that the last request was granted; it has to be one that counts. The trip stays where another motor waits.
    pub fn grant(&mut self, another_waits: bool) {
        assert!(self.granted, "armed without a new request: {self:?}");
        (self.tripped, self.granted) = (another_waits, !another_waits);
    }
}
