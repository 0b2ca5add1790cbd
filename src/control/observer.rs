use super::number::finite;
use crate::error::{ConfigError, check, positive};
use crate::time::TimeStep;

/// Estimates speed and load torque of a motor from its feedback: an extended-state observer (Luenberger).
///
/// The model is a shaft with the inertia `J`, driven by the torque `τ` of the motor and by a load `L` that is constant:
///
/// ```text
/// J ω' = τ + L,   L' = 0           ω: rad/s at the output shaft, τ and L: Nm there, J: kg m²
///
/// predict   ω += (τ + L) dt / J            τ: mean of this feedback and the one before
/// correct   r  = measured - ω
///           ω += (1 - p²) r                p = 1 / (1 + w dt), the double pole of the error
///           L += (1 - p)² J / dt r         w: bandwidth in rad/s
/// ```
///
/// The load is every torque except the motor's own: friction, weight, a push, a blocked shaft. A positive load turns the shaft
/// counter-clockwise, as a positive torque does; friction of a motor that turns counter-clockwise is negative. Since the model
/// knows the torque of the motor, the speed has no lag while the motor accelerates its own inertia; a [`LowPass`](super::LowPass)
/// of the same noise has.
///
/// # Bandwidth
/// | bandwidth, at 1 kHz | noise of the speed, of the measured one | 80 % of a load step | noise of the load, per rad/s of noise and kg m² |
/// |--:|--:|--:|--:|
/// | 100 rad/s | 34 % | 31 ms | 15 Nm |
/// | 200 rad/s | 46 % | 16 ms | 39 Nm |
/// | 400 rad/s | 60 % | 9 ms | 96 Nm |
///
/// The figures are those of white noise; the time does not contain the age of the feedback. An inertia that is twice the true one
/// makes a step of the load twice as large for the first milliseconds, and has no lasting effect: at constant speed and torque, the
/// load is minus the torque for any inertia.
///
/// # Edge behaviour
/// The first feedback sets the speed, and the load is zero. If a value is NaN or infinite, or `dt_s` is not a positive finite
/// number, nothing changes and [`rejected`](Self::rejected) grows. If `dt_s` exceeds [`TimeStep::MAX_S`], the speed becomes the
/// measured one and the load stays. Every `dt_s` up to that is stable, because `p` stays between 0 and 1.
///
/// Feedback that is repeated counts as a measurement: call `update` only with new feedback, and pass the time since the feedback
/// before. A loop that ticks as often as the motor reports (1 kHz for DJI motors) may pass the time of its tick.
///
/// # Examples
/// The gravity of an arm, found while a motor holds it still with 2 Nm:
/// ```
/// use drivetrain::control::LoadObserver;
///
/// const ARM: LoadObserver = match LoadObserver::new(0.05, 200.0) {
///     Ok(observer) => observer,
///     Err(_) => panic!("not an observer"), // in a constant, a bad parameter does not compile
/// };
/// let mut arm = ARM;
/// for _ in 0..50 {
///     arm.update(0.0, 2.0, 0.001); // rad/s, Nm, s
/// }
/// assert!((arm.load_nm() + 2.0).abs() < 0.01); // -2 Nm
/// assert!(arm.velocity_rad_per_s().abs() < 0.001);
/// ```
///
/// Source: the double pole is the "fading memory" filter of second order (E. Brookner, *Tracking and Kalman Filtering Made Easy*,
/// section 1.2.6); gains by one bandwidth: Z. Gao, "Scaling and bandwidth-parameterization based controller tuning" (2003).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoadObserver {
    inertia_kg_m2: f32,
    bandwidth_rad_per_s: f32,
    velocity: f32,
    load_nm: f32,
    torque_nm: f32,
    rejected: u16,
    started: bool,
}

impl LoadObserver {
    /// Takes the inertia in kg m² that the output shaft turns, gearbox and rotor included, and the bandwidth in rad/s.
    ///
    /// # Errors
    /// Names `inertia` or `bandwidth` when it is zero, negative, NaN or infinite.
    pub const fn new(inertia_kg_m2: f32, bandwidth_rad_per_s: f32) -> Result<Self, ConfigError> {
        check!(positive("inertia", inertia_kg_m2));
        check!(positive("bandwidth", bandwidth_rad_per_s));
        Ok(Self {
            inertia_kg_m2,
            bandwidth_rad_per_s,
            velocity: 0.0,
            load_nm: 0.0,
            torque_nm: 0.0,
            rejected: 0,
            started: false,
        })
    }

