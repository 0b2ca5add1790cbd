use super::{OptionalFilter, SpeedActuator, SpeedFilters};
use crate::control::pid::{Pid, PidConfig};
use crate::error::{ConfigError, check};
use crate::time::TimeStep;

/// An angle loop over a speed loop, with their filters.
///
/// ```text
/// wanted = PID(setpoint, low-pass(angle)), every n-th step
/// output = low-pass(PID(wanted, low-pass(speed)))
/// ```
/// With the angle in a unit `A`, the speed in a unit `M` and the output in a unit `U`, the gains of the angle loop are in `M/A`,
/// the gains of the speed loop in `U/M`, with the seconds of [`PidConfig`]; cut-offs are in Hz.
///
/// # Edge behaviour
/// As the [`Pid`](crate::control::Pid), for both loops. The first call gives their P and feed-forward, and by error the D of the
/// angle loop too, regardless of the age of the actuator. If `dt_s` is zero, negative, NaN or infinite, or a setpoint, angle or
/// speed is NaN or infinite, the last output is returned and [`rejected`](Self::rejected) grows; after a bad input, the next
/// values pass their filters as first values, and the D of both loops rests once. A `dt_s` above the maximum of the [`TimeStep`]
/// freezes the integral and D of both loops, and counts as the maximum for the filters. With a divider, the angle loop runs on
/// the first step and then on every n-th, with the time passed since its last run; a step above the maximum in between freezes
/// that run too. Without `ki` an integral stays zero. Huge gains end at the output limits.
///
/// # Examples
/// ```
/// use drivetrain::control::{PidConfig, PositionActuator, SpeedActuator};
/// use drivetrain::time::TimeStep;
///
/// let angle = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(4.0);
/// let speed = SpeedActuator::new(PidConfig::new(2.0, 0.0, 0.0))?;
/// let mut arm = PositionActuator::new(angle, speed)?;
/// assert_eq!(arm.step(1.0, 0.0, 1.0, &TimeStep::of(0.001)), 6.0); // 4 rad/s wanted, 1 rad/s measured
/// assert_eq!(arm.speed_setpoint(), 4.0);
/// assert_eq!(arm.with_outer_divider(0).unwrap_err().parameter(), "outer_divider");
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PositionActuator {
    filter: OptionalFilter,
    position: Pid,
    speed: Pid,
    filters: SpeedFilters,
    /// Since the last step of the angle loop.
    passed_s: f32,
    rejected: u16,
    outer_divider: u8,
    until_outer: u8,
    /// Since the last run of the angle loop, a step was above the maximum.
    froze: bool,
}

impl PositionActuator {
    /// Takes the angle loop, whose output is the setpoint of the speed loop, and the speed loop with its filters. The speed
    /// loop starts anew.
    ///
    /// # Errors
    /// Names the parameter of the angle loop as [`Pid::new`] does.
    pub const fn new(angle: PidConfig, mut speed: SpeedActuator) -> Result<Self, ConfigError> {
        speed.reset();
        match Pid::new(angle) {
            Ok(position) => Ok(Self {
                filter: OptionalFilter(None),
                position,
                speed: speed.pid,
                filters: speed.filters,
                passed_s: 0.0,
                rejected: 0,
                outer_divider: 1,
                until_outer: 0,
                froze: false,
            }),
            Err(error) => Err(error),
        }
    }

    /// Filters the measured angle with a first-order low-pass of this cut-off, more than zero. Off by default.
    ///
    /// # Errors
    /// Names `angle_filter` when the cut-off is NaN, infinite, zero or negative, and when the angle loop has a period: the mean of
    /// 359° and 1° is not 180°.
    pub const fn with_angle_filter(mut self, cutoff_hz: f32) -> Result<Self, ConfigError> {
        let is_circle = self.position.config().period() > 0.0;
        check!(ConfigError::check_conflict(is_circle, "angle_filter"));
        match OptionalFilter::new("angle_filter", cutoff_hz) {
            Ok(filter) => self.filter = filter,
            Err(error) => return Err(error),
        }
        Ok(self)
    }

    /// Runs the angle loop on every `divider`-th step only, more than zero. The default is 1.
    ///
    /// # Errors
    /// Names `outer_divider` when zero.
    pub const fn with_outer_divider(self, divider: u8) -> Result<Self, ConfigError> {
        if divider == 0 {
            return Err(ConfigError::NotPositive("outer_divider"));
        }
        Ok(Self { outer_divider: divider, ..self })
    }

