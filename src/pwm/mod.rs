//! Motors off CAN: an RC ESC or servo, and a brushed motor behind an H-bridge. Feature `hal`.
//!
//! ```text
//!                    ┌ RcPwm ───┐  SetDutyCycle     pulse of 1000 to 2000 us, 50 times a second
//! set_throttle ──────┤          ├────────────────>  ▁▁█▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁█▁▁▁▁
//!                    └──────────┘
//!                    ┌ Brushed ─┐  SetDutyCycle     ▁██▁██▁██▁  to the bridge
//! set_velocity ──────┤ PID      ├────────────────>
//! counts ────────────┤          ├─ OutputPin(s) ─>  direction
//!                    └──────────┘
//! ```
//!
//! | item | meaning |
//! |---|---|
//! | [`RcPwm`] | an ESC or servo that listens to the length of a pulse |
//! | [`Brushed`], [`BrushedConfig`] | a DC motor with a bridge, and an encoder where it has one |
//! | [`Direction`]: an array of one pin, or a tuple of two | how the bridge is told which way |
//! | [`HealthConfig`](crate::motor::HealthConfig) | when a brushed motor with an encoder counts as stalled, or runs away |
//! | [`OneOf`](crate::motor::OneOf) | which pin failed: the PWM channel first, or a direction pin |
//! | [`ConfigError`](crate::error::ConfigError) | fault of a configuration |
//!
//! The motors follow the rules of all motors here, by the same [`Guard`](crate::motor::Guard): disarmed at the start; a
//! target that is old, NaN or infinite, time that stands or goes back, lost feedback and an emergency stop give the safe
//! output. Of bad time steps in a row, the first keeps the output unless it comes late, and the others give the safe output. Each change is an [`Edge`](crate::time::Edge), pending in `next_edge`. The motors are not
//! [`Devices`](crate::motor::Devices), so the program calls `update` in each tick itself. With
//! [`VelocityDrive`](crate::motor::VelocityDrive) they drive a chassis like any other motor.
//!
//! No runner watches these motors: if an [`EmergencyStop`](crate::runner::EmergencyStop) is set from an interrupt, call
//! `emergency_stop` in the next tick.
//!
//! # Limits
//! `update` reports a failed pin and tries again in the next call; meanwhile the hardware may continue with its last
//! state. When `update` is no longer called, the timer continues with its last pulse: a hardware watchdog is needed.

mod brushed;
mod rc;
#[cfg(test)]
mod tests;

use embedded_hal::digital::{ErrorType, OutputPin};

pub use brushed::{Brushed, BrushedConfig};
pub use rc::RcPwm;

/// The direction pins of a bridge: an array of one pin, or a tuple of two.
///
/// One pin, `[pin]`, is low for forward and high for backward; coasting leaves the pin unchanged. A tuple is IN1 and IN2 of a
/// bridge like the L298N or TB6612FNG: at most one pin is high, and both low let the motor coast.
///
/// # Examples
/// ```
/// use drivetrain::pwm::Direction;
/// # use embedded_hal::digital::*;
/// # struct Pin(bool);
/// # impl ErrorType for Pin { type Error = core::convert::Infallible; }
/// # impl OutputPin for Pin {
/// #     fn set_low(&mut self) -> Result<(), Self::Error> { self.0 = false; Ok(()) }
/// #     fn set_high(&mut self) -> Result<(), Self::Error> { self.0 = true; Ok(()) }
/// # }
/// # let (pin, in1, in2) = (Pin(false), Pin(false), Pin(false));
///
/// let mut one = [pin];
/// one.backward()?;
/// assert!(one[0].0); // high
///
/// let mut pins = (in1, in2);
/// pins.backward()?;
/// assert!(!pins.0.0 && pins.1.0);
/// # Ok::<(), core::convert::Infallible>(())
/// ```
pub trait Direction {
    /// Error of a pin.
    type Error: core::fmt::Debug;

    /// Lets the motor coast, if the bridge can.
    ///
    /// # Errors
    /// The error of the pin.
    fn coast(&mut self) -> Result<(), Self::Error>;

    /// Drives in the positive direction.
    ///
    /// # Errors
    /// The error of the pin.
    fn forward(&mut self) -> Result<(), Self::Error>;

    /// Drives in the negative direction.
    ///
    /// # Errors
    /// The error of the pin.
    fn backward(&mut self) -> Result<(), Self::Error>;
}

/// Low is forward, high is backward; coasting leaves the pin unchanged.
impl<P: OutputPin> Direction for [P; 1] {
    type Error = P::Error;

    fn coast(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }

    fn forward(&mut self) -> Result<(), Self::Error> {
        let [pin] = self;
        pin.set_low()
    }

    fn backward(&mut self) -> Result<(), Self::Error> {
        let [pin] = self;
        pin.set_high()
    }
}

/// Lowers a pin before it raises the other pin: both are never high.
impl<A: OutputPin, B: OutputPin + ErrorType<Error = A::Error>> Direction for (A, B) {
    type Error = A::Error;

    fn coast(&mut self) -> Result<(), Self::Error> {
        let first = self.0.set_low();
        self.1.set_low().and(first)
    }

    fn forward(&mut self) -> Result<(), Self::Error> {
        self.1.set_low()?;
        self.0.set_high()
    }

    fn backward(&mut self) -> Result<(), Self::Error> {
        self.0.set_low()?;
        self.1.set_high()
    }
}
