use crate::control::motion::task::Task;
use crate::control::number::{Wide, lesser, reach, root};
use crate::math;
use crate::math::limited;

/// In `f32`, where rounding may keep the steps from becoming close; then with the value in twice its precision, which takes one step,
/// and more where the way hardly depends on the roots. The bracket halves where a step would leave it.
const ROUGH_STEPS: u32 = 7;
const EXACT_STEPS: u32 = 16;
/// Shares of the last step. The rough share leaves a deviation near the rounding of `f32`, and the exact step removes this deviation.
const ROUGH: f32 = 1e-3;
const EXACT: f32 = 3e-5;

/// The fastest change of velocity with an acceleration of zero at both ends takes `root` of jerk twice, and `hold` between them.
///
/// ```text
/// acceleration  ____        duration = 2 root + hold
///              /    \       change = root (root + hold)
///          root hold root   root = 1 where hold > 0
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slope {
    /// The largest acceleration on the way. Negative in the first slope of a motion whose velocity falls from the start on.
    pub(super) root: f32,
    pub(super) hold: f32,
}

impl Slope {
    /// Returns the slope of a change of velocity.
    fn of(change: f32) -> Self {
        if change >= 1.0 {
            Self { root: 1.0, hold: change - 1.0 }
        } else {
            Self { root: math::quick_root(change), hold: 0.0 }
        }
    }

    const fn duration(self) -> f32 {
        2.0 * self.root + self.hold
    }

    /// Returns the way from a velocity over this slope to another.
    fn way(self, velocity: f32) -> f32 {
        self.duration() * (velocity + 0.5 * self.root * (self.root + self.hold))
    }
}

/// Three parts of a motion: two slopes, and cruising between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Curve {
    pub(super) first: Slope,
    pub(super) cruise: f32,
    pub(super) second: Slope,
}

/// All motions that go up as fast as they can, then down: from a state to a velocity, in units where acceleration and jerk end at 1.
///
/// ```text
/// velocity      crest _______
///                   /         \
///            state /           \__ exit        way of a slope = (velocity below + crest) / 2 * duration
///         entry __/                            whole way = sum of both, whole time = sum of both
/// ```
/// The state lies on a slope that began at `entry` with an acceleration of zero: it is later than the start of the slope by its acceleration, and
/// farther by a part that `way` contains. Without holding and cruising, the sum `s` of both roots gives the whole way:
/// `s³/4 + (entry + exit) s - (exit - entry)² / 4s`.
///
/// A first root below zero stands for a velocity that falls from the start on, first less steeply: the first slope is then taken
/// off instead of added, and the same formulas hold.
///
/// Of all motions of one duration, this one has the longest way, the motion that first goes down has the shortest, and each way
/// between both is possible. The fastest motion is therefore the first with the wanted way. The way falls at first if both velocities are
/// negative, then rises for ever: it passes that of a target beyond the direct motion's once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ascent {
    /// The acceleration of the state.
    acceleration: f32,
    entry: Wide,
    exit: Wide,
    /// The largest velocity.
    top: f32,
    /// From entry to exit.
    way: Wide,
    /// The square of the second root less that of the first.
    rise: f32,
}

/// Where the family begins: the direct change of velocity, and how far beyond it the target lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Beginning {
    /// The direct motion goes down from the state.
    Down(f32),
    /// The direct motion goes up to the exit.
    Up(f32),
}

impl Ascent {
    pub(super) fn of(task: &Task) -> Self {
        let entry = task.velocity - task.square;
        Self {
            acceleration: task.acceleration.narrow(),
            entry,
            exit: task.exit,
            top: task.top,
            way: task.distance + task.acceleration * (entry + task.square * Wide::THIRD),
            rise: (task.exit - entry).narrow(),
        }
    }

