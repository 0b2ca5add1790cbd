use embedded_hal::digital::{ErrorType, OutputPin};

/// Which way a bridge drives its motor.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Way {
    /// Not at all: the motor coasts where the bridge can do that.
    #[default]
    Coast,
    /// The positive direction.
    Forward,
    /// The negative direction.
    Backward,
}

/// The pins that tell a bridge which way to drive.
///
/// # Examples
/// ```
/// use drivetrain::pwm::{Direction, OnePin, Way};
/// # use embedded_hal::digital::*;
/// # struct Pin(bool);
/// # impl ErrorType for Pin { type Error = core::convert::Infallible; }
/// # impl OutputPin for Pin {
/// #     fn set_low(&mut self) -> Result<(), Self::Error> { self.0 = false; Ok(()) }
/// #     fn set_high(&mut self) -> Result<(), Self::Error> { self.0 = true; Ok(()) }
/// # }
/// # let pin = Pin(false);
///
/// let mut direction = OnePin(pin);
/// direction.set(Way::Backward)?;
/// assert!(direction.0.0); // high
/// # Ok::<(), core::convert::Infallible>(())
/// ```
pub trait Direction {
    /// What can go wrong with a pin.
    type Error: core::fmt::Debug;

    /// Tells the bridge which way to drive.
    ///
    /// # Errors
    /// That of the pin.
    fn set(&mut self, way: Way) -> Result<(), Self::Error>;
}

/// One pin: low is forward, high is backward; coasting leaves it as it is.
#[derive(Debug, Clone, Copy)]
pub struct OnePin<P>(pub P);

impl<P: OutputPin> Direction for OnePin<P> {
    type Error = P::Error;

    fn set(&mut self, way: Way) -> Result<(), Self::Error> {
        match way {
            Way::Coast => Ok(()),
            Way::Forward => self.0.set_low(),
            Way::Backward => self.0.set_high(),
        }
    }
}

/// Two pins, IN1 and IN2 of a bridge like the L298N or TB6612FNG: one is high at most, and both low let it coast.
#[derive(Debug, Clone, Copy)]
pub struct TwoPins<A, B>(pub A, pub B);

impl<A: OutputPin, B: OutputPin + ErrorType<Error = A::Error>> Direction for TwoPins<A, B> {
    type Error = A::Error;

    /// Lowers a pin before it raises the other one: both are never high.
    fn set(&mut self, way: Way) -> Result<(), Self::Error> {
        match way {
            Way::Coast => {
                let first = self.0.set_low();
                self.1.set_low().and(first)
            }
            Way::Forward => {
                self.1.set_low()?;
                self.0.set_high()
            }
            Way::Backward => {
                self.0.set_low()?;
                self.1.set_high()
            }
        }
    }
}