    /// Takes one feedback: the measured speed in rad/s and the torque of the motor in Nm, both of the output shaft, and the
    /// seconds since the feedback before.
    ///
    /// Costs 88 instructions on a Cortex-M4F (`docs/figures.md`).
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::LoadObserver;
    ///
    /// let mut wheel = LoadObserver::new(0.01, 200.0)?;
    /// wheel.update(1.0, 0.0, 0.001); // the first feedback sets the speed
    /// wheel.update(1.2, 0.0, 0.001); // p = 1 / 1.2: 1 - p² = 30.6 % of 0.2 rad/s, (1 - p)² = 2.8 % of 200 rad/s² times J
    /// assert!((wheel.velocity_rad_per_s() - 1.0611).abs() < 1e-4);
    /// assert!((wheel.load_nm() - 0.0556).abs() < 1e-4);
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn update(&mut self, velocity_rad_per_s: f32, torque_nm: f32, dt_s: f32) {
        let step = TimeStep::of(dt_s);
        let are_finite = velocity_rad_per_s.is_finite() && torque_nm.is_finite();
        if !step.admits(are_finite, &mut self.rejected) {
            return;
        }
        let mean_nm = 0.5 * self.torque_nm + 0.5 * torque_nm;
        self.torque_nm = torque_nm;
        if !self.started || step.is_frozen() {
            self.started = true;
            self.velocity = velocity_rad_per_s;
            return;
        }
        let (w, dt_s) = (self.bandwidth_rad_per_s, step.dt_s());
        let pole = 1.0 / (1.0 + w * dt_s);
        let predicted =
            finite(self.velocity + (mean_nm + self.load_nm) * (dt_s / self.inertia_kg_m2));
        let residual = finite(velocity_rad_per_s - predicted);
        self.velocity = finite(predicted + (1.0 - pole * pole) * residual);
        // (1 - p) / dt is w p, which needs no division and has no loss for short steps.
        let rate = w * pole * (1.0 - pole);
        self.load_nm = finite(self.load_nm + finite(self.inertia_kg_m2 * rate) * residual);
    }

    /// Sets the speed in rad/s, with a load and a torque of zero. NaN and infinity count as no speed: the next feedback sets it.
    pub const fn reset_to(&mut self, velocity_rad_per_s: f32) {
        self.started = velocity_rad_per_s.is_finite();
        self.velocity = if self.started { velocity_rad_per_s } else { 0.0 };
        self.load_nm = 0.0;
        self.torque_nm = 0.0;
    }

    /// Returns the estimated speed of the output shaft in rad/s; counter-clockwise is positive.
    #[must_use]
    pub const fn velocity_rad_per_s(&self) -> f32 {
        self.velocity
    }

    /// Returns the estimated load at the output shaft in Nm; a positive one turns it counter-clockwise.
    #[must_use]
    pub const fn load_nm(&self) -> f32 {
        self.load_nm
    }

    /// Returns the number of updates that were refused; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        self.rejected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const INERTIA: f32 = 0.008;

    fn observer(bandwidth: f32) -> LoadObserver {
        LoadObserver::new(INERTIA, bandwidth).unwrap()
    }

    /// Uniform within ±1, without pattern: xorshift.
    struct Noise(u32);