    /// Returns the direct motion, if it ends within rounding of the target and longer ones at first fall behind.
    ///
    /// They would then have to come back from afar. A target that is followed at its velocity is such a one.
    #[cold]
    pub(super) fn direct(&self, beginning: Beginning) -> Option<Curve> {
        let acceleration = self.acceleration;
        let total = match beginning {
            Beginning::Up(_) => Slope::of(self.rise).duration(),
            Beginning::Down(_) => {
                let change = acceleration * acceleration - self.rise;
                2.0 * acceleration + Slope::of(change).duration()
            }
        };
        let curve = self.in_total(total);
        let longer = self.in_total(total + 0.01 * (1.0 + total));
        (self.way_of(&longer) < self.way_of(&curve)).then_some(curve)
    }

    /// Returns the fastest motion over the way, which ends by `beyond` after that of the direct motion.
    pub(super) fn fastest(&self, beginning: Beginning) -> Curve {
        let way = self.way.narrow();
        let rise = self.rise;
        let gap = rise.abs();
        // The slope with the smaller root, and that with the larger one, which holds first.
        let (small, large) =
            if rise < 0.0 { (self.entry, self.exit) } else { (self.exit, self.entry) };
        let (low, high) = (small.narrow(), large.narrow());
        let border = math::quick_root(1.0 - gap);
        let start = if rise < 0.0 { self.acceleration } else { 0.0 };
        if start < 0.0 {
            if let Some(curve) = self.falling(beginning, small, large, border) {
                return curve;
            }
        }
        let crest = self.cruising(0.0);
        let left = way - self.way_of(&crest);
        if left >= 0.0 {
            return Curve { cruise: left / self.top, ..crest };
        }
        let mut from = start;
        if gap < 1.0 && start <= border {
            if way < 2.0 * high + 1.0 + border * (2.0 * low + border * border) {
                let highest = lesser(crest.first.root + crest.second.root, 1.0 + border);
                return self.rolling(beginning, start < -border, border, highest);
            }
            from = border;
        }
        if way < 2.0 * low + 1.0 + (low + high + 1.0) * (1.0 + 0.5 * gap) {
            return self.holding(small, large, from, 1.0);
        }
        self.held()
    }

    /// Returns the motion whose velocity falls from the start on, if one of them is long enough.
    ///
    /// Its way may rise, while the velocity is positive, then fall: the first one counts.
    fn falling(
        &self,
        beginning: Beginning,
        small: Wide,
        large: Wide,
        border: f32,
    ) -> Option<Curve> {
        let (way, start) = (self.way.narrow(), self.acceleration);
        let (low, high) = (small.narrow(), large.narrow());
        let gap = -self.rise;
        let holds_first = start < -border || gap >= 1.0;
        if holds_first {
            let end = -border;
            let longest = 0.25 * (-1.0 - math::quick_root(1.0 - 16.0 * low));
            let longest =
                if low < 0.0625 && longest > start && longest < end { longest } else { end };
            let crest = low + longest * longest;
            let reached = longest * (2.0 * low + longest * longest)
                + 0.5 * (crest + high) * (1.0 + crest - high);
            if reached >= way {
                return Some(self.holding(small, large, start, longest));
            }
            if gap < 1.0 && way < 2.0 * high + 1.0 - border * (2.0 * low + border * border) {
                return Some(self.holding(small, large, longest, end));
            }
        }
        if gap < 1.0 {
            let sum = low + high;
            let square = sum * sum - 0.75 * gap * gap;
            if sum < 0.0 && square > 0.0 {
                let longest =
                    math::quick_root(gap * gap / (2.0 * (math::quick_root(square) - sum)));
                let first = self.lowest(beginning, holds_first, border);
                let reached =
                    longest * (0.25 * longest * longest + sum) - 0.25 * gap * gap / longest;
                if first < longest && reached >= way {
                    return Some(self.rolling(beginning, holds_first, border, longest));
                }
            }
        }
        None
    }

