use super::{PowerModel, WheelLoad};

/// Fits the losses of a [`PowerModel`] to measured power while driving, by recursive least squares.
///
/// `k1` is kept; `k0`, `k2` and `k3` are fitted to the measured total of all wheels. Old measurements are forgotten
/// with the given factor each step, but only in so far as new ones say the same: an hour of standing still
/// forgets nothing of the heat in the windings. A fitted coefficient below zero is noise, and reads as zero.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{PowerFit, PowerModel, WheelLoad};
///
/// let truth = PowerModel::new(1.0, 1.0, 2.0, 0.01)?;
/// let mut fit = PowerFit::new(PowerModel::new(0.0, 1.0, 1.0, 0.0)?, 0.999);
/// for step in 0..2000_u16 {
///     let wheel = WheelLoad { torque: f32::from(step % 7), speed_rad_s: f32::from(step % 50) };
///     fit.learn([wheel; 4], 4.0 * truth.power_w(wheel));
/// }
/// let load = WheelLoad { torque: 3.0, speed_rad_s: 25.0 };
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
    pub fn learn(&mut self, wheels: impl IntoIterator<Item = WheelLoad>, measured_w: f32) {
        let (mut features, mut rest_w) = ([0.0_f32; 3], measured_w);
        for WheelLoad { torque, speed_rad_s } in wheels {
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
mod tests {
    use super::*;

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
            let load = WheelLoad { torque: 3.0 * random(), speed_rad_s: 50.0 * random() };
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
            fit.learn([WheelLoad::default(); 4], 6.0);
        }
        near(&fit, truth, 0.02);
        assert!(fit.covariance.as_flattened().iter().all(|value| value.abs() <= UNCERTAIN));
    }

    #[test]
    fn measurements_that_are_not_finite_are_counted_and_left_out() {
        let mut fit = start();
        let before = fit.model();
        fit.learn([WheelLoad { torque: f32::NAN, speed_rad_s: 0.0 }], 1.0);
        fit.learn([WheelLoad { torque: 1.0, speed_rad_s: 1.0 }], f32::INFINITY);
        fit.learn([WheelLoad { torque: 1e30, speed_rad_s: 0.0 }], 1.0);
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
            fit.learn([WheelLoad { torque, speed_rad_s }; 4], measured_w);
            assert!(fit.losses.iter().all(|loss| loss.is_finite()), "{fit:?}");
        }
        assert!(fit.rejected() > 0);
    }
}
