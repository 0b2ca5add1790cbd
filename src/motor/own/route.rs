//! The frames of an own motor: which are for the motor, and the offered one.

use super::{Own, OwnMotor};
use crate::frame::CanFrame;
use crate::motor::{CanDevice, Claim, Devices, Repeat, Role, Visitor};

/// The ids of the feedback and of the commands of one motor, each as one pattern: a frame outside of both patterns is another device's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Route {
    feedback: Pattern,
    /// Feedback with an id shared by several motors. Such an id need not resemble the ids of this motor.
    shared: Pattern,
    command: Pattern,
    /// The first claim of feedback.
    usual: Pattern,
    /// The same; fits nothing where a command may have such an id too.
    certain: Pattern,
}

impl Route {
    /// Before the claims are known, each frame is compared with the claims.
    pub(super) const UNKNOWN: Self = Self { feedback: Pattern::ANY, ..Self::NONE };

    const NONE: Self = Self {
        feedback: Pattern::NONE,
        shared: Pattern::NONE,
        command: Pattern::NONE,
        usual: Pattern::NONE,
        certain: Pattern::NONE,
    };

    pub(super) const fn is_unknown(&self) -> bool {
        self.feedback.mask == 0
    }

    /// Takes the claims of the motor. A command with a shared id tells nothing: such a command may be for another drive.
    pub(super) fn of<I: IntoIterator<Item = Claim>>(claims: impl Fn() -> I) -> Self {
        let mut route = Self::NONE;
        for claim in claims() {
            if claim.role() == Role::Feedback && route.usual.is_none() {
                route.usual = Pattern::of(&claim);
            }
            match claim.role() {
                Role::Feedback if claim.is_shared() => route.shared.add(&claim),
                Role::Feedback => route.feedback.add(&claim),
                Role::Command if claim.is_shared() => {}
                Role::Command => route.command.add(&claim),
            }
        }
        let mut commands = claims()
            .into_iter()
            .filter(|claim| claim.role() == Role::Command && !claim.is_shared());
        if !commands.any(|claim| Pattern::of(&claim).meets(&route.usual)) {
            route.certain = route.usual;
        }
        route
    }

    /// Tells whether a frame may concern the motor; false for most frames of others, and for every remote frame.
    #[inline]
    pub(super) const fn fits(&self, frame: &CanFrame) -> bool {
        self.feedback.fits(frame) || self.command.fits(frame) || self.shared.fits(frame)
    }

    /// Returns header and mask of the usual feedback, if there is one.
    #[inline]
    pub(super) const fn usual(&self) -> Option<(u32, u32)> {
        if self.usual.is_none() { None } else { Some((self.usual.header, self.usual.mask)) }
    }

    /// Tells whether a frame is the motor's usual feedback for certain, and no command of another node.
    #[inline]
    pub(super) const fn is_feedback(&self, frame: &CanFrame) -> bool {
        self.certain.fits(frame)
    }
}

/// The bits that the ids of some claims have in common.
#[derive(Debug, Clone, Copy)]
struct Pattern {
    header: u32,
    mask: u32,
}

impl Pattern {
    /// Fits nothing: no header has all bits.
    const NONE: Self = Self { header: u32::MAX, mask: u32::MAX };

    const ANY: Self = Self { header: 0, mask: 0 };

    fn of(claim: &Claim) -> Self {
        let (header, mask) = claim.pattern();
        Self { header: header & mask, mask }
    }

    const fn is_none(&self) -> bool {
        self.header == u32::MAX
    }

    fn add(&mut self, claim: &Claim) {
        let Self { header, mask } = Self::of(claim);
        *self = if self.is_none() {
            Self { header, mask }
        } else {
            let mask = self.mask & mask & !(self.header ^ header);
            Self { header: header & mask, mask }
        };
    }

    #[inline]
    const fn fits(&self, frame: &CanFrame) -> bool {
        (frame.header() ^ self.header) & self.mask == 0
    }

    /// Tells whether some header fits both.
    const fn meets(&self, other: &Self) -> bool {
        (self.header ^ other.header) & self.mask & other.mask == 0
    }
}

/// The frame of the last update: a command, rest, or a frame in the place of either.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offered {
    /// `None` before the first.
    pub(super) frame: Option<CanFrame>,
    /// The frame is still to be taken.
    pub(super) waits: bool,
    /// A command, which an update without a step may send once more.
    pub(super) may_repeat: Repeat,
    /// Rest, not given back by the driver.
    pub(super) is_rest: bool,
}

impl Offered {
    pub(super) const NOTHING: Self =
        Self { frame: None, waits: false, may_repeat: Repeat::NO, is_rest: false };
}

impl<M: OwnMotor> Devices for Own<M> {
    #[inline]
    fn visit(&mut self, visitor: &mut impl Visitor) {
        visitor.visit(self);
    }

    #[inline]
    fn usual_feedback(&self) -> Option<(u32, u32)> {
        self.route.usual()
    }

    #[inline]
    fn next_frame(&mut self, _turn: u32) -> Option<CanFrame> {
        CanDevice::next_frame(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::MotorName;
    use embedded_can::{ExtendedId, Frame, Id, StandardId};
    use std::vec::Vec;

    fn claim(id: impl Into<Id>, role: Role) -> Claim {
        Claim::new(id, role, MotorName::new("mine", 1))
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
                    let role = if below(2) == 0 { Role::Feedback } else { Role::Command };
                    let claim = match below(8) {
                        0 => claim(extended, role),
                        _ => claim(standard(0x200 + u16::try_from(below(16)).unwrap()), role),
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
                    let covered = |role: Role, shared: bool| {
                        claims.iter().any(|claim| {
                            claim.role() == role
                                && (shared || !claim.is_shared())
                                && claim.covers(frame.id())
                        })
                    };
                    let is_feedback = covered(Role::Feedback, true);
                    let concerns = is_feedback || covered(Role::Command, false);
                    assert!(route.fits(&frame) || !concerns, "{frame:?} of {claims:?}");
                    refused += u32::from(!route.fits(&frame));
                    let is_certain = route.is_feedback(&frame);
                    let is_only = is_feedback && !covered(Role::Command, false);
                    assert!(!is_certain || is_only, "{frame:?} of {claims:?}");
                    certain += u32::from(is_certain);
                }
            }
        }
        assert!(refused > 100_000 && certain > 1_000, "{refused}, {certain}");
    }
}
