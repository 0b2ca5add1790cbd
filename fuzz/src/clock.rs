use crate::Input;

/// Time, and the clock on which the program reads it: a good one, or one of those that are found in the field.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    micros: u64,
    kind: Kind,
    readings: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Good,
    /// A timer of so many bits, passed on as it is.
    Wraps(u32),
    /// Every other reading lies so far back.
    Swings(u64),
    /// Not started, or stopped in a sleep.
    Stands(u64),
}

impl Clock {
    pub const fn new(micros: u64) -> Self {
        Self { micros, kind: Kind::Good, readings: 0 }
    }

    /// Reads the clock. Never 0, where a bus that has no frame and no update yet stands.
    pub fn read(&mut self) -> u64 {
        self.readings = self.readings.wrapping_add(1);
        let shown = match self.kind {
            Kind::Wraps(bits) => self.micros & ((1 << bits) - 1),
            Kind::Swings(by) if self.readings % 2 == 0 => self.micros.saturating_sub(by),
            Kind::Good | Kind::Swings(_) => self.micros,
            Kind::Stands(at) => at,
        };
        shown.max(1)
    }

    /// Lets a millisecond pass, on a good clock from now on.
    pub fn go_well(&mut self) -> u64 {
        self.kind = Kind::Good;
        self.go_on()
    }

    /// Lets a millisecond pass.
    pub fn go_on(&mut self) -> u64 {
        self.micros += 1_000;
        self.read()
    }

    /// Lets time pass: as a rule up to 18 ms, sometimes up to half an hour or exactly 2^32 us. The clock is set back, too, and
    /// becomes another one. Returns what it shows.
    pub fn pass(&mut self, input: &mut Input) -> u64 {
        match input.byte() {
            jump @ 0..=179 => self.micros += u64::from(jump) * 100,
            jump @ 180..=219 => self.micros += u64::from(input.byte()) << (jump - 180).min(31),
            // Once around for who keeps 32 bits of it.
            220..=223 => self.micros += 1 << 32,
            jump @ 224..=239 => {
                let back = u64::from(input.byte()) << ((jump - 224) * 2);
                self.micros = self.micros.saturating_sub(back).max(1);
            }
            240 | 241 => self.kind = Kind::Good,
            242..=246 => self.kind = Kind::Wraps(8 + u32::from(input.byte() % 25)),
            jump @ 247..=251 => {
                self.kind = Kind::Swings(u64::from(input.byte()) << ((jump - 247) * 4));
            }
            252..=255 => self.kind = Kind::Stands(self.read()),
        }
        self.read()
    }
}
