//! Names of motors, and the CAN ids that the motors claim.

use crate::frame::{CanFrame, Pattern};
use embedded_can::Id;

/// A CAN id, or a block of ids under a mask, of one motor.
///
/// # Examples
/// ```
/// use drivetrain::motor::{Claim, MotorName};
/// use embedded_can::StandardId;
///
/// let id = |raw| StandardId::new(raw).unwrap_or(StandardId::ZERO);
/// let dji = Claim::feedback(id(0x201), MotorName::new("M3508", 1));
/// let damiao = Claim::command(id(0x201), MotorName::new("DM4310 (velocity)", 1));
/// let odrive = Claim::command(id(0x200), MotorName::new("ODrive", 0x10)).with_mask(0x7E0);
/// assert!(dji.clashes_with(&damiao));
/// assert!(dji.clashes_with(&odrive)); // node 0x10 owns 0x200 to 0x21F
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claim {
    id: Id,
    mask: u32,
    is_feedback: bool,
    is_shared: bool,
    motor: MotorName,
}

impl Claim {
    /// Claims one id for frames of the controller.
    #[must_use]
    pub fn command(id: impl Into<Id>, motor: MotorName) -> Self {
        Self { id: id.into(), mask: u32::MAX, is_feedback: false, is_shared: false, motor }
    }

    /// Claims one id for frames of the motor.
    #[must_use]
    pub fn feedback(id: impl Into<Id>, motor: MotorName) -> Self {
        Self { is_feedback: true, ..Self::command(id, motor) }
    }

    /// Claims every id with an equal value under `mask`.
    #[must_use]
    pub const fn with_mask(self, mask: u32) -> Self {
        Self { mask, ..self }
    }

    /// Allows other motors to claim the same id in the same direction: their frames differ in their data.
    ///
    /// Two claims share an id only if both of them allow sharing.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::{Claim, MotorName};
    /// use embedded_can::StandardId;
    ///
    /// // Damiao drives that all answer to one master id, each with its own number in the first byte.
    /// let answer = |id| Claim::feedback(StandardId::ZERO, MotorName::new("DM-J4310", id));
    /// let (first, second) = (answer(1), answer(2));
    /// assert!(first.clashes_with(&second) && first.shared().clashes_with(&second));
    /// assert!(!first.shared().clashes_with(&second.shared()));
    /// let command = Claim::command(StandardId::ZERO, second.motor());
    /// assert!(first.shared().clashes_with(&command.shared()));
    /// ```
    #[must_use]
    pub const fn shared(self) -> Self {
        Self { is_shared: true, ..self }
    }

    /// Tells whether an id belongs to the claim.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::motor::{Claim, MotorName};
    /// use embedded_can::{ExtendedId, StandardId};
    ///
    /// // A CyberGear answers with its state within the id: type 2, motor 0x7F, host 0xFD.
    /// let id = |raw| ExtendedId::new(raw).unwrap_or(ExtendedId::ZERO);
    /// let answer = Claim::feedback(id(0x0200_7FFD), MotorName::new("CyberGear", 127))
    ///     .with_mask(0x1F00_FFFF);
    /// assert!(answer.covers(id(0x0280_7FFD)) && !answer.covers(id(0x0280_7EFD)));
    /// assert!(!answer.covers(StandardId::ZERO));
    /// ```
    #[must_use]
    pub fn covers(&self, id: impl Into<Id>) -> bool {
        let ((extended, own), (other_extended, other)) = (raw(self.id), raw(id.into()));
        extended == other_extended && (own ^ other) & self.mask == 0
    }

    /// Returns whether some id belongs to both claims, unless both [share](Self::shared) the id in one direction, or the claims
    /// are the two directions of one motor: some protocols send command and feedback with one id, which is then not shared.
    #[must_use]
    pub fn clashes_with(&self, other: &Self) -> bool {
        let is_shared = self.is_shared || other.is_shared;
        if self.motor == other.motor && self.is_feedback != other.is_feedback && !is_shared {
            return false;
        }
        if self.is_shared && other.is_shared && self.is_feedback == other.is_feedback {
            return false;
        }
        let (extended, raw) = raw(self.id);
        let (other_extended, other_raw) = self::raw(other.id);
        extended == other_extended && (raw ^ other_raw) & self.mask & other.mask == 0
    }

    /// Returns the ids as a pattern.
    pub(crate) fn pattern(&self) -> Pattern {
        Pattern::of(self.id, self.mask)
    }

    /// Returns the id.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Returns whether the motor sends the frames, and not the controller.
    #[must_use]
    pub const fn is_feedback(&self) -> bool {
        self.is_feedback
    }

    const fn direction(&self) -> &'static str {
        if self.is_feedback { "feedback" } else { "command" }
    }

    pub(super) const fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// Returns the motor of the claim.
    #[must_use]
    pub const fn motor(&self) -> MotorName {
        self.motor
    }
}

fn raw(id: Id) -> (bool, u32) {
    match id {
        Id::Standard(id) => (false, u32::from(id.as_raw())),
        Id::Extended(id) => (true, id.as_raw()),
    }
}

impl core::fmt::Display for Claim {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} of {} on 0x{:X}", self.direction(), self.motor, raw(self.id).1)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Claim {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{=str} of {} on {=u32:#x}", self.direction(), self.motor, raw(self.id).1);
    }
}

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