    /// Without holding: the root of `s⁴/4 + (entry + exit) s² - way s - rise²/4`.
    fn rolling(&self, beginning: Beginning, is_late: bool, border: f32, highest: f32) -> Curve {
        let velocities = self.entry + self.exit;
        let rest = -(self.exit - self.entry).squared().scaled(0.25);
        let sum = velocities.narrow();
        let slope_at = |s: f32| {
            let other = if s > 0.0 { 0.5 * self.rise / s } else { 0.0 };
            0.75 * s * s + sum + other * other
        };
        let (way, end) = (self.way.narrow(), rest.narrow());
        let lowest = self.lowest(beginning, is_late, border);
        let highest = if highest > lowest { highest } else { lowest };
        let (Beginning::Up(beyond) | Beginning::Down(beyond)) = beginning;
        // Beyond `base`, where no slope is taken off, the way bends upward by `base` at least, and grows by a quarter of its cube.
        let (mut base, mut depth) = (lowest, beyond);
        if self.rise < 0.0 && self.acceleration < 0.0 {
            base = math::quick_root(-self.rise);
            depth = way - base * sum;
        }
        let mut guess = lesser(base, highest);
        if depth >= 0.0 && base < highest {
            let slope = slope_at(base);
            guess = lesser(base + reach(depth, slope, base), highest);
            if slope >= 0.0 {
                guess = lesser(base + math::cube_root(4.0 * depth), guess);
            }
        }
        let guess = root::<ROUGH_STEPS>([lowest, highest], guess, ROUGH, |s| {
            ((s * (0.25 * s * s + sum) - way) * s + end, s * slope_at(s))
        });
        let s = root::<EXACT_STEPS>([lowest, highest], guess, EXACT, |s| {
            let value = Wide::of(s).squared().scaled(0.25) + velocities;
            let value = (value * s - self.way) * s + rest;
            (value.narrow(), s * slope_at(s))
        });
        self.rolled(s)
    }

    /// Returns the sum of both roots where a motion without holding begins, which is late after a slope that holds.
    fn lowest(&self, beginning: Beginning, is_late: bool, border: f32) -> f32 {
        if is_late {
            return 1.0 - border;
        }
        let acceleration = self.acceleration;
        match beginning {
            Beginning::Up(_) => math::quick_root(self.rise),
            Beginning::Down(_) => {
                let second = math::quick_root(acceleration * acceleration - self.rise);
                if acceleration >= 0.0 {
                    acceleration + second
                } else {
                    -self.rise / (second - acceleration)
                }
            }
        }
    }

    /// Returns both slopes without holding by the sum of their roots.
    fn rolled(&self, sum: f32) -> Curve {
        let apart = if sum > 0.0 { self.rise / sum } else { 0.0 };
        let (first, second) = (0.5 * (sum + apart), 0.5 * (sum - apart));
        Curve {
            first: Slope { root: first, hold: 0.0 },
            cruise: 0.0,
            second: Slope { root: if second > 0.0 { second } else { 0.0 }, hold: 0.0 },
        }
    }

    /// One slope holds, the other rolls: its root `r` of `r⁴/2 + r³ + (low + 1/2) r² + 2 low r + (low² + low + high - high²)/2 - way`.
    fn holding(&self, small: Wide, large: Wide, from: f32, to: f32) -> Curve {
        let fixed = small.squared() - large.squared() + small + large;
        let (fixed, double) = (fixed.scaled(0.5) - self.way, small.scaled(2.0));
        let (low, top) = (small.narrow(), math::quick_root(self.top - small.narrow()));
        let to = limited(top, from, to);
        let slope_at = |r: f32| (r + 1.0) * (2.0 * r * r + r + 2.0 * low);
        let end = fixed.narrow();
        let value_at = |r: f32| (((0.5 * r + 1.0) * r + low + 0.5) * r + 2.0 * low) * r + end;
        let bend = (6.0 * from + 6.0) * from + 2.0 * low + 1.0;
        let mut guess = to;
        if from >= 0.0 && bend > 0.0 {
            guess = lesser(from + reach(-value_at(from), slope_at(from), bend), to);
        }
        let guess = root::<ROUGH_STEPS>([from, to], guess, ROUGH, |r| (value_at(r), slope_at(r)));
        let r = root::<EXACT_STEPS>([from, to], guess, EXACT, |r| {
            let value = ((Wide::of(0.5 * r) + 1.0) * r + (small + 0.5)) * r + double;
            ((value * r + fixed).narrow(), slope_at(r))
        });
        self.held_by(r)
    }