    impl Noise {
        fn next(&mut self) -> f32 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 17;
            self.0 ^= self.0 << 5;
            self.0 as f32 / (u32::MAX / 2) as f32 - 1.0
        }
    }

    fn deviation(values: &[f32]) -> f32 {
        let count = values.len() as f32;
        let mean = values.iter().sum::<f32>() / count;
        (values.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / count).sqrt()
    }

    /// Bandwidth, share of the noise, time of 80 % of a step of the load, noise of the load: the table of the documentation.
    const TABLE: [(f32, f32, usize, f32); 3] =
        [(100.0, 0.34, 31, 14.7), (200.0, 0.46, 16, 38.8), (400.0, 0.60, 9, 96.2)];

    #[test]
    fn the_table_of_bandwidths_holds() {
        for (bandwidth, share, _, load) in TABLE {
            let (mut observer, mut noise) = (observer(bandwidth), Noise(0x5EED));
            let (mut raw, mut speeds, mut loads) = (Vec::new(), Vec::new(), Vec::new());
            for step in 0..40_000 {
                let measured = noise.next();
                observer.update(measured, 0.0, 0.001);
                if step >= 1_000 {
                    raw.push(measured);
                    speeds.push(observer.velocity_rad_per_s());
                    loads.push(observer.load_nm() / INERTIA);
                }
            }
            let of_speed = deviation(&speeds) / deviation(&raw);
            let of_load = deviation(&loads) / deviation(&raw);
            assert!((of_speed - share).abs() < 0.01, "{bandwidth}: {of_speed}");
            assert!((of_load / load - 1.0).abs() < 0.03, "{bandwidth}: {of_load}");
        }
        for (bandwidth, _, millis, _) in TABLE {
            for load in [1.0, -1.0] {
                let mut observer = observer(bandwidth);
                observer.reset_to(0.0);
                let mut velocity = 0.0;
                let mut told = 0;
                while observer.load_nm() * load < 0.8 {
                    velocity += load / INERTIA * 0.001;
                    observer.update(velocity, 0.0, 0.001);
                    told += 1;
                    assert!(told < 100);
                }
                assert_eq!(told, millis, "{bandwidth}");
            }
        }
    }

    #[test]
    fn a_torque_that_the_model_knows_is_followed_without_lag_and_makes_no_load() {
        let mut observer = observer(50.0);
        let (mut velocity, mut before) = (0.0, 0.0);
        observer.update(0.0, 0.0, 0.001);
        for step in 0..400 {
            let torque = if step % 100 < 50 { 0.5 } else { -0.4 };
            velocity += (before + torque) / 2.0 / INERTIA * 0.001;
            before = torque;
            observer.update(velocity, torque, 0.001);
            assert!((observer.velocity_rad_per_s() - velocity).abs() < 1e-3, "{step}");
            assert!(observer.load_nm().abs() < 1e-4, "{step}");
        }
    }

    #[test]
    fn at_a_constant_speed_the_load_is_minus_the_torque_whatever_the_inertia() {
        for inertia in [0.1 * INERTIA, INERTIA, 10.0 * INERTIA] {
            let mut observer = LoadObserver::new(inertia, 200.0).unwrap();
            for _ in 0..200 {
                observer.update(-30.0, 0.7, 0.001);
            }
            assert!((observer.load_nm() + 0.7).abs() < 1e-3, "{}", observer.load_nm());
            assert!((observer.velocity_rad_per_s() + 30.0).abs() < 1e-3);
        }
    }

    #[test]
    fn a_pause_takes_the_speed_over_and_keeps_the_load() {
        let mut observer = observer(200.0);
        for _ in 0..200 {
            observer.update(0.0, 0.5, 0.001);
        }
        let load = observer.load_nm();
        observer.update(25.0, 0.5, 3.0);
        assert_eq!((observer.velocity_rad_per_s(), observer.load_nm()), (25.0, load));
        observer.reset_to(f32::NAN);
        observer.update(7.0, 0.0, 0.001);
        assert_eq!((observer.velocity_rad_per_s(), observer.load_nm()), (7.0, 0.0));
    }

    #[test]
    fn parameters_that_cannot_work_are_named() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(LoadObserver::new(bad, 200.0), Err(ConfigError::NotPositive("inertia")));
            assert_eq!(LoadObserver::new(1.0, bad), Err(ConfigError::NotPositive("bandwidth")));
        }
    }

    proptest! {
        #[test]
        fn bad_feedback_and_bad_time_change_nothing_but_the_count(
            bad in prop::sample::select(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY][..]), which in 0..3,
        ) {
            let mut observer = observer(200.0);
            observer.update(1.0, 0.1, 0.001);
            observer.update(1.1, 0.1, 0.001);
            let before = observer;
            match which {
                0 => observer.update(bad, 0.1, 0.001),
                1 => observer.update(1.0, bad, 0.001),
                _ => observer.update(1.0, 0.1, bad),
            }
            prop_assert_eq!(observer, LoadObserver { rejected: 1, ..before });
        }

        #[test]
        fn no_feedback_and_no_time_makes_it_infinite(
            inertia in 1e-38_f32..3e38, bandwidth in 1e-38_f32..3e38,
            feedback in prop::collection::vec((any::<f32>(), any::<f32>(), 1e-6_f32..0.2), 1..20),
        ) {
            let mut observer = LoadObserver::new(inertia, bandwidth).unwrap();
            for (velocity, torque, dt_s) in feedback {
                observer.update(velocity, torque, dt_s);
                prop_assert!(observer.velocity_rad_per_s().is_finite() && observer.load_nm().is_finite());
            }
        }

        #[test]
        fn it_settles_at_every_step_that_it_takes(dt_s in 1e-5_f32..0.1, bandwidth in 1.0_f32..2_000.0) {
            let mut observer = observer(bandwidth);
            observer.update(0.0, 0.3, dt_s);
            for _ in 0..100_000 {
                observer.update(5.0, 0.3, dt_s);
                if (observer.velocity_rad_per_s() - 5.0).abs() < 1e-2 && (observer.load_nm() + 0.3).abs() < 1e-2 {
                    return Ok(());
                }
            }
            prop_assert!(false, "{:?}", observer);
        }
    }
}
