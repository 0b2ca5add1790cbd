use super::{Condition, Latch, Sample, Timer};

/// Below this share of the no-load speed a rotor moves too little between two looks to tell.
const MOVES: f32 = 0.05;
/// The change of the command that a current has to follow.
const CHANGE: f32 = 0.2;
/// 100 ms, in units of 1.024 ms.
const WINDOW: u16 = 98;

/// What the feedback was when it was looked at last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frozen {
    timer: Timer,
    angle: u16,
    rest: u16,
    /// The command when the feedback became what it is, in 100ths of full scale.
    effort: i8,
}

impl Frozen {
    pub(super) const NONE: Self = Self { timer: Timer::ZERO, angle: u16::MAX, rest: 0, effort: 0 };

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
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let effort = (sample.effort * 100.0) as i8;
        let same_angle = sample.angle == self.angle;
        let same = same_angle && sample.rest == self.rest;
        if !same {
            self.effort = effort;
        }
        let answers_not = same && f32::from(effort.abs_diff(self.effort)) >= 100.0 * CHANGE;
        let contradicts = same_angle && sample.speed.abs() >= MOVES;
        (self.angle, self.rest) = (sample.angle, sample.rest);
        let lasted = self.timer.run(answers_not || contradicts, sample.elapsed);
        latch.set(Condition::Frozen, lasted >= WINDOW);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(frozen: &mut Frozen, angle: u16, rest: u16, effort: f32, speed: f32) -> bool {
        let mut latch = Latch::NONE;
        let sample = Sample { angle, rest, effort, speed, elapsed: 11, ..Sample::AT_REST };
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
            assert!(!look(&mut frozen, 77, step % 200, effort, 0.0));
        }
    }

    #[test]
    fn an_angle_that_rests_while_the_speed_does_not_is_frozen_and_ends() {
        let mut frozen = Frozen::NONE;
        let looks = (0..20_u16).map(|step| look(&mut frozen, 77, step, 0.1, -0.3)).position(|f| f);
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