/// The ids of the feedback and of the commands of one motor, each as one pattern: a frame outside of both patterns is another device's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Route {
    feedback: Pattern,
    /// Feedback with an id shared by several motors. Such an id need not resemble the ids of this motor.
    shared: Pattern,
    command: Pattern,
    /// The first claim of feedback.
    pub(super) usual: Pattern,
    /// The same; fits nothing where a command may have such an id too. A frame that fits is feedback for certain.
    pub(super) certain: Pattern,
}

impl Route {
    /// Before the claims are known, each frame is compared with the claims.
    pub(crate) const UNKNOWN: Self = Self { feedback: Pattern::ANY, ..Self::NONE };

    const NONE: Self = Self {
        feedback: Pattern::NONE,
        shared: Pattern::NONE,
        command: Pattern::NONE,
        usual: Pattern::NONE,
        certain: Pattern::NONE,
    };

    pub(crate) const fn is_unknown(&self) -> bool {
        self.feedback.mask == 0
    }

    /// Takes the claims of the motor. A command with a shared id tells nothing: such a command may be for another drive.
    pub(crate) fn of<I: IntoIterator<Item = Claim>>(claims: impl Fn() -> I) -> Self {
        let mut route = Self::NONE;
        for claim in claims() {
            if claim.is_feedback() && route.usual.is_none() {
                route.usual = claim.pattern();
            }
            match (claim.is_feedback(), claim.is_shared()) {
                (true, true) => route.shared.add(claim.pattern()),
                (true, false) => route.feedback.add(claim.pattern()),
                (false, true) => {}
                (false, false) => route.command.add(claim.pattern()),
            }
        }
        let mut commands =
            claims().into_iter().filter(|claim| !claim.is_feedback() && !claim.is_shared());
        if !commands.any(|claim| claim.pattern().meets(&route.usual)) {
            route.certain = route.usual;
        }
        route
    }

    /// Tells whether a frame may concern the motor; false for most frames of others, and for every remote frame.
    #[inline]
    pub(super) const fn fits(&self, frame: &CanFrame) -> bool {
        self.feedback.fits(frame) || self.command.fits(frame) || self.shared.fits(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, Frame, StandardId};
    use std::vec::Vec;

    #[test]
    fn one_motor_may_use_an_id_in_both_directions_and_two_may_not() {
        let id = StandardId::new(5).unwrap();
        let command = |name| Claim::command(id, MotorName::new(name, 5));
        let feedback = |name| Claim::feedback(id, MotorName::new(name, 5));
        let command = command("joint");
        assert!(!command.clashes_with(&feedback("joint")));
        assert!(command.clashes_with(&command)); // attached twice
        assert!(command.covers(id) && !command.covers(StandardId::ZERO));
        assert!(command.clashes_with(&feedback("another")));
        // Others answer with this id while the motor is commanded with it.
        assert!(command.clashes_with(&feedback("joint").shared()));
    }

    fn claim(id: impl Into<Id>, is_feedback: bool) -> Claim {
        let name = MotorName::new("mine", 1);
        if is_feedback { Claim::feedback(id, name) } else { Claim::command(id, name) }
    }

    fn standard(raw: u16) -> StandardId {
        StandardId::new(raw).unwrap()
    }

    #[test]
    fn a_route_refuses_no_frame_of_its_motor_and_is_exact_where_it_answers() {
        let extended = ExtendedId::new(0x201).unwrap();
        let mut state = 1_u32;
        let mut below = |limit: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % limit
        };
        let (mut refused, mut certain) = (0, 0);
        for _ in 0..2_000 {
            let claims: Vec<Claim> = (0..below(5))
                .map(|_| {
                    let is_feedback = below(2) == 0;
                    let claim = match below(8) {
                        0 => claim(extended, is_feedback),
                        _ => {
                            claim(standard(0x200 + u16::try_from(below(16)).unwrap()), is_feedback)
                        }
                    };
                    let claim = if below(4) == 0 { claim.with_mask(0x7F0) } else { claim };
                    if below(4) == 0 { claim.shared() } else { claim }
                })
                .collect();
            let route = Route::of(|| claims.iter().copied());
            for raw in 0x1F0..0x220 {
                let ids = [Id::from(standard(raw)), ExtendedId::new(raw.into()).unwrap().into()];
                for id in ids {
                    let frame = CanFrame::of(id, [0; 8]);
                    let covered = |is_feedback: bool, shared: bool| {
                        claims.iter().any(|claim| {
                            claim.is_feedback() == is_feedback
                                && (shared || !claim.is_shared())
                                && claim.covers(frame.id())
                        })
                    };
                    let is_feedback = covered(true, true);
                    let concerns = is_feedback || covered(false, false);
                    assert!(route.fits(&frame) || !concerns, "{frame:?} of {claims:?}");
                    refused += u32::from(!route.fits(&frame));
                    let is_certain = route.certain.fits(&frame);
                    let is_only = is_feedback && !covered(false, false);
                    assert!(!is_certain || is_only, "{frame:?} of {claims:?}");
                    certain += u32::from(is_certain);
                }
            }
        }
        assert!(refused > 100_000 && certain > 1_000, "{refused}, {certain}");
    }
}
