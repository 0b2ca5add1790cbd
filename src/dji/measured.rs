//! Targets measured by another sensor.

use super::motors::{Key, Motors};
use crate::motor::{LONGEST_PAUSE, TargetError};
use crate::time::Instant;
use crate::units::{Angle, AngularVelocity};

/// Sets the remaining way and the rate, both measured by another sensor at the time `at`.
pub(super) fn set<const N: usize>(
    motors: &mut Motors<N>,
    motor: Key,
    way: Angle,
    velocity: AngularVelocity,
    at: Instant,
) -> Result<(), TargetError> {
    let guard = &motors.guard;
    let (now, updated, timeouts) = (guard.now(), guard.updated(), *guard.timeouts());
    // A 32-bit stamp alone would be fresh again every 71 minutes.
    let is_ahead = guard.is_running() && at.since(updated) > LONGEST_PAUSE;
    let is_far = is_ahead || updated.since(at) > timeouts.measured();
    let at = (!is_far).then(|| at.stamp());
    motors.change_present(motor, |slot| {
        slot.set_measured(way.as_radians(), velocity.as_rad_per_s(), at, now, &timeouts)
    })?;
    // A measured target expires sooner than others.
    motors.guard.disturb();
    Ok(())
}
