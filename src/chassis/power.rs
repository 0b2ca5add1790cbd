use super::not_negative;
use crate::error::ConfigError;
use crate::math::sqrt;
use crate::units::AngularVelocity;

/// The electric power of a motor: `P = k0 + k1 torque speed + k2 torque^2 + k3 speed^2`, in W.
///
/// The load of a wheel is the torque at its shaft, in N m or in the measure to which the model was fitted, such as a current in A, and its
/// speed in rad/s, of the same sign when driving, of the other when braking. With the torque in N m at the same shaft as the speed, `k1` is 1: the mechanical power. `k2` is the heat in the
/// winding, `k3` the friction and iron loss, `k0` the power of the electronics. Fit the coefficients to the motors in
/// use, for example by [`PowerFit`].
///
/// # Examples
/// ```
/// use drivetrain::{chassis::PowerModel, units::AngularVelocity};
///
/// let model = PowerModel::new(1.0, 1.0, 2.0, 0.001)?;
/// let load = (2.0, AngularVelocity::from_rad_per_s(10.0));
/// assert!((model.power_w(load) - (1.0 + 20.0 + 8.0 + 0.1)).abs() < 1e-5);
///
/// let mechanical = PowerModel::new(0.0, 1.0, 0.0, 0.0)?;
/// assert_eq!(mechanical.power_w((-2.0, AngularVelocity::from_rad_per_s(30.0))), -60.0); // fed back
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Stored"))]
pub struct PowerModel {
    k0: f32,
    k1: f32,
    k2: f32,
    k3: f32,
}

/// The coefficients as stored in a file, where they may have been changed.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "PowerModel")]
struct Stored {
    k0: f32,
    k1: f32,
    k2: f32,
    k3: f32,
}

#[cfg(feature = "serde")]
impl TryFrom<Stored> for PowerModel {
    type Error = ConfigError;

    fn try_from(Stored { k0, k1, k2, k3 }: Stored) -> Result<Self, ConfigError> {
        Self::new(k0, k1, k2, k3)
    }
}

impl PowerModel {
    /// Takes the four coefficients, in W, W per torque and rad/s, W per torque squared, W per (rad/s)².
    ///
    /// # Errors
    /// Names the coefficient that is not finite and zero or more.
    pub fn new(k0: f32, k1: f32, k2: f32, k3: f32) -> Result<Self, ConfigError> {
        Ok(Self {
            k0: not_negative(k0, "k0")?,
            k1: not_negative(k1, "k1")?,
            k2: not_negative(k2, "k2")?,
            k3: not_negative(k3, "k3")?,
        })
    }

    /// Returns the power of one wheel in W; negative when the wheel feeds back more than its losses.
    #[must_use]
    pub const fn power_w(&self, load: (f32, AngularVelocity)) -> f32 {
        let (torque, speed) = load;
        let speed_rad_s = speed.as_rad_per_s();
        self.k0
            + self.k1 * torque * speed_rad_s
            + self.k2 * torque * torque
            + self.k3 * speed_rad_s * speed_rad_s
    }

    /// Returns the largest common factor of all torques, 0 to 1, with the total power within `limit_w`, and the expected
    /// total power at this factor in W.
    ///
    /// If the losses alone are above the limit, the returned power is above the limit, and the least possible. The total is a parabola in the factor, and the factor is its exact root. Equal wheels stay equal, and a braking
    /// wheel's power counts for the others. A limit below zero or NaN counts as zero, and an infinite limit cuts nothing. If
    /// a load is NaN or infinite, the factor is zero.
    ///
    /// Costs 208 instructions on a Cortex-M4F, for four wheels (`docs/figures.md`).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::{chassis::PowerModel, units::AngularVelocity};
    ///
    /// let model = PowerModel::new(0.0, 1.0, 2.0, 0.0)?;
    /// let wheel = (2.0, AngularVelocity::from_rad_per_s(6.0)); // 12 W and 8 W of heat
    /// let (scale, power_w) = model.cut([wheel; 4], 32.0); // 48 s + 32 s^2 = 32
    /// assert!((scale - 0.5).abs() < 1e-6 && power_w <= 32.0);
    ///
    /// let model = PowerModel::new(5.0, 1.0, 2.0, 0.0)?;
    /// let stalled = (3.0, AngularVelocity::ZERO);
    /// assert_eq!(model.cut([stalled; 4], 10.0), (0.0, 20.0)); // the electronics alone take 20 W
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    #[must_use]
    pub fn cut(
        &self,
        wheels: impl IntoIterator<Item = (f32, AngularVelocity)>,
        limit_w: f32,
    ) -> (f32, f32) {
        let limit_w = if limit_w > 0.0 { limit_w } else { 0.0 };
        let (mut square, mut linear, mut fixed) = (0.0_f32, 0.0_f32, 0.0_f32);
        for (torque, speed) in wheels {
            let speed_rad_s = speed.as_rad_per_s();
            square += self.k2 * torque * torque;
            linear += self.k1 * torque * speed_rad_s;
            fixed += self.k0 + self.k3 * speed_rad_s * speed_rad_s;
        }
        let total = |scale: f32| fixed + scale * (linear + scale * square);
        if !total(1.0).is_finite() {
            return (0.0, fixed);
        }
        let scale =
            if total(1.0) <= limit_w { 1.0 } else { largest_root(square, linear, fixed - limit_w) };
        let power_w = total(scale);
        // The root is exact to the rounding of the sums there.
        let rounding = 1e-5 * (fixed + scale * (linear.abs() + scale * square));
        (scale, if power_w <= limit_w + rounding { power_w.min(limit_w) } else { power_w })
    }
}

