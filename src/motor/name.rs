/// How a motor is called in errors and logs: its model and its id.
///
/// # Examples
/// ```
/// use drivetrain::motor::MotorName;
///
/// assert_eq!(MotorName::new("M3508", 5).to_string(), "M3508 #5");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct MotorName {
    model: &'static str,
    id: u8,
}

impl MotorName {
    /// Takes the model and the id set on the motor.
    #[must_use]
    pub const fn new(model: &'static str, id: u8) -> Self {
        Self { model, id }
    }

    /// Returns the model.
    #[must_use]
    pub const fn model(self) -> &'static str {
        self.model
    }

    /// Returns the id set on the motor.
    #[must_use]
    pub const fn id(self) -> u8 {
        self.id
    }
}

impl core::fmt::Display for MotorName {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} #{}", self.model, self.id)
    }
}
