use crate::control::motion::End;
use crate::control::number::Wide;
use crate::control::shaping::ProfileState;

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

/// The limits that a motion has, as plain numbers.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub(super) velocity: f32,
    pub(super) acceleration: f32,
    pub(super) jerk: f32,
}

/// From units of the position and seconds to those in which acceleration and jerk end at 1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scale {
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
    to: &End,
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
fn commensurate(distance: f32, from: &ProfileState, to: &End, limits: Limits) -> Limits {
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

/// Brings a state that is outside of the limits, or will be whatever is done, back inside: with full jerk, then without.
///
/// The rules are those of Ruckig (Berscheid and Kröger, 2021): an acceleration beyond its limit falls to it first; a velocity beyond
/// its limit, or that will be when the acceleration has fallen to zero, is braked with all that the limits allow.
#[derive(Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct Brake {
    /// 1 or -1, for as long as `jerk_time`.
    jerk: f32,
    jerk_time: Wide,
    hold_time: Wide,
}

impl Brake {
    const NONE: Self = Self { jerk: 0.0, jerk_time: Wide::ZERO, hold_time: Wide::ZERO };

    const fn new(jerk_time: Wide, hold_time: Wide) -> Self {
        Self { jerk: -1.0, jerk_time: jerk_time.positive(), hold_time: hold_time.positive() }
    }

    /// Returns how a task has to begin.
    pub(super) fn of(task: &Task) -> Self {
        if needs_braking(task) {
            return Self::down(task);
        }
        let mirrored = task.mirrored();
        if needs_braking(&mirrored) {
            return Self { jerk: 1.0, ..Self::down(&mirrored) };
        }
        Self::NONE
    }

    #[cold]
    fn down(task: &Task) -> Self {
        let (velocity, acceleration) = (task.velocity, task.acceleration);
        let half = task.square;
        if acceleration.narrow() <= 1.0 || (velocity + half - task.top).narrow() > 0.0 {
            return Self::of_velocity(velocity, acceleration, half, task.top);
        }
        let until = acceleration - 1.0;
        let then = velocity + half - 0.5;
        Self::new(until, (-(then + task.top)).lesser(-then + (task.top - 0.5)))
    }

    /// Until the velocity is at the largest one, or would be at the lowest one when the acceleration has risen to zero.
    fn of_velocity(velocity: Wide, acceleration: Wide, half: Wide, top: f32) -> Self {
        let to_top = acceleration + (velocity + half - top).scaled(2.0).root();
        let to_bottom = acceleration + (velocity + half + top).root();
        let (until, to_limit) = (acceleration + 1.0, to_top.lesser(to_bottom));
        if (to_limit - until).narrow() <= 0.0 {
            return Self::new(to_limit, Wide::ZERO);
        }
        let then = velocity + half - 0.5;
        Self::new(until, (then - top).lesser(then + (top - 0.5)))
    }

    /// Returns the jerk and its time, and the time without jerk that follows.
    pub(super) const fn parts(&self) -> (f32, f32, f32) {
        (self.jerk, self.jerk_time.narrow(), self.hold_time.narrow())
    }

    /// Returns what is left of a task after braking.
    pub(super) fn after(&self, task: Task) -> Task {
        if self.jerk == 0.0 {
            return task;
        }
        let task = advanced(task, self.jerk, self.jerk_time);
        advanced(task, 0.0, self.hold_time)
    }
}

/// Whether the velocity is beyond its largest, and will be for a while, or will have to be; or whether the acceleration is.
fn needs_braking(task: &Task) -> bool {
    let (velocity, acceleration) = (task.velocity.narrow(), task.acceleration.narrow());
    let change = 0.5 * acceleration * acceleration;
    let is_outside = velocity > task.top && velocity - change > -task.top;
    let will_be = acceleration > 0.0 && velocity + change > task.top;
    acceleration > 1.0 || (acceleration >= -1.0 && (is_outside || will_be))
}

#[cold]
fn advanced(task: Task, jerk: f32, time: Wide) -> Task {
    let change = time * jerk;
    let acceleration = task.acceleration + change;
    let half = change.scaled(0.5);
    let velocity = task.velocity + (task.acceleration + half) * time;
    let mean = task.velocity + (task.acceleration.scaled(0.5) + half * Wide::THIRD) * time;
    let square = acceleration.squared().scaled(0.5);
    Task { distance: task.distance - mean * time, velocity, acceleration, square, ..task }
}
