use super::Instant;

/// The beginning or the end of a condition `C` of a bus or of a source of data.
///
/// The edge is latched until read, and read once. The last edge read tells the present state. The edges of a motor are
/// [`motor::Edge`](crate::motor::Edge)s, which name the motor too.
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
    /// The condition.
    pub condition: C,
    /// Whether the condition began; otherwise it ended.
    pub began: bool,
    /// Time of the beginning, the first since the last reading; or of the end, the last.
    pub at: Instant,
}

impl<C: core::fmt::Display> core::fmt::Display for ConditionEdge<C> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let phase = if self.began { "began" } else { "ended" };
        write!(f, "{} {phase} at {} us", self.condition, self.at.as_micros())
    }
}
