use super::{Slot, is_loop};
use crate::dji::Unit;
use crate::dji::feedback::ErrorTable;
use crate::motor::{Capabilities, Capability};

impl Slot {
    /// Returns what the motor offers with the loops that it has.
    pub(in crate::dji) fn capabilities(&self) -> Capabilities {
        let Some(facts) = self.facts else { return Capabilities::NONE };
        let direct = match facts.unit {
            Unit::Ampere => Capability::Current,
            Unit::Volt => Capability::Voltage,
        };
        let set = Capabilities::of(&[Capability::Raw, direct, Capability::Feedback]);
        [
            (Capability::Velocity, is_loop(self.loops.speed())),
            (Capability::Angle, is_loop(self.loops.position())),
            (Capability::Position, is_loop(self.loops.position())),
            (Capability::Temperature, facts.has_temperature),
            (Capability::ErrorCodes, facts.errors != ErrorTable::None),
            (Capability::AbsoluteAngle, self.shaft.is_direct()),
        ]
        .into_iter()
        .filter(|(_, offered)| *offered)
        .fold(set, |set, (capability, _)| set.with(capability))
    }
}