/// The largest `s` in 0..=1 with `square s^2 + linear s + rest <= 0`, given a value above zero at 1; without any, the
/// `s` of the least value. `square` is zero or more.
fn largest_root(square: f32, linear: f32, rest: f32) -> f32 {
    // The squares of large loads overflow; above zero at 1, one of the three is not zero.
    let most = square.max(linear.abs()).max(rest.abs());
    let (square, linear, rest) = (square / most, linear / most, rest / most);
    let discriminant = linear * linear - 4.0 * square * rest;
    let scale = if rest > 0.0 && (linear >= 0.0 || discriminant < 0.0) {
        // Never low enough: the bottom of the parabola, at or below zero when nothing is fed back.
        if linear < 0.0 && square > 0.0 { -0.5 * linear / square } else { 0.0 }
    } else if linear > 0.0 {
        // The usual formula would cancel.
        -2.0 * rest / (linear + sqrt(discriminant))
    } else if square > 0.0 {
        (-linear + sqrt(discriminant)) / (2.0 * square)
    } else {
        1.0
    };
    // In this form NaN becomes zero.
    if scale >= 1.0 {
        1.0
    } else if scale > 0.0 {
        scale
    } else {
        0.0
    }
}

/// Fits the losses of a [`PowerModel`] to measured power while driving, by recursive least squares.
///
/// `k1` is kept; `k0`, `k2` and `k3` are fitted to the measured total of all wheels. Old measurements are forgotten
/// with the given factor each step, but only in so far as new ones say the same: an hour of standing still
/// forgets nothing of the heat in the windings. A fitted coefficient below zero is noise, and reads as zero.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{PowerFit, PowerModel}, units::AngularVelocity};
///
/// let truth = PowerModel::new(1.0, 1.0, 2.0, 0.01)?;
/// let mut fit = PowerFit::new(PowerModel::new(0.0, 1.0, 1.0, 0.0)?, 0.999);
/// for step in 0..2000_u16 {
///     let wheel = (f32::from(step % 7), AngularVelocity::from_rad_per_s(f32::from(step % 50)));
///     fit.learn([wheel; 4], 4.0 * truth.power_w(wheel));
/// }
/// let load = (3.0, AngularVelocity::from_rad_per_s(25.0));
/// assert!((fit.model().power_w(load) - truth.power_w(load)).abs() < 0.05);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerFit {
    k1: f32,
    /// k0, k2, k3, each divided by its scale.
    losses: [f32; 3],
    covariance: [[f32; 3]; 3],
    forgetting: f32,
    rejected: u16,
}

/// Brings the regressors to the same size: a wheel's electronics, 1 torque squared, (30 rad/s)².
const SCALES: [f32; 3] = [1.0, 1.0, 1e-3];
/// How uncertain each coefficient is at first, and at most.
const UNCERTAIN: f32 = 100.0;
/// A sum of squares of the regressors below this teaches nothing.
const TEACHES: f32 = 1e-3;