    /// Returns both slopes where the larger one holds, by the root of the smaller one.
    fn held_by(&self, root: f32) -> Curve {
        let rolls = Slope { root, hold: 0.0 };
        let hold = self.rise.abs() + root * root - 1.0;
        let holds = Slope { root: 1.0, hold: if hold > 0.0 { hold } else { 0.0 } };
        let (first, second) = if self.rise < 0.0 { (rolls, holds) } else { (holds, rolls) };
        Curve { first, cruise: 0.0, second }
    }

    /// Both slopes hold: the crest by a square root.
    fn held(&self) -> Curve {
        let fixed = self.entry + self.exit - self.entry.squared() - self.exit.squared();
        let square = self.way - fixed.scaled(0.5) + 0.25;
        let crest = square.root() - 0.5;
        let crest = if crest.narrow() < self.top { crest } else { Wide::of(self.top) };
        Curve {
            first: Slope::of((crest - self.entry).narrow()),
            cruise: 0.0,
            second: Slope::of((crest - self.exit).narrow()),
        }
    }

    /// Returns the motion that reaches the largest velocity.
    fn cruising(&self, cruise: f32) -> Curve {
        Curve {
            first: Slope::of(self.top - self.entry.narrow()),
            cruise,
            second: Slope::of(self.top - self.exit.narrow()),
        }
    }

    fn way_of(&self, curve: &Curve) -> f32 {
        curve.first.way(self.entry.narrow())
            + curve.second.way(self.exit.narrow())
            + self.top * curve.cruise
    }

    /// Returns the motion of a duration, at least the duration of the direct motion, and the way from the target to the end of the motion.
    pub(super) fn lasting(&self, duration: f32) -> (Curve, f32) {
        let total = duration + self.acceleration;
        let curve = self.in_total(total);
        (curve, self.way_of(&curve) - self.way.narrow())
    }

    fn in_total(&self, total: f32) -> Curve {
        let crest = self.cruising(0.0);
        let left = total - crest.first.duration() - crest.second.duration();
        if left >= 0.0 {
            return Curve { cruise: left, ..crest };
        }
        let gap = self.rise.abs();
        let rolled = self.rolled(0.5 * total);
        if rolled.first.root <= 1.0 && rolled.second.root <= 1.0 {
            return rolled;
        }
        let root = math::quick_root(total - gap) - 1.0;
        if root <= 1.0 {
            return self.held_by(root);
        }
        let holds = 0.5 * (total - 4.0 - gap);
        let slope = |more: f32| Slope { root: 1.0, hold: holds + more };
        let (first, second) = if self.rise < 0.0 { (0.0, gap) } else { (gap, 0.0) };
        Curve { first: slope(first), cruise: 0.0, second: slope(second) }
    }

    /// Returns the first duration after `duration` whose motion is long enough, when that of `duration` is not.
    pub(super) fn passing(&self, duration: f32, halvings: u32) -> f32 {
        let crest = self.cruising(0.0);
        let whole = crest.first.duration() + crest.second.duration() - self.acceleration;
        let cruising = if whole > duration { whole } else { duration };
        let (_, beyond) = self.lasting(cruising);
        if beyond < 0.0 {
            return cruising - beyond / self.top;
        }
        let (mut low, mut high) = (duration, cruising);
        for _ in 0..halvings {
            let middle = 0.5 * (low + high);
            if self.lasting(middle).1 < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}
