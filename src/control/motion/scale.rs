use crate::control::motion::plan::MotionTarget;
use crate::control::motion::task::Task;
use crate::control::shaping::ProfileState;
use crate::control::wide::Wide;

/// The limits that a motion has, as plain numbers.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub(super) velocity: f32,
    pub(super) acceleration: f32,
    pub(super) jerk: f32,
}

/// From units of the position and seconds to those in which acceleration and jerk end at 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    acceleration: Wide,
    velocity: Wide,
    distance: Wide,
}

impl Scale {
    fn of(limits: &Limits) -> Self {
        let acceleration = Wide::reciprocal(limits.acceleration);
        let rate = acceleration * limits.jerk;
        let velocity = rate * acceleration;
        Self { acceleration, velocity, distance: velocity * rate }
    }

    fn task(&self, distance: Wide, from: &ProfileState, to: f32, top: f32) -> Task {
        let top = self.velocity.narrow() * top;
        let acceleration = self.acceleration * from.acceleration;
        Task {
            distance: self.distance * distance,
            velocity: self.velocity * from.velocity,
            acceleration,
            square: acceleration.squared().scaled(0.5),
            exit: self.velocity * to,
            top: if top < MOST_VELOCITY { top } else { MOST_VELOCITY },
        }
    }

    fn is_usual(&self) -> bool {
        let parts = [self.acceleration, self.velocity, self.distance];
        parts.iter().all(|part| (1e-30..=1e30).contains(&part.narrow()))
    }
}

/// The largest numbers that are calculated with, in the scaled units.
const MOST_VELOCITY: f32 = 1e15;
const MOST_DISTANCE: f32 = 1e30;
const MOST_ACCELERATION: f32 = 1e6;

/// Whether all powers in the calculation are within `f32`.
fn is_usual(task: &Task) -> bool {
    let sizes = [task.distance, task.velocity, task.exit, task.acceleration]
        .map(|part| part.narrow().abs());
    let [distance, velocity, exit, acceleration] = sizes;
    let is_small = distance < 1e-18 && velocity < 1e-12 && exit < 1e-12 && acceleration < 1e-6;
    let is_large = distance > MOST_DISTANCE
        || velocity > MOST_VELOCITY
        || exit > MOST_VELOCITY
        || acceleration > MOST_ACCELERATION;
    !is_small && !is_large
}

/// Returns the task in scaled units, with the limits that it is scaled by.
pub(super) fn scaled(
    distance: Wide,
    from: &ProfileState,
    to: &MotionTarget,
    limits: Limits,
) -> (Task, Limits) {
    let scale = Scale::of(&limits);
    let task = scale.task(distance, from, to.velocity, limits.velocity);
    if scale.is_usual() && is_usual(&task) {
        return (task, limits);
    }
    let limits = commensurate(distance.narrow(), from, to, limits);
    (Scale::of(&limits).task(distance, from, to.velocity, limits.velocity), limits)
}

/// Lowers a limit of acceleration that the motion comes nowhere near, or a limit of jerk that takes 1e-15 of its time, so that all
/// powers of them are within `f32`; and raises the limit of an acceleration that is beyond 10^6 times of it.
#[cold]
fn commensurate(distance: f32, from: &ProfileState, to: &MotionTarget, limits: Limits) -> Limits {
    let of_velocity = exponent(from.velocity).max(exponent(to.velocity));
    let (of_start, of_distance) = (exponent(from.acceleration), exponent(distance));
    let of_jerk = exponent(limits.jerk);
    let by_velocity = (of_jerk + of_velocity) / 2;
    let by_distance = (2 * of_jerk + of_distance) / 3;
    let reached = of_start.max(by_velocity).max(by_distance) + 8;
    let acceleration = exponent(limits.acceleration).min(reached).clamp(-40, 40).max(of_start - 18);
    let jerk = of_jerk
        .min(2 * acceleration + 48 - of_velocity)
        .min((3 * acceleration + 98 - of_distance) / 2)
        // Not `clamp`, which asserts the order of ends that are calculated.
        .max(2 * acceleration - 90)
        .min(2 * acceleration + 90)
        .max((3 * acceleration - 90) / 2)
        .min((3 * acceleration + 90) / 2);
    Limits {
        velocity: limits.velocity,
        acceleration: power_of_two(acceleration),
        jerk: power_of_two(jerk),
    }
}

/// Returns the exponent of a number; zero has the exponent of the smallest numbers.
fn exponent(x: f32) -> i32 {
    ((x.to_bits() >> 23) & 0xFF).cast_signed() - 127
}

fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits((exponent.clamp(-126, 127) + 127).cast_unsigned() << 23)
}
