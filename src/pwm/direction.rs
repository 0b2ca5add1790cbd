use embedded_hal::digital::{ErrorType, OutputPin};

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
