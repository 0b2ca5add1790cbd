//! What comes between the update of the loops and the frames.

use super::slot::Slot;
use super::{AnyHandle, Bus, Handle, Model};
use crate::units::Current;

impl<B> Bus<B> {
    /// Returns the current that the last update asks of a motor, as it goes on the wire; `None` once it is detached.
    ///
    /// The direction is that of the shaft. What the motor does about it is in [`State::current`](super::State::current).
    #[must_use]
    pub fn commanded_current<M: Model<Command = Current>>(
        &self,
        motor: Handle<M, B>,
    ) -> Option<Current> {
        let slot = self.slot(motor.into())?;
        Some(Current::from_amperes(slot.in_units(self.outbox.get(slot.place))))
    }

    /// Cuts what the last update asks of some motors, all by one factor: for a limit on several together, of power say.
    ///
    /// Call it after [`update`](Self::update) and before [`next_frame`](Self::next_frame); with a runner, in
    /// [`tick_limited`](crate::runner::Runner::tick_limited). It can only take away: a factor of 1 or more changes
    /// nothing, one that is zero, negative or NaN gives zero, and what is left is rounded towards zero. It works on the
    /// frames alone, so stops and limits stay as they are, and each update starts anew. The integral of a speed loop that
    /// is cut is held within what is left of its output: it does not wind up meanwhile.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::chassis::{PowerModel, WheelLoad};
    /// use drivetrain::dji::{Bus, Config, M3508};
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::time::{Duration, Instant, Tick};
    /// use drivetrain::units::Current;
    ///
    /// let mut bus = Bus::new();
    /// let at_once = |id| Config::<M3508>::new(id).with_opening(Duration::ZERO); // for one update
    /// let wheels = bus.attach_all([1, 2].map(at_once))?;
    /// let now = Instant::from_micros(1_000);
    /// for id in [0x201, 0x202] {
    ///     let at_100_rpm = [0, 0, 0x07, 0x80, 0, 0, 30, 0]; // 1920 rpm of the rotor, behind 19.2 to 1
    ///     bus.ingest(&CanFrame::standard(id, at_100_rpm).ok_or("id")?, now);
    /// }
    /// bus.arm(now)?;
    /// for wheel in wheels {
    ///     bus.set_current(wheel, Current::from_amperes(10.0))?;
    /// }
    /// bus.update(Tick::new(now, 0.001));
    ///
    /// let model = PowerModel::new(0.0, 0.475, 0.065, 0.0)?; // of current and speed
    /// let loads = wheels.map(|wheel| WheelLoad {
    ///     torque: bus.commanded_current(wheel).map_or(0.0, |current| current.as_amperes()),
    ///     speed_rad_s: bus.state(wheel).map_or(0.0, |state| state.velocity.as_rad_per_s()),
    /// });
    /// let (scale, _) = model.cut(loads, 60.0); // both together would take 112 W
    /// bus.scale_outputs(wheels, scale);
    /// let left = bus.commanded_current(wheels[0]).ok_or("detached")?;
    /// assert!((left.as_amperes() - 5.62).abs() < 0.01);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn scale_outputs(
        &mut self,
        motors: impl IntoIterator<Item = impl Into<AnyHandle<B>>>,
        factor: f32,
    ) {
        for motor in motors {
            let motor = motor.into();
            let Some(place) = self.slot(motor).map(|slot| slot.place) else { continue };
            let before = self.outbox.get(place);
            let after = cut(before, factor);
            if after != before {
                self.outbox.put(place, after);
                if let Some(slot) = self.slot_mut(motor) {
                    slot.keep_within(after);
                }
            }
        }
    }
}

impl Slot {
    /// Tells the speed loop how much of its output was let through.
    fn keep_within(&mut self, raw: i16) {
        let left = self.in_units(raw);
        self.speed_loop_mut().keep_integral_within(left);
    }
}

/// Returns the command cut by a factor: never larger than before, never of the other sign.
const fn cut(raw: i16, factor: f32) -> i16 {
    if factor >= 1.0 {
        return raw;
    }
    if factor > 0.0 {
        #[expect(clippy::cast_possible_truncation, reason = "rounds towards zero, within raw")]
        let less = (raw as f32 * factor) as i16;
        return less;
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn nothing_is_raised_or_turned_around(raw in any::<i16>(), factor in any::<f32>()) {
            let after = cut(raw, factor);
            prop_assert!(after.unsigned_abs() <= raw.unsigned_abs(), "{raw} {factor} {after}");
            prop_assert!(after == 0 || (after < 0) == (raw < 0), "{raw} {factor} {after}");
        }

        #[test]
        fn what_is_left_is_the_share_to_a_count(raw in any::<i16>(), factor in 0.0_f32..1.0) {
            let share = f32::from(raw) * factor;
            prop_assert!((f32::from(cut(raw, factor)) - share).abs() <= 1.0);
        }
    }

    #[test]
    fn a_factor_that_is_no_share_takes_all_or_nothing() {
        for factor in [f32::NAN, f32::NEG_INFINITY, -1.0, -0.0, 0.0] {
            assert_eq!(cut(-12_345, factor), 0);
        }
        for factor in [1.0, 1.5, f32::INFINITY] {
            assert_eq!((cut(-12_345, factor), cut(i16::MIN, factor)), (-12_345, i16::MIN));
        }
    }
}
