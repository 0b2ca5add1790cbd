use super::Instant;

/// The beginning or the end of a condition `C` that is not that of a motor: of a bus, or of a source of data.
///
/// It is latched until it is read, and read once. The edge that was read last tells the present state. The edges of a motor
/// are [`motor::Edge`](crate::motor::Edge)s, which name the motor too.
///
/// # Examples
/// ```
/// use drivetrain::runner::BusCondition;
/// use drivetrain::time::{ConditionEdge, Instant};
///
/// let at = Instant::from_micros(2_310_000);
/// let edge = ConditionEdge { condition: BusCondition::Silent, began: true, at };
/// assert_eq!(edge.to_string(), "bus silent began at 2310000 us");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ConditionEdge<C> {
    /// What changed.
    pub condition: C,
    /// Whether it began; otherwise it ended.
    pub began: bool,
    /// When it began, the first time since the last reading; or when it ended, the last time.
    pub at: Instant,
}

impl<C: core::fmt::Display> core::fmt::Display for ConditionEdge<C> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let phase = if self.began { "began" } else { "ended" };
        write!(f, "{} {phase} at {} us", self.condition, self.at.as_micros())
    }
}
