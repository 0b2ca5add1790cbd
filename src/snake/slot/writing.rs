//! Order of the writes to a joint.

use super::{ALL, Slot};
use crate::snake::{Command, Register};
use crate::time::Instant;

impl Slot {
    /// Notes a disable at `now`. With a new target, the joint is then brought up from the beginning.
    pub(in crate::snake) const fn told_to_relax(&mut self, now: Instant) {
        self.stopped = now;
        (self.pending, self.ahead) = (ALL, ALL);
    }

    /// Returns the next frame to write.
    pub(in crate::snake) fn next_write(&mut self, now: Instant) -> Command {
        if !self.driven {
            self.stopped = now;
            return Command::DISABLE;
        }
        // In turns, so that no register waits for endless changes of another.
        let first = self.pending & self.ahead;
        let waiting = if first == 0 { self.pending } else { first };
        let bit = waiting & waiting.wrapping_neg();
        self.pending &= !bit;
        self.ahead = bit.wrapping_neg() << 1;
        let register = Register::SEQUENCE.get(bit.trailing_zeros() as usize);
        let register = *register.unwrap_or(&Register::Position);
        Command::Write(register, self.value(register))
    }

    const fn value(&self, register: Register) -> i32 {
        match register {
            Register::Mode => self.settings.mode,
            Register::Current => self.settings.current,
            Register::Acceleration => self.settings.acceleration,
            Register::Deceleration => self.settings.deceleration,
            Register::Speed => self.speed,
            Register::Enable => 1,
            Register::Position | Register::ActualPosition | Register::ActualSpeed => self.target,
        }
    }

    /// Takes back a write that was not sent: its turn comes again, and then the turns of the registers behind it. Registers before it in
    /// the sequence keep their places.
    pub(in crate::snake) fn take_back(&mut self, register: Register) {
        self.ahead |= self.renew(register).wrapping_neg();
    }

    /// Marks a register for a write; returns its bit.
    pub(super) fn renew(&mut self, register: Register) -> u8 {
        let place = Register::SEQUENCE.iter().position(|other| *other == register);
        let bit = place.map_or(0, |place| 1 << place);
        self.pending |= bit;
        bit
    }
}
