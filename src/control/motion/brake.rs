use crate::control::motion::task::Task;
use crate::control::wide::Wide;

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
