//! The least squares of a run: sums of products, and their solution for each delay.

use crate::control::matrix::dot;
use crate::control::number::{Sum, Wide};

/// A pivot below this share of its own entry leaves a direction undetermined.
const LEAST_PIVOT: f32 = 1e-4;

/// The delayed effort of one lag: its value now, and its sums with everything else.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Lag {
    /// The effort that acts on the coming step.
    pub(super) effort: f32,
    /// The leaky integral of the effort.
    pub(super) integral: f32,
    square: Sum,
    with_former: Sum,
    with_common: [Sum; 3],
    with_change: Sum,
}

impl Lag {
    pub(super) const ZERO: Self = Self {
        effort: 0.0,
        integral: 0.0,
        square: Sum::ZERO,
        with_former: Sum::ZERO,
        with_common: [Sum::ZERO; 3],
        with_change: Sum::ZERO,
    };

    /// Adds the products of one sample.
    #[inline]
    pub(super) fn add(&mut self, former: f32, common: [f32; 3], change: f32) {
        let own = self.integral;
        self.square.add(own * own);
        self.with_former.add(own * former);
        for (sum, value) in self.with_common.iter_mut().zip(common) {
            sum.add(own * value);
        }
        self.with_change.add(own * change);
    }
}

/// The sums without the effort: of speed, direction and one (all integrals), and of the change of the speed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Common {
    /// Upper half of the symmetric matrix: 11, 12, 13, 22, 23, 33.
    products: [Sum; 6],
    with_change: [Sum; 3],
    square_of_change: Sum,
}

impl Common {
    pub(super) const ZERO: Self =
        Self { products: [Sum::ZERO; 6], with_change: [Sum::ZERO; 3], square_of_change: Sum::ZERO };

    #[inline]
    pub(super) fn add(&mut self, common @ [a, b, c]: [f32; 3], change: f32) {
        let products = [a * a, a * b, a * c, b * b, b * c, c * c];
        for (sum, value) in self.products.iter_mut().zip(products) {
            sum.add(value);
        }
        for (sum, value) in self.with_change.iter_mut().zip(common) {
            sum.add(value * change);
        }
        self.square_of_change.add(change * change);
    }

    /// Fits the model at the best delay; `None` when the run leaves a parameter undetermined.
    pub(super) fn fit(&self, lags: &[Lag]) -> Option<Fit> {
        let root = Factors::of(self.products.map(exact))?;
        let of_change = self.with_change.map(exact);
        let of_common = root.solve(of_change);
        let rest_of_change = exact(self.square_of_change) - dot(&of_change, &of_common);
        let mut best: Option<Fit> = None;
        let mut whole_ticks = 0.0;
        for pair in lags.windows(2) {
            let [first, second] = pair else { continue };
            let (a, b) = (first.with_common.map(exact), second.with_common.map(exact));
            let (from_a, from_b) = (root.solve(a), root.solve(b));
            let aa = exact(first.square) - dot(&a, &from_a);
            let bb = exact(second.square) - dot(&b, &from_b);
            let ab = exact(second.with_former) - dot(&b, &from_a);
            let ra = exact(first.with_change) - dot(&of_change, &from_a);
            let rb = exact(second.with_change) - dot(&of_change, &from_b);
            // Two neighbouring lags, weighted: a delay between two ticks.
            let (of_first, of_second) = (ra * bb - rb * ab, rb * aa - ra * ab);
            let share = (of_second / (of_first + of_second)).narrow();
            let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
            let (late, early) = (Wide::of(share), Wide::of(1.0) - Wide::of(share));
            let square = early * early * aa + early * late * ab * 2.0 + late * late * bb;
            let product = early * ra + late * rb;
            let gain = product / square;
            let rest = (rest_of_change - gain * product).narrow();
            let own = (first.square.value()).max(second.square.value());
            let is_sound = square.narrow() > LEAST_PIVOT * own && gain.narrow() > 0.0;
            if is_sound && best.is_none_or(|best| rest < best.rest) {
                let part = blend(from_a, early, from_b, late);
                let [speed, direction, one] = sub(of_common, part, gain);
                best = Some(Fit {
                    delay_ticks: whole_ticks + share,
                    rest,
                    gain: gain.narrow(),
                    common: [speed.narrow(), direction.narrow(), one.narrow()],
                    spread: root.spread(part.map(Wide::narrow), square.narrow()),
                    gain_spread: 1.0 / square.narrow(),
                    part: part.map(Wide::narrow),
                });
            }
            whole_ticks += 1.0;
        }
        best
    }
}