    /// Steps by a validated time step, and returns the output.
    ///
    /// Costs 163 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn step(&mut self, setpoint: f32, angle: f32, speed: f32, step: &TimeStep) -> f32 {
        let finite = setpoint.is_finite() && angle.is_finite() && speed.is_finite();
        if !step.admits(finite, &mut self.rejected) {
            if !step.is_hold() {
                self.filter.reset();
                self.position.rest_derivative();
            }
            return self.miss(step);
        }
        let angle = self.filter.pass(angle, step);
        if let Some(outer) = self.outer_step(step) {
            self.position.step(setpoint, angle, &outer);
        }
        self.step_speed(speed, step)
    }

    /// Steps with a given angle error (from integers, on a circle): the measured speed is its rate.
    ///
    /// The unit of `speed` must be the unit of the angle a second, or the D of the angle loop is wrong; D acts from the first
    /// call on. The angle filter does not apply.
    pub fn step_error(&mut self, error: f32, speed: f32, step: &TimeStep) -> f32 {
        if !step.admits(error.is_finite() && speed.is_finite(), &mut self.rejected) {
            return self.miss(step); // the rate of the angle is given: none of it is missed
        }
        if let Some(outer) = self.outer_step(step) {
            self.position.step_error(error, speed, &outer);
        }
        self.step_speed(speed, step)
    }

    /// Forgets everything but the configuration and the count of rejected steps.
    pub const fn reset(&mut self) {
        self.filter.reset();
        self.position.reset();
        self.speed.reset();
        self.filters.reset();
        self.await_outer();
    }

    /// Resets, and lets the first call return `output`, as [`Pid::reset_to`](crate::control::Pid::reset_to) of the speed loop
    /// does, for any output of the angle loop: to take over from another controller without a jump.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::control::{PidConfig, PositionActuator, SpeedActuator};
    /// use drivetrain::time::TimeStep;
    ///
    /// let speed = SpeedActuator::new(PidConfig::new(2.0, 5.0, 0.0).with_output_limit(20.0))?;
    /// let angle = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(4.0);
    /// let mut arm = PositionActuator::new(angle, speed)?;
    /// arm.reset_to(3.0);
    /// assert_eq!((arm.output(), arm.step(1.0, 0.0, 0.0, &TimeStep::of(0.001))), (3.0, 3.0));
    /// # Ok::<(), drivetrain::error::ConfigError>(())
    /// ```
    pub const fn reset_to(&mut self, output: f32) {
        self.reset();
        self.speed.reset_to(output);
        self.filters.reset_to(self.speed.output());
    }

    /// Keeps the integrals of both loops over a gap in the measurements, as [`Pid::interrupt`](crate::control::Pid::interrupt) does; the
    /// next angle and the next speed pass their filters as first ones, and the angle loop runs with the next step.
    pub const fn interrupt(&mut self) {
        self.filter.reset();
        self.position.interrupt();
        self.speed.interrupt();
        self.filters.interrupt();
        self.await_outer();
    }

    /// Returns the last output.
    #[must_use]
    pub const fn output(&self) -> f32 {
        self.filters.value()
    }

    /// Returns the last output of the angle loop.
    #[must_use]
    pub const fn speed_setpoint(&self) -> f32 {
        self.position.output()
    }

    /// Returns the position loop, for its terms and its configuration.
    #[must_use]
    pub const fn position(&self) -> &Pid {
        &self.position
    }

    /// Returns the position loop, for changing its gains.
    pub const fn position_mut(&mut self) -> &mut Pid {
        &mut self.position
    }

    /// Returns the speed loop, for its terms and its configuration.
    #[must_use]
    pub const fn speed(&self) -> &Pid {
        &self.speed
    }

    /// Returns the speed loop, for changing its gains.
    pub const fn speed_mut(&mut self) -> &mut Pid {
        &mut self.speed
    }

    /// Returns the number of refused steps, and of steps too long to be integrated; stays at 65535.
    #[must_use]
    pub const fn rejected(&self) -> u16 {
        // The speed loop runs in each admitted step, and refuses none of them.
        self.rejected.saturating_add(self.speed.rejected())
    }

    /// The measured speed is too old at this step: its filter takes the next speed as a first value, and D rests.
    const fn miss(&mut self, step: &TimeStep) -> f32 {
        if !step.is_hold() {
            self.speed.rest_derivative();
        }
        self.filters.miss(step);
        self.output()
    }

    fn step_speed(&mut self, speed: f32, step: &TimeStep) -> f32 {
        let wanted = self.speed_setpoint();
        self.filters.around(&mut self.speed, wanted, speed, step)
    }

    /// Has the angle loop run with the next step.
    const fn await_outer(&mut self) {
        (self.passed_s, self.froze, self.until_outer) = (0.0, false, 0);
    }

    /// Returns the time for the angle loop in its turn.
    fn outer_step(&mut self, step: &TimeStep) -> Option<TimeStep> {
        self.passed_s += step.dt_s();
        self.froze |= step.is_frozen();
        if self.until_outer > 0 {
            self.until_outer -= 1;
            return None;
        }
        // The steps of the sum were validated: the sum is not compared with a maximum again.
        let outer = if self.froze {
            TimeStep::new(f32::MAX, self.passed_s)
        } else {
            TimeStep::new(self.passed_s, f32::MAX)
        };
        self.await_outer();
        self.until_outer = self.outer_divider - 1;
        Some(outer)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;

    const DT_S: f32 = 0.001;
    const ANGLE: PidConfig = PidConfig::new(10.0, 1.0, 0.1).with_output_limit(4.0);

    fn config() -> PositionActuator {
        PositionActuator::new(
            ANGLE,
            SpeedActuator::new(PidConfig::new(2.0, 5.0, 0.0).with_output_limit(20.0)).unwrap(),
        )
        .unwrap()
    }

    #[test]
    fn a_position_actuator_brings_an_inertia_to_its_angle_in_both_directions() {
        for target in [1.0, -1.0] {
            let mut actuator = config().with_outer_divider(2).unwrap();
            let (mut angle, mut speed) = (0.0_f32, 0.0_f32);
            let mut fastest = 0.0_f32;
            for _ in 0..3000 {
                speed += actuator.step(target, angle, speed, &TimeStep::of(DT_S)) * 20.0 * DT_S;
                angle += speed * DT_S;
                fastest = fastest.max(speed.abs());
            }
            assert!((angle - target).abs() < 0.02, "{angle}");
            assert!(fastest < 4.4, "{fastest}"); // the limit of the angle loop
        }
    }

    #[test]
    fn the_angle_loop_runs_on_every_nth_step_with_its_own_time() {
        let only_integral = PositionActuator::new(
            PidConfig::new(0.0, 1.0, 0.0),
            SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap(),
        )
        .unwrap();
        let mut actuator = only_integral.with_outer_divider(5).unwrap();
        let mut changes = 0;
        let mut last = 0.0;
        for _ in 0..=100 {
            actuator.step(1.0, 0.0, 0.0, &TimeStep::of(DT_S));
            changes += u32::from(actuator.speed_setpoint() != last);
            last = actuator.speed_setpoint();
        }
        assert_eq!(changes, 20);
        assert!((last - 0.1).abs() < 1e-5, "{last}"); // 100 ms of 1
    }

    #[test]
    fn bad_samples_and_bad_times_leave_no_trace() {
        let config = config().with_angle_filter(50.0).unwrap().with_outer_divider(3).unwrap();
        let (mut clean, mut hit) = (config, config);
        for sample in 0..20_u8 {
            let angle = f32::from(sample) * 0.1;
            let expected = clean.step(3.0, angle, 1.0, &TimeStep::of(DT_S));
            let (held, before) = (hit.output(), hit);
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                assert_eq!(hit.step(bad, angle, 1.0, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(3.0, bad, 1.0, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(3.0, angle, bad, &TimeStep::of(DT_S)), held);
                assert_eq!(hit.step(3.0, angle, 1.0, &TimeStep::of(bad)), held);
                assert_eq!(hit.step_error(bad, 1.0, &TimeStep::of(DT_S)), held);
            }
            hit = before;
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -DT_S] {
                assert_eq!(hit.step(3.0, angle, 1.0, &TimeStep::of(bad)), held);
            }
            assert_eq!(hit.step(3.0, angle, 1.0, &TimeStep::of(DT_S)), expected);
        }
        assert_eq!((hit.rejected(), PositionActuator { rejected: 0, ..hit }), (100, clean));
    }

    #[test]
    fn a_burst_of_bad_samples_of_a_moving_shaft_does_not_kick() {
        let damped = PositionActuator::new(
            PidConfig::new(0.0, 0.0, 0.05),
            SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.05))
                .unwrap()
                .with_feedback_filter(50.0)
                .unwrap(),
        )
        .unwrap();
        for config in
            [damped, damped.with_angle_filter(50.0).unwrap(), damped.with_outer_divider(3).unwrap()]
        {
            let mut actuator = config;
            let (mut angle, mut speed) = (0.0, 0.0);
            let mut most = 0.0_f32;
            for sample in 0..200_u8 {
                (angle, speed) = (angle + 10.0 * DT_S, speed + 10.0 * DT_S);
                let bad = (100..150).contains(&sample);
                actuator.step(0.0, if bad { f32::NAN } else { angle }, speed, &TimeStep::of(DT_S));
                for pid in [actuator.position(), actuator.speed()] {
                    most = most.max(pid.terms().d.abs());
                }
            }
            assert!(most < 0.51, "{most}");
        }
    }

    #[test]
    fn a_positive_kd_of_the_angle_loop_damps_by_way_of_the_error_too() {
        let damper = PositionActuator::new(
            PidConfig::new(0.0, 0.0, 1.0),
            SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap(),
        )
        .unwrap();
        let mut actuator = damper;
        for speed in [2.0, -2.0] {
            actuator.step_error(0.0, speed, &TimeStep::of(DT_S)); // on the first call too
            assert_eq!(actuator.speed_setpoint(), -speed);
        }
        actuator.reset();
        assert_eq!(actuator.step(0.0, 2.0, 0.0, &TimeStep::of(DT_S)), 0.0); // by angles, there is no travel yet
    }

    #[test]
    fn taking_over_starts_from_the_last_output() {
        for divider in [1, 3] {
            let speed =
                SpeedActuator::new(PidConfig::new(2.0, 5.0, 0.0).with_output_limit(20.0)).unwrap();
            for speed in
                [speed, speed.with_output_filter(50.0).unwrap().with_feedback_filter(50.0).unwrap()]
            {
                let mut actuator = PositionActuator::new(ANGLE, speed)
                    .unwrap()
                    .with_outer_divider(divider)
                    .unwrap();
                for _ in 0..20 {
                    actuator.step(1.0, 0.0, 0.0, &TimeStep::of(DT_S));
                }
                actuator.reset_to(3.0);
                assert_eq!((actuator.output(), actuator.speed_setpoint()), (3.0, 0.0));
                assert!((actuator.step(0.5, 0.2, 0.1, &TimeStep::of(DT_S)) - 3.0).abs() < 1e-5);
                assert!((actuator.step(0.5, 0.2, 0.1, &TimeStep::of(DT_S)) - 3.0).abs() < 0.05);
                actuator.reset_to(100.0);
                assert_eq!(actuator.output(), 20.0);
                actuator.reset_to(f32::NAN);
                assert_eq!(actuator.output(), 0.0);
            }
        }
    }

    #[test]
    fn an_interruption_keeps_both_integrals_and_kicks_neither_d_nor_a_filter() {
        let speed = SpeedActuator::new(PidConfig::new(2.0, 5.0, 0.5))
            .unwrap()
            .with_feedback_filter(5.0)
            .unwrap();
        let mut actuator = PositionActuator::new(PidConfig::new(1.0, 1.0, 0.1), speed)
            .unwrap()
            .with_angle_filter(5.0)
            .unwrap()
            .with_outer_divider(4)
            .unwrap();
        for _ in 0..10 {
            actuator.step(1.0, 0.0, 0.0, &TimeStep::of(DT_S));
        }
        let integrals = |actuator: &PositionActuator| {
            (actuator.position().terms().i, actuator.speed().terms().i)
        };
        let before = integrals(&actuator);
        assert!(before.0 > 0.0 && before.1 > 0.0);
        actuator.interrupt();
        actuator.step(1.0, 0.7, 0.4, &TimeStep::of(DT_S));
        assert_eq!(integrals(&actuator), before);
        let (position, speed) = (actuator.position().terms(), actuator.speed().terms());
        assert_eq!((position.d, speed.d), (0.0, 0.0));
        // The angle loop ran at once, and both filters let the values through.
        assert!(
            (position.p - 0.3).abs() < 1e-6
                && (speed.p - 2.0 * (actuator.speed_setpoint() - 0.4)).abs() < 1e-6
        );
    }

    #[test]
    fn a_step_that_was_validated_with_another_maximum_counts_in_full() {
        let integral = PidConfig::new(0.0, 1.0, 0.0);
        let speed = SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap();
        for divider in [1, 2, 5] {
            let mut actuator = PositionActuator::new(integral, speed)
                .unwrap()
                .with_outer_divider(divider)
                .unwrap();
            let step = TimeStep::new(0.5, 1.0);
            for _ in 0..=20 {
                actuator.step(1.0, 0.0, 0.0, &step);
            }
            assert_eq!(actuator.speed_setpoint(), 10.0, "{divider}"); // 20 steps of 0.5 s
        }
    }

    #[test]
    fn a_bad_error_or_speed_keeps_the_given_rate_of_the_angle() {
        let damper = SpeedActuator::new(PidConfig::new(1.0, 0.0, 0.0)).unwrap();
        let config = PositionActuator::new(PidConfig::new(0.0, 0.0, 1.0), damper).unwrap();
        let mut actuator = config;
        actuator.step_error(0.0, 2.0, &TimeStep::of(DT_S));
        actuator.step_error(f32::NAN, 2.0, &TimeStep::of(DT_S));
        actuator.step_error(0.0, f32::NAN, &TimeStep::of(DT_S));
        actuator.step_error(0.0, 5.0, &TimeStep::of(DT_S));
        assert_eq!(actuator.position().terms().d, -5.0); // and not that of two steps ago
        // By angles, the travel since the last good sample spans more than one step: D keeps its
        // value once.
        let mut actuator = config;
        actuator.step(0.0, 0.0, 0.0, &TimeStep::of(DT_S));
        actuator.step(0.0, 0.002, 0.0, &TimeStep::of(DT_S));
        actuator.step(0.0, f32::NAN, 0.0, &TimeStep::of(DT_S));
        actuator.step(0.0, 0.5, 0.0, &TimeStep::of(DT_S));
        assert!((actuator.position().terms().d + 2.0).abs() < 1e-5);
    }

    #[test]
    fn reset_forgets() {
        let mut actuator = config();
        for _ in 0..10 {
            actuator.step(1.0, 0.0, 0.0, &TimeStep::of(DT_S));
        }
        actuator.reset();
        assert_eq!(actuator, config());
    }

    const POSITION: PidConfig = PidConfig::new(10.0, 1.0, 0.1).with_output_limit(4.0);
    const SPEED: PidConfig = PidConfig::new(2.0, 5.0, 0.0).with_output_limit(20.0);

    fn by_error(position: PidConfig, speed: PidConfig) -> Result<PositionActuator, ConfigError> {
        PositionActuator::new(position, SpeedActuator::new(speed)?)
    }

    #[test]
    fn an_interruption_keeps_both_integrals_and_a_reset_neither() {
        let mut actuator = by_error(POSITION, SPEED).unwrap();
        for _ in 0..10 {
            actuator.step_error(0.1, 0.0, &TimeStep::of(0.001));
        }
        let terms = (actuator.position().terms().i, actuator.speed().terms().i);
        assert!(terms.0 > 0.0 && terms.1 > 0.0);
        actuator.interrupt();
        actuator.step_error(0.1, 0.5, &TimeStep::of(0.001));
        assert_eq!((actuator.position().terms().i, actuator.speed().terms().i), terms);
        actuator.reset();
        assert_eq!(actuator, by_error(POSITION, SPEED).unwrap());
    }

    #[test]
    fn the_position_loop_damps_from_the_first_call_on() {
        let mut actuator = by_error(POSITION, SPEED).unwrap();
        actuator.step_error(0.1, 2.0, &TimeStep::of(0.001));
        assert_eq!((actuator.position().terms().d, actuator.speed().terms().d), (-0.2, 0.0));
    }

    #[test]
    fn new_gains_of_one_loop_move_neither() {
        let mut actuator = by_error(POSITION, SPEED).unwrap();
        let step = TimeStep::of(0.001);
        actuator.step_error(0.1, 0.0, &step);
        let before = actuator.step_error(0.1, 0.0, &step);
        actuator.speed_mut().set_gains(3.0, 5.0, 0.0).unwrap();
        actuator.position_mut().set_gains(12.0, 1.0, 0.1).unwrap();
        assert!((actuator.step_error(0.1, 0.0, &step) - before).abs() < 0.02);
    }

    #[test]
    fn the_invalid_loop_is_named_by_its_parameter() {
        let wrong = PidConfig::new(1.0, -1.0, 0.0);
        assert_eq!(by_error(wrong, SPEED).unwrap_err().parameter(), "ki");
        assert_eq!(by_error(POSITION, wrong).unwrap_err().parameter(), "ki");
    }
}