impl PowerFit {
    /// Takes the model to start from, and the forgetting factor: 1 never forgets, 0.999 forgets in about 1000 steps.
    /// Values outside 0.9..=1, and NaN, count as 1.
    #[must_use]
    pub fn new(start: PowerModel, forgetting: f32) -> Self {
        let [s0, s2, s3] = SCALES;
        Self {
            k1: start.k1,
            losses: [start.k0 / s0, start.k2 / s2, start.k3 / s3],
            covariance: [[UNCERTAIN, 0.0, 0.0], [0.0, UNCERTAIN, 0.0], [0.0, 0.0, UNCERTAIN]],
            forgetting: if (0.9..=1.0).contains(&forgetting) { forgetting } else { 1.0 },
            rejected: 0,
        }
    }

    /// Learns from the loads of all wheels and the power in W measured with them; leaves out and counts values that are
    /// not finite, or make the fit so.
    pub fn learn(
        &mut self,
        wheels: impl IntoIterator<Item = (f32, AngularVelocity)>,
        measured_w: f32,
    ) {
        let (mut features, mut rest_w) = ([0.0_f32; 3], measured_w);
        for (torque, speed) in wheels {
            let speed_rad_s = speed.as_rad_per_s();
            rest_w -= self.k1 * torque * speed_rad_s;
            features = add(features, [1.0, torque * torque, speed_rad_s * speed_rad_s]);
        }
        let mut scales = SCALES.into_iter();
        let features = features.map(|feature| feature * scales.next().unwrap_or(0.0));
        let gain = self.covariance.map(|row| dot(row, features));
        let (square, spread) = (dot(features, features), dot(features, gain));
        if !(rest_w.is_finite() && square.is_finite() && spread.is_finite()) {
            self.rejected = self.rejected.saturating_add(1);
            return;
        }
        if square < TEACHES || spread <= 0.0 {
            return;
        }
        let error = rest_w - dot(features, self.losses);
        let losses = add(self.losses, gain.map(|part| part * error / (1.0 + spread)));
        // NaN would stay for ever, and read as a motor without losses.
        if losses.iter().all(|loss| loss.is_finite()) {
            self.losses = losses;
            self.shrink(gain, spread);
        } else {
            self.rejected = self.rejected.saturating_add(1);
        }
    }

    /// Subtracts the learned part from the uncertainty, and forgets in the learned direction only (Kulhavy 1987): a
    /// direction without excitation keeps its certainty for ever.
    fn shrink(&mut self, gain: [f32; 3], spread: f32) {
        let new = self.forgetting - (1.0 - self.forgetting) / spread;
        let factor = new / (1.0 + new * spread);
        let mut gains = gain.into_iter();
        let learned = self.covariance.map(|row| {
            let own = gains.next().unwrap_or(0.0);
            // In this order the matrix stays symmetric to the last bit.
            add(row, gain.map(|part| -(own * part) * factor))
        });
        let [[a, _, _], [_, b, _], [_, _, c]] = learned;
        let sound = |value: f32| value > 0.0 && value <= UNCERTAIN;
        if sound(a) && sound(b) && sound(c) {
            self.covariance = learned;
        }
    }

    /// Returns the model as fitted so far.
    #[must_use]
    pub fn model(&self) -> PowerModel {
        let [k0, k2, k3] = self.losses.map(|loss| if loss > 0.0 { loss } else { 0.0 });
        let [s0, s2, s3] = SCALES;
        PowerModel { k0: k0 * s0, k1: self.k1, k2: k2 * s2, k3: k3 * s3 }
    }