/// The solution: `change = gain effort + common [speed, direction, one]`, all of them integrals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub(super) delay_ticks: f32,
    /// The sum of the squares of what the model leaves.
    pub(super) rest: f32,
    pub(super) gain: f32,
    pub(super) common: [f32; 3],
    /// Variances, each for a rest of variance 1.
    spread: [f32; 3],
    gain_spread: f32,
    part: [f32; 3],
}

impl Fit {
    /// Returns the variance of `gain`, and of each common coefficient divided by the gain, for a rest of variance 1.
    pub(super) fn variances(&self) -> (f32, [f32; 3]) {
        let per_gain = 1.0 / self.gain;
        let mut rows = self.common.into_iter().zip(self.part);
        let of_common = self.spread.map(|spread| {
            let (value, part) = rows.next().unwrap_or_default();
            let ratio = value * per_gain;
            let covariance = -part * self.gain_spread;
            let sum = spread + ratio * ratio * self.gain_spread - 2.0 * ratio * covariance;
            sum.max(0.0) * per_gain * per_gain
        });
        (self.gain_spread, of_common)
    }
}

/// `L D Lᵀ` of a symmetric, positive matrix of three rows.
struct Factors {
    pivots: [Wide; 3],
    /// 21, 31, 32.
    lower: [Wide; 3],
}

impl Factors {
    fn of([m11, m12, m13, m22, m23, m33]: [Wide; 6]) -> Option<Self> {
        let (l21, l31) = (m12 / m11, m13 / m11);
        let d2 = m22 - l21 * m12;
        let t32 = m23 - l21 * m13;
        let l32 = t32 / d2;
        let d3 = m33 - l31 * m13 - l32 * t32;
        let is_sound = |pivot: Wide, entry: Wide| pivot.narrow() > LEAST_PIVOT * entry.narrow();
        let is_sound = m11.narrow() > 0.0 && is_sound(d2, m22) && is_sound(d3, m33);
        is_sound.then_some(Self { pivots: [m11, d2, d3], lower: [l21, l31, l32] })
    }

    fn solve(&self, [b1, b2, b3]: [Wide; 3]) -> [Wide; 3] {
        let ([d1, d2, d3], [l21, l31, l32]) = (self.pivots, self.lower);
        let y2 = b2 - l21 * b1;
        let y3 = b3 - l31 * b1 - l32 * y2;
        let x3 = y3 / d3;
        let x2 = y2 / d2 - l32 * x3;
        [b1 / d1 - l21 * x2 - l31 * x3, x2, x3]
    }

    /// Returns the diagonal of the inverse, with what the effort, of this square and this part of the common terms, adds.
    fn spread(&self, [p1, p2, p3]: [f32; 3], square: f32) -> [f32; 3] {
        let unit = |a, b, c| self.solve([Wide::of(a), Wide::of(b), Wide::of(c)]);
        let ([i1, ..], [_, i2, _], [.., i3]) =
            (unit(1.0, 0.0, 0.0), unit(0.0, 1.0, 0.0), unit(0.0, 0.0, 1.0));
        let of = |own: Wide, part: f32| own.narrow() + part * part / square;
        [of(i1, p1), of(i2, p2), of(i3, p3)]
    }
}

fn exact(sum: Sum) -> Wide {
    Wide::of(sum.value()) + sum.above(sum.value())
}

fn blend([a, b, c]: [Wide; 3], of: Wide, [x, y, z]: [Wide; 3], with: Wide) -> [Wide; 3] {
    [a * of + x * with, b * of + y * with, c * of + z * with]
}

fn sub([a, b, c]: [Wide; 3], [x, y, z]: [Wide; 3], times: Wide) -> [Wide; 3] {
    [a - x * times, b - y * times, c - z * times]
}
