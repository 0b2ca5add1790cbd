use crate::control::pid::{Pid, PidConfig};
use crate::error::ConfigError;
use crate::time::TimeStep;

/// A position loop over a speed loop: the position error becomes a velocity, and the velocity an effort.
///
/// ```text
/// error, velocity -> PID -> velocity wanted -+
///                                            +-> PID -> output
/// velocity ----------------------------------+
/// ```
/// Errors are formed elsewhere: from integers, or on a circle. The measured velocity is the rate of the position loop, so a
/// positive `kd` damps, and its output limit is the speed limit. A [`PositionActuator`](super::PositionActuator) is this with filters.
///
/// # Edge behaviour
/// As the [`Pid`], loop by loop: on the first call, the position loop gives P and D, since the rate is given, and the speed
/// loop P. If the error is NaN or infinite, the wanted velocity is held; if the velocity is NaN or infinite, or the step on
/// hold, the output is held; each loop counts its refused inputs. A frozen step freezes the integral and D of both. After a
/// bad velocity, the D of the speed loop rests in the next good step.
///
/// # Examples
/// ```
/// use drivetrain::control::{Cascade, PidConfig};
/// use drivetrain::time::TimeStep;
///
/// // 10 rad/s per rad, at most 4 rad/s; 2 A per rad/s.
/// let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(4.0);
/// let mut arm = Cascade::new(position, PidConfig::new(2.0, 0.0, 0.0))?;
/// let step = TimeStep::of(0.001);
/// assert_eq!(arm.step(1.0, 1.0, &step), 6.0); // 4 rad/s wanted, 1 rad/s measured
/// assert_eq!(arm.speed_mut().step(1.5, 1.0, &step), 1.0); // the speed loop alone
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cascade {
    speed: Pid,
    position: Pid,
}

impl Cascade {
    /// Takes the position loop, whose output is the setpoint of the speed loop, and the speed loop.
    ///
    /// # Errors
    /// Names the parameter of a loop as [`Pid::new`] does.
    pub const fn new(position: PidConfig, speed: PidConfig) -> Result<Self, ConfigError> {
        match (Pid::new(position), Pid::new(speed)) {
            (Ok(position), Ok(speed)) => Ok(Self { speed, position }),
            (Err(error), _) | (_, Err(error)) => Err(error),
        }
    }

    pub(super) const fn of(position: Pid, speed: Pid) -> Self {
        Self { speed, position }
    }

    /// Steps both loops and returns the output.
    ///
    /// Costs 64 instructions on a Cortex-M4F (`docs/figures.md`).
    #[inline]
    pub fn step(&mut self, error: f32, velocity: f32, step: &TimeStep) -> f32 {
        let wanted = self.position.step_error(error, velocity, step);
        self.speed.step(wanted, velocity, step)
    }

    /// Resets both loops: see [`Pid::reset`].
    pub const fn reset(&mut self) {
        self.position.reset();
        self.speed.reset();
    }

    /// Keeps the integrals of both loops over a gap in the measurements: see [`Pid::interrupt`].
    pub const fn interrupt(&mut self) {
        self.position.interrupt();
        self.speed.interrupt();
    }

    /// Returns the last output.
    #[must_use]
    #[inline]
    pub const fn output(&self) -> f32 {
        self.speed.output()
    }

    /// Returns the position loop, for its terms and its output.
    #[must_use]
    #[inline]
    pub const fn position(&self) -> &Pid {
        &self.position
    }

    /// Returns the position loop: to step it alone, to change its gains, to take over from another controller.
    #[inline]
    pub const fn position_mut(&mut self) -> &mut Pid {
        &mut self.position
    }

    /// Returns the speed loop, for its terms and its output.
    #[must_use]
    #[inline]
    pub const fn speed(&self) -> &Pid {
        &self.speed
    }

    /// Returns the speed loop: to step it alone, to change its gains, to take over from another controller.
    #[inline]
    pub const fn speed_mut(&mut self) -> &mut Pid {
        &mut self.speed
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact results are the rule under test")]
mod tests {
    use super::*;

    const POSITION: PidConfig = PidConfig::new(10.0, 1.0, 0.1).with_output_limit(4.0);
    const SPEED: PidConfig = PidConfig::new(2.0, 5.0, 0.0).with_output_limit(20.0);

    #[test]
    fn a_cascade_equals_one_loop_after_the_other() {
        let mut cascade = Cascade::new(POSITION, SPEED).unwrap();
        let (mut position, mut speed) = (Pid::new(POSITION).unwrap(), Pid::new(SPEED).unwrap());
        for sample in 0..50_u8 {
            let (error, velocity) = (1.0 - 0.02 * f32::from(sample), 0.1 * f32::from(sample));
            let step = TimeStep::of(if sample == 20 { 10.0 } else { 0.001 });
            let wanted = position.step_error(error, velocity, &step);
            let expected = speed.step(wanted, velocity, &step);
            assert_eq!(cascade.step(error, velocity, &step), expected);
        }
        assert_eq!((cascade.position(), cascade.speed()), (&position, &speed));
    }

    #[test]
    fn an_interruption_keeps_both_integrals_and_a_reset_neither() {
        let mut cascade = Cascade::new(POSITION, SPEED).unwrap();
        for _ in 0..10 {
            cascade.step(0.1, 0.0, &TimeStep::of(0.001));
        }
        let terms = (cascade.position().terms().i, cascade.speed().terms().i);
        assert!(terms.0 > 0.0 && terms.1 > 0.0);
        cascade.interrupt();
        cascade.step(0.1, 0.5, &TimeStep::of(0.001));
        assert_eq!((cascade.position().terms().i, cascade.speed().terms().i), terms);
        cascade.reset();
        assert_eq!(cascade, Cascade::new(POSITION, SPEED).unwrap());
    }

    #[test]
    fn the_position_loop_damps_from_the_first_call_on() {
        let mut cascade = Cascade::new(POSITION, SPEED).unwrap();
        cascade.step(0.1, 2.0, &TimeStep::of(0.001));
        assert_eq!((cascade.position().terms().d, cascade.speed().terms().d), (-0.2, 0.0));
    }

    #[test]
    fn new_gains_of_one_loop_move_neither() {
        let mut cascade = Cascade::new(POSITION, SPEED).unwrap();
        let step = TimeStep::of(0.001);
        cascade.step(0.1, 0.0, &step);
        let before = cascade.step(0.1, 0.0, &step);
        cascade.speed_mut().set_gains(3.0, 5.0, 0.0).unwrap();
        cascade.position_mut().set_gains(12.0, 1.0, 0.1).unwrap();
        assert!((cascade.step(0.1, 0.0, &step) - before).abs() < 0.02);
    }

    #[test]
    fn the_invalid_loop_is_named_by_its_parameter() {
        let wrong = PidConfig::new(1.0, -1.0, 0.0);
        assert_eq!(Cascade::new(wrong, SPEED).unwrap_err().parameter(), "ki");
        assert_eq!(Cascade::new(POSITION, wrong).unwrap_err().parameter(), "ki");
    }
}
