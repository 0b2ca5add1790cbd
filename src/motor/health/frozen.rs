use super::{Condition, Latch, Sample};

/// Below this share of the no-load speed a rotor moves too little between two looks to tell.
const MOVES: f32 = 0.05;
/// 100 ms, in units of 1.024 ms.
const WINDOW: u8 = 98;

/// An angle has 13 bits.
const ANGLE: u16 = 0x1FFF;

/// What the feedback was when it was looked at last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frozen {
    lasted: u8,
    /// The angle, and three bits that change with the current: by chance they do not, but not ten times in a row.
    feedback: u16,
    /// The command when the feedback became what it is.
    word: i8,
}

impl Frozen {
    pub(super) const NONE: Self = Self { lasted: 0, feedback: 0, word: 0 };

    /// Tells whether an angle is another one than when it was looked at last.
    #[inline]
    pub(super) const fn has_moved(&self, angle: u16) -> bool {
        (self.feedback ^ angle) & ANGLE != 0
    }

    /// Takes feedback that moved.
    #[inline]
    pub(super) const fn follow(&mut self, angle: u16, word: i8) {
        *self = Self { lasted: 0, feedback: angle, word };
    }

    /// Looks for feedback that stands still and cannot be true.
    ///
    /// A motor that truly stands, even one that is blocked at a constant current, may send the same bits for ever. So
    /// sameness is not enough; it has to contradict something:
    ///
    /// * the angle does not move while the reported speed says that it does, or
    /// * nothing moves, not even the current, although the command has changed by a fifth of full scale since.
    ///
    /// Without a new frame there is nothing to look at.
    pub(super) fn check(&mut self, latch: &mut Latch, sample: &Sample) {
        if !sample.fresh {
            return;
        }
        let feedback = (sample.angle & ANGLE) | (sample.rest & !ANGLE);
        let changes = feedback ^ self.feedback;
        self.feedback = feedback;
        if changes != 0 {
            self.word = sample.word;
        }
        let change = sample.word.abs_diff(self.word);
        let answers_not = changes == 0 && change >= sample.word_change;
        let contradicts = changes & ANGLE == 0 && sample.speed.abs() >= MOVES;
        let holds = answers_not || contradicts;
        self.lasted = if holds { self.lasted.saturating_add(sample.elapsed) } else { 0 };
        latch.set(Condition::Frozen, self.lasted >= WINDOW);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(frozen: &mut Frozen, angle: u16, rest: u16, effort: f32, speed: f32) -> bool {
        let mut latch = Latch::NONE;
        #[expect(clippy::cast_possible_truncation, reason = "at most 100")]
        let word = (effort * 100.0) as i8;
        let sample = Sample { angle, rest, word, speed, elapsed: 11, ..Sample::AT_REST };
        frozen.check(&mut latch, &sample);
        latch.has(Condition::Frozen)
    }

    #[test]
    fn a_true_standstill_is_not_frozen_however_long_and_however_hard_it_is_pushed() {
        for effort in [0.0, 0.04, -0.7, 1.0] {
            let mut frozen = Frozen::NONE;
            assert!((0..1_000).all(|_| !look(&mut frozen, 77, 5, effort, 0.0)));
        }
        // Blocked under a command that swings: the current answers.
        let mut frozen = Frozen::NONE;
        for step in 0..1_000_u16 {
            let effort = f32::from(step % 200) / 200.0;
            assert!(!look(&mut frozen, 77, step.wrapping_mul(0x9E37), effort, 0.0));
        }
    }

    #[test]
    fn an_angle_that_rests_while_the_speed_does_not_is_frozen_and_ends() {
        let mut frozen = Frozen::NONE;
        let looks =
            (0..20_u16).map(|step| look(&mut frozen, 77, step << 13, 0.1, -0.3)).position(|f| f);
        assert_eq!(looks, Some(9), "100 ms");
        assert!(!look(&mut frozen, 78, 0, 0.1, -0.3));
    }

    #[test]
    fn feedback_that_does_not_answer_a_change_of_the_command_is_frozen() {
        let mut frozen = Frozen::NONE;
        let mut step = |effort| look(&mut frozen, 77, 5, effort, 0.0);
        assert!((0..50).all(|_| !step(0.1)));
        let looks = (0..20).map(|_| step(0.4)).position(|frozen| frozen);
        assert_eq!(looks, Some(8));
    }
}
