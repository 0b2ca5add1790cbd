use crate::control::wide::Wide;

/// A state, a target and the largest velocity, in units where acceleration and jerk end at 1.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Task {
    pub(super) distance: Wide,
    pub(super) velocity: Wide,
    pub(super) acceleration: Wide,
    /// Half of the square of the acceleration.
    pub(super) square: Wide,
    pub(super) exit: Wide,
    pub(super) top: f32,
}

impl Task {
    /// Returns the task in the mirror.
    pub(super) fn mirrored(self) -> Self {
        Self {
            distance: -self.distance,
            velocity: -self.velocity,
            acceleration: -self.acceleration,
            exit: -self.exit,
            ..self
        }
    }

    /// Whether the direct change of velocity goes down.
    pub(super) fn falls(&self) -> bool {
        let is_rising = self.acceleration.narrow() > 0.0;
        let rest =
            if is_rising { self.velocity + self.square } else { self.velocity - self.square };
        (rest - self.exit).narrow() >= 0.0
    }

    /// Returns how far the target lies beyond the end of the direct change of velocity, which has to go down.
    pub(super) fn beyond(&self) -> Wide {
        let crest = self.velocity + self.square;
        let change = crest - self.exit;
        let duration =
            if change.narrow() >= 1.0 { change + 1.0 } else { change.root().scaled(2.0) };
        let slope = (crest + self.exit).scaled(0.5) * duration;
        self.distance - slope - self.acceleration * (crest - self.square * Wide::THIRD)
    }
}