    /// Returns the number of measurements left out.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

fn dot([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    a * x + b * y + c * z
}

fn add([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [a + x, b + y, c + z]
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "zero and one are exact")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn model() -> PowerModel {
        PowerModel::new(1.0, 1.0, 2.0, 0.001).unwrap()
    }

    fn load(torque: f32, speed_rad_s: f32) -> (f32, AngularVelocity) {
        (torque, AngularVelocity::from_rad_per_s(speed_rad_s))
    }

    #[test]
    fn enough_power_cuts_nothing() {
        let (scale, power_w) = model().cut([load(1.0, 10.0); 4], 100.0);
        assert_eq!(scale, 1.0);
        assert!((power_w - 4.0 * 13.1).abs() < 1e-3);
    }

    #[test]
    fn too_little_power_is_used_to_the_limit() {
        let (_, power_w) =
            model().cut([load(3.0, 40.0), load(2.5, 41.0), load(3.0, 39.0), load(2.0, 44.0)], 80.0);
        assert!(power_w <= 80.0 && power_w > 79.999, "{power_w}");
    }

    // XRobot scales each wheel by its own root: equal wheels come out unequal. One factor cannot.
    #[test]
    fn at_limit_zero_and_standing_still_everything_is_finite() {
        for wheels in
            [[load(3.0, 0.0); 4], [load(0.0, 0.0); 4], [load(-3.0, 50.0); 4], [load(3.0, 50.0); 4]]
        {
            for limit in [0.0, -5.0, f32::NAN] {
                let (scale, power_w) = model().cut(wheels, limit);
                assert!((0.0..=1.0).contains(&scale) && power_w.is_finite(), "{scale} {power_w}");
            }
        }
        assert_eq!(model().cut([load(3.0, 0.0); 4], 0.0).0, 0.0);
        assert_eq!(model().cut([load(3.0, 0.0); 4], 4.0).0, 0.0); // the electronics take it all
    }

    #[test]
    fn a_negative_discriminant_gives_the_least_power() {
        // 4 W electronics, braking by 2 W, 8 W heat: 4 - 2 s + 8 s^2 is never 0; the bottom lies at 1/8.
        let model = PowerModel::new(4.0, 1.0, 8.0, 0.0).unwrap();
        let (scale, power_w) = model.cut([load(1.0, -2.0)], 0.0);
        assert!((scale - 0.125).abs() < 1e-6 && power_w > 0.0, "{scale} {power_w}");
    }

    #[test]
    fn braking_pays_for_losses_that_are_above_the_limit() {
        // 10 W electronics, limit 8 W, braking by 6 W, 1 W heat: 10 - 6 s + s^2 <= 8 from 0.354 on.
        let model = PowerModel::new(10.0, 1.0, 1.0, 0.0).unwrap();
        assert_eq!(model.cut([load(1.0, -6.0)], 8.0).0, 1.0);
        // With 16 W of heat too much torque is as bad as too little: 10 - 12 s + 16 s^2 <= 8 up to
        // 0.5.
        let model = PowerModel::new(10.0, 1.0, 16.0, 0.0).unwrap();
        let (scale, power_w) = model.cut([load(1.0, -12.0)], 8.0);
        assert!((scale - 0.5).abs() < 1e-6 && power_w <= 8.0, "{scale} {power_w}");
    }

    // The loads passed whole: the discriminant overflowed.
    #[test]
    fn loads_whose_squares_overflow_are_cut_to_the_root_all_the_same() {
        let model = PowerModel::new(1000.0, 1.0, 1.0, 0.0).unwrap();
        let (scale, _) = model.cut([load(1e10, -3e9)], 80.0); // 1000 - 3e19 s + 1e20 s^2
        assert!((scale - 0.3).abs() < 1e-6, "{scale}");
    }

    // The power counted as within: the slack for rounding was calculated from the loads before the
    // cut.
    #[test]
    fn losses_above_the_limit_are_not_called_within_because_the_loads_are_large() {
        let (scale, power_w) = model().cut([load(1e6, 1e3)], 80.0);
        assert!(scale == 0.0 && power_w > 1000.0, "{scale} {power_w}");
    }

    #[test]
    fn a_load_of_nan_cuts_everything() {
        assert_eq!(model().cut([load(f32::NAN, 1.0), load(1.0, 1.0)], 50.0).0, 0.0);
        assert_eq!(model().cut([load(1.0, f32::INFINITY)], 50.0).0, 0.0);
        assert_eq!(model().cut([load(1e30, 1.0)], 50.0).0, 0.0);
    }

    #[test]
    fn a_coefficient_that_is_negative_or_nan_is_named() {
        assert_eq!(PowerModel::new(0.0, 1.0, -1.0, 0.0), Err(ConfigError::Negative("k2")));
        assert_eq!(PowerModel::new(f32::NAN, 1.0, 1.0, 0.0), Err(ConfigError::Negative("k0")));
    }

    proptest! {
        #[test]
        fn the_power_after_cutting_is_within_the_limit_and_no_more_is_cut_than_needed(
            loads in proptest::collection::vec((-5.0_f32..5.0, -60.0_f32..60.0), 1..9), limit in -100.0_f32..300.0,
            (k0, k1, k2, k3) in (0.0_f32..5.0, 0.0_f32..2.0, 0.0_f32..3.0, 0.0_f32..0.01)
        ) {
            // Half of the wheels brake; a limit below zero counts as zero.
            let loads = loads.into_iter().map(|(torque, speed)| load(torque, speed));
            let (factor, power_w) = PowerModel::new(k0, k1, k2, k3).unwrap().cut(loads.clone(), limit);
            prop_assert!((0.0..=1.0).contains(&factor) && power_w.is_finite(), "{factor} {power_w}");
            let is_within = power_w <= limit.max(0.0);
            let [k0, k1, k2, k3] = [k0, k1, k2, k3].map(f64::from);
            let total = |scale: f32| -> f64 {
                loads.clone().map(|wheel| {
                    let (torque, speed) = wheel;
                    let (t, w) = (f64::from(torque * scale), f64::from(speed.as_rad_per_s()));
                    k0 + k1 * t * w + k2 * t * t + k3 * w * w
                }).sum()
            };
            let limit = f64::from(limit.max(0.0));
            if is_within {
                prop_assert!(total(factor) <= limit + 1e-3, "{factor} {}", total(factor));
                if factor < 0.999 {
                    prop_assert!(total(factor + 1e-3) > limit - 1e-3);
                }
            } else {
                for step in 0..=100_u8 {
                    prop_assert!(total(f32::from(step) * 0.01) >= total(factor) - 1e-3);
                }
            }
        }
    }

    fn start() -> PowerFit {
        PowerFit::new(PowerModel::new(0.0, 1.0, 1.0, 0.0).unwrap(), 0.999)
    }

    /// A drive of changing torque and speed, with noise of ±`noise` W.
    fn drive(fit: &mut PowerFit, truth: PowerModel, noise: f32, steps: u16) {
        let mut state = 12_345_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 8_388_608.0 - 1.0
        };
        for _ in 0..steps {
            let load = (3.0 * random(), AngularVelocity::from_rad_per_s(50.0 * random()));
            fit.learn([load; 4], 4.0 * truth.power_w(load) + noise * random());
        }
    }

    fn near(fit: &PowerFit, truth: PowerModel, relative: f32) {
        let model = fit.model();
        let pairs = [(model.k0, truth.k0), (model.k2, truth.k2), (model.k3, truth.k3)];
        for (is, should) in pairs {
            assert!((is - should).abs() <= relative * should, "{model:?}, expected {truth:?}");
        }
    }

    #[test]
    fn the_losses_are_found_with_noise_and_followed_when_they_change() {
        let mut fit = start();
        let cold = PowerModel::new(1.5, 1.0, 1.8, 0.004).unwrap();
        drive(&mut fit, cold, 2.0, 5_000);
        near(&fit, cold, 0.05);
        let hot = PowerModel::new(1.5, 1.0, 2.4, 0.004).unwrap();
        drive(&mut fit, hot, 2.0, 10_000);
        near(&fit, hot, 0.1);
    }

    #[test]
    fn an_hour_of_standing_still_forgets_nothing_and_grows_nothing() {
        let mut fit = start();
        let truth = PowerModel::new(1.5, 1.0, 1.8, 0.004).unwrap();
        drive(&mut fit, truth, 0.0, 5_000);
        for _ in 0..3_600_000 / 36 {
            fit.learn([(0.0, AngularVelocity::ZERO); 4], 6.0);
        }
        near(&fit, truth, 0.02);
        assert!(fit.covariance.as_flattened().iter().all(|value| value.abs() <= UNCERTAIN));
    }

    #[test]
    fn measurements_that_are_not_finite_are_counted_and_left_out() {
        let mut fit = start();
        let before = fit.model();
        fit.learn([(f32::NAN, AngularVelocity::ZERO)], 1.0);
        fit.learn([(1.0, AngularVelocity::from_rad_per_s(1.0))], f32::INFINITY);
        fit.learn([(1e30, AngularVelocity::ZERO)], 1.0);
        assert_eq!((fit.model(), fit.rejected()), (before, 3));
    }
    // One such reading made a model of NaN, read as no losses: the power limit passed everything
    // for ever.
    #[test]
    fn readings_beyond_all_numbers_leave_a_finite_model() {
        let mut fit = start();
        for (torque, speed_rad_s, measured_w) in
            [(1.0, 1.0, 3e38), (1.0, 2.0, -3e38), (2.0, 1.0, -3e38), (1e8, 1.0, 3e38)]
        {
            fit.learn([(torque, AngularVelocity::from_rad_per_s(speed_rad_s)); 4], measured_w);
            assert!(fit.losses.iter().all(|loss| loss.is_finite()), "{fit:?}");
        }
        assert!(fit.rejected() > 0);
    }
}
