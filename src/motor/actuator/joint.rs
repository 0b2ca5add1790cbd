//! The joint on the shaft of the drive: targets and measurements in its own direction, from its own zero.

use super::power::Reading;
use super::{Impedance, Shaft, Target};
use crate::math::{limited, wrap_pi};
use crate::motor::{
    BACK, BRAKING_S, Condition, Latch, TargetError, check_soft_limits, velocity_inside,
};
use crate::units::{Angle, AngularVelocity};
use core::f32::consts::TAU;

/// After a longer time of feedback without an angle, in s, whole turns are not known.
const UNKNOWN_S: f32 = 0.1;

/// The direction and the zero of the joint: its angle is `sign * (angle of the drive - zero)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    pub(super) sign: f32,
    pub(super) zero: Zero,
    /// The last angle of a drive whose zero depends on its supply.
    last: Option<Reading>,
}

/// The angle of the drive where the joint is at zero.
#[derive(Debug, Clone, Copy)]
pub(super) enum Zero {
    /// The zero of the drive.
    OfDrive,
    /// Given with the configuration, within a turn: whole turns are not known before the joint was heard.
    Given(Angle),
    /// Of a drive that knows its angle within a turn: whole turns follow the joint over a loss of the supply.
    Placed(Angle),
    /// Of a drive that counts from where it was switched on.
    Found(Angle),
    /// The drive may have lost its supply since.
    Lost,
}

impl Joint {
    /// The joint turns and counts as its drive.
    pub(super) const DIRECT: Self = Self { sign: 1.0, zero: Zero::OfDrive, last: None };

    /// Tells whether a zero is given and not placed.
    #[inline]
    pub(super) const fn awaits_zero(&self) -> bool {
        matches!(self.zero, Zero::Given(_))
    }

    pub(super) const fn has_zero_of_drive(&self) -> bool {
        matches!(self.zero, Zero::OfDrive)
    }

    /// Places a given zero in the turn where the joint is heard first, within half a turn of its middle.
    pub(super) fn place_zero(&mut self, measured: Option<Angle>, middle: Angle) {
        if let (Zero::Given(zero), Some(measured)) = (self.zero, measured) {
            let joint = (measured - zero) * self.sign;
            let joint = middle + (joint - middle).wrapped();
            self.zero = Zero::Placed(measured - joint * self.sign);
        }
    }

    /// Tells whether the zero is lost, or its turn, if the drive counts its turns anew.
    pub(super) const fn depends_on_supply(&self) -> bool {
        matches!(self.zero, Zero::Placed(_) | Zero::Found(_))
    }

    /// Takes the angle of a frame of feedback, so long after the frame before, after a silence or not. A drive counts anew if the angle is
    /// further away than the shaft can have turned. Returns by how much the drive counts further than before; `None` if the zero is lost.
    ///
    /// A jump by whole turns is no loss: some drives count within a turn. Any other jump without a silence is a loss for every drive: an
    /// encoder slipped, a tool set the zero, or another drive answers.
    pub(super) fn follow(
        &mut self,
        reading: Option<Reading>,
        at: u32,
        gap_us: u32,
        is_silence: bool,
    ) -> Option<Angle> {
        let last = self.last;
        self.last = reading.or(last);
        let (reading, last) = match (reading, last) {
            (Some(reading), Some(last)) => (reading, last),
            // The angle comes with a later frame, and the turns are those of before.
            (None, Some(last)) if is_silence && matches!(self.zero, Zero::Placed(_)) => {
                self.last = Some(Reading { at, ..last });
                return Some(Angle::ZERO);
            }
            _ if is_silence => return self.lose_zero(),
            _ => return Some(Angle::ZERO),
        };
        let (gap_s, known_s) = (last.gap_s(&reading), UNKNOWN_S.max(gap_us as f32 * 1e-6));
        let furthest = last.furthest(&reading, gap_s.min(known_s));
        let way = reading.angle - last.angle;
        let turns = way - way.wrapped();
        let is_usual = |way: Angle| !is_silence && way.as_radians().abs() <= furthest;
        match &mut self.zero {
            _ if is_usual(way) => Some(Angle::ZERO),
            // Within a turn of its zero a drive may have started again, further away it has not.
            Zero::Placed(_)
                if is_silence
                    && reading.angle.as_radians().abs() > TAU
                    && way.as_radians().abs() < 1.5 * TAU =>
            {
                Some(Angle::ZERO)
            }
            _ if !is_silence && gap_s > known_s => self.lose_zero(),
            Zero::Placed(zero) if is_silence || is_usual(way.wrapped()) => {
                *zero = *zero + turns;
                Some(turns)
            }
            Zero::Found(zero) if is_usual(way.wrapped()) => {
                *zero = *zero + turns;
                Some(turns)
            }
            _ => self.lose_zero(),
        }
    }

    const fn lose_zero(&mut self) -> Option<Angle> {
        self.forget_zero();
        None
    }

    pub(super) const fn forget_zero(&mut self) {
        (self.zero, self.last) = (Zero::Lost, None);
    }

    pub(super) const fn zero(&self) -> Option<Angle> {
        match self.zero {
            Zero::OfDrive => Some(Angle::ZERO),
            Zero::Placed(zero) | Zero::Found(zero) => Some(zero),
            Zero::Given(_) | Zero::Lost => None,
        }
    }

    /// Returns an angle of the joint as an angle of the drive.
    ///
    /// # Errors
    /// [`TargetError::NotFinite`], and [`TargetError::NotHomed`] if the zero is lost.
    pub(super) fn angle_of_drive(&self, angle: Angle) -> Result<Angle, TargetError> {
        let zero = self.zero().ok_or(TargetError::NotHomed);
        let angle = zero.unwrap_or(Angle::ZERO) + angle * self.sign;
        if angle.is_finite() { zero.map(|_| angle) } else { Err(TargetError::NotFinite) }
    }

    /// Returns a spring of the joint as a spring of the drive.
    ///
    /// # Errors
    /// As [`angle_of_drive`](Self::angle_of_drive).
    pub(super) fn impedance_of_drive(&self, spring: Impedance) -> Result<Target, TargetError> {
        let angle = self.angle_of_drive(spring.angle);
        if !spring.is_finite() {
            return Err(TargetError::NotFinite);
        }
        Ok(Target::Impedance(Impedance {
            angle: angle?,
            velocity: spring.velocity * self.sign,
            torque_nm: spring.torque_nm * self.sign,
            ..spring
        }))
    }

    /// Tells whether limits of the joint count: the joint has a zero, or is given one.
    pub(super) const fn has_limits(&self) -> bool {
        self.depends_on_supply() || self.awaits_zero()
    }

    /// Returns the shaft between the limits of the joint; `None` without a zero or an angle.
    pub(super) fn inside(&self, (lower, upper): (f32, f32), shaft: Shaft) -> Option<Inside> {
        let zero = self.zero().filter(|_| self.depends_on_supply())?.as_radians();
        let (one, other) = (zero + self.sign * lower, zero + self.sign * upper);
        let here = shaft.0?.as_radians();
        // A velocity that is no number counts as none.
        let velocity = Some(shaft.1.as_rad_per_s()).filter(|velocity| velocity.is_finite());
        here.is_finite().then_some(Inside {
            lower: one.min(other),
            upper: one.max(other),
            here,
            velocity: velocity.unwrap_or(0.0),
        })
    }
}

/// A shaft between its soft limits, in rad and rad/s in the direction and from the zero of the drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Inside {
    lower: f32,
    upper: f32,
    here: f32,
    velocity: f32,
}

/// At a limit, a torque brakes in proportion to the velocity up to half of this, in rad/s: at a lower one, the torque would
/// change its sign with each step of a light joint.
const SLOW: f32 = 4.0;
/// An angle in the place of a velocity leads the shaft by at most this way in rad, or by the way in this time in s: a blocked shaft turns
/// no further at once when freed.
const AHEAD: f32 = 0.25;
const AHEAD_S: f32 = 0.2;
/// The way to a limit in rad over which an outward torque falls to zero.
const FADING: f32 = 0.02;
/// The longest way in rad to an angle, so that the shortest way leads in the same direction.
const LONGEST_WAY: f32 = 3.0;

impl Inside {
    /// Tells whether the shaft is beyond a limit.
    pub(super) const fn is_outside(&self) -> bool {
        self.here < self.lower || self.here > self.upper
    }

    /// Notes whether the shaft is at a limit, or so near that a target beyond leads no further.
    pub(super) fn check(inside: Option<Self>, is_lost: bool, latch: &mut Latch) {
        let Some(Self { lower, upper, here, .. }) = inside else {
            return latch.set(Condition::SoftLimit, is_lost);
        };
        check_soft_limits(latch, (lower + FADING, upper - FADING), here, here);
    }

    /// Returns the target within the limits.
    fn target(&self, target: Target) -> Target {
        match target {
            Target::Torque(torque_nm) => Target::Torque(self.torque(torque_nm)),
            Target::Velocity(velocity) => Target::Velocity(self.velocity(velocity)),
            Target::Angle(angle) => {
                Target::Angle(Angle::from_radians(self.nearest(angle.as_radians())))
            }
            Target::Impedance(impedance) => {
                let angle = limited(impedance.angle.as_radians(), self.lower, self.upper);
                Target::Impedance(Impedance {
                    angle: Angle::from_radians(angle),
                    velocity: self.velocity(impedance.velocity),
                    torque_nm: self.torque(impedance.torque_nm),
                    ..impedance
                })
            }
        }
    }

    /// Returns the target of the next step: no outward velocity of the start, and an angle not so far away that another way is shorter.
    fn next(&self, target: Target) -> Target {
        match target {
            Target::Velocity(velocity) => Target::Velocity(self.velocity(velocity)),
            Target::Angle(angle) => {
                let way = limited(angle.as_radians() - self.here, -LONGEST_WAY, LONGEST_WAY);
                Target::Angle(Angle::from_radians(self.here + way))
            }
            Target::Torque(_) | Target::Impedance(_) => target,
        }
    }

    fn velocity(&self, velocity: AngularVelocity) -> AngularVelocity {
        let limits = (self.lower, self.upper);
        AngularVelocity::from_rad_per_s(velocity_inside(limits, self.here, velocity.as_rad_per_s()))
    }

    fn torque(&self, torque_nm: f32) -> f32 {
        let (left, outward) = if torque_nm > 0.0 {
            (self.upper - self.here, self.velocity)
        } else {
            (self.here - self.lower, -self.velocity)
        };
        let left = left.max(0.0);
        let most = left / BRAKING_S;
        let excess = (outward - 0.5 * most).max(0.0);
        // Below zero, the torque brakes.
        let share = (left / FADING).min(1.0) - 2.0 * excess / most.max(SLOW);
        torque_nm * share.max(-1.0)
    }

    /// Returns the angle of this direction within the limits to which the way is shortest; otherwise the limit next to it. Of limits a turn
    /// and more apart, an angle outside is the limit.
    fn nearest(&self, angle: f32) -> f32 {
        let bounded = |angle| limited(angle, self.lower, self.upper);
        let is_wide = self.upper - self.lower >= TAU;
        if is_wide && !(self.lower..=self.upper).contains(&angle) {
            return bounded(angle);
        }
        // A sum near a limit is rounded to either side.
        let is_inside = |angle: &f32| (angle - bounded(*angle)).abs() < 1e-3;
        let first = self.here + wrap_pi(angle - self.here);
        let inside = [first, first - TAU, first + TAU].into_iter().find(is_inside);
        let middle = 0.5 * (self.lower + self.upper);
        bounded(inside.unwrap_or_else(|| middle + wrap_pi(angle - middle)))
    }
}

/// The shaft when a target was followed first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    angle: Option<Angle>,
    velocity: Option<AngularVelocity>,
    pub(super) lead: Option<Lead>,
}

/// The angle in the place of a velocity at a soft limit and beyond: so far inward in rad from where the shaft was first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lead {
    angle: Angle,
    inward: f32,
    /// How far outward of the angle the shaft is, in rad.
    out: f32,
}

impl Start {
    pub(super) const NONE: Self = Self { angle: None, velocity: None, lead: None };

    /// The drive counts so many turns further.
    pub(super) fn turn(&mut self, turns: Angle) {
        self.angle = self.angle.map(|angle| angle + turns);
        if let Some(Lead { angle, .. }) = &mut self.lead {
            *angle = *angle + turns;
        }
    }

    /// Returns the target on its way from the start, as far as the output range is open; within the limits, if any. The step is `None` in a
    /// mode without angles.
    pub(super) fn goal(
        &mut self,
        target: Target,
        opened: f32,
        shaft: Shaft,
        inside: Option<Inside>,
        dt_s: Option<f32>,
    ) -> Target {
        let led = self.lead(target, inside, dt_s);
        let Some(inside) = inside else { return self.open(target, opened, shaft, false) };
        inside.next(match led {
            Some(angle) => Target::Angle(angle),
            None => self.open(inside.target(target), opened, shaft, true),
        })
    }

    /// Returns the angle in the place of a velocity beyond a limit, where a damper would give way to a load: the angle moves inward alone.
    fn lead(&mut self, target: Target, inside: Option<Inside>, dt_s: Option<f32>) -> Option<Angle> {
        let (before, Inside { lower, upper, here, .. }) = (self.lead.take(), inside?);
        let (limit, side) = if here >= upper { (upper, 1.0) } else { (lower, -1.0) };
        let (Target::Velocity(velocity), true) = (target, side * (here - limit) >= 0.0) else {
            return None;
        };
        let wanted = -side * velocity.as_rad_per_s();
        let speed = if wanted > 0.0 { wanted } else { BACK.min(-wanted) };
        let ahead = AHEAD.max(AHEAD_S * speed);
        let anew = Lead { angle: Angle::from_radians(here), inward: 0.0, out: 0.0 };
        let out_of = |lead: &Lead| side * (here - lead.angle.as_radians());
        // A shaft that was turned further while the motor rested is not pulled back.
        let lead = before.filter(|lead| out_of(lead) - lead.out < AHEAD).unwrap_or(anew);
        let (Lead { angle, inward, .. }, out) = (lead, out_of(&lead));
        // An inward velocity leads past the limit, an outward one to it.
        let end = if wanted > 0.0 { f32::MAX } else { side * (angle.as_radians() - limit) };
        // No further outward than before, and than the shaft.
        let inward = (inward + speed * dt_s?).min(ahead - out).min(end).max(inward).max(-out);
        self.lead = Some(Lead { angle, inward, out });
        Some(angle - Angle::from_radians(side * inward))
    }

    /// Returns the target on its way. The way to an angle is the shortest one, unless it is to be `direct`.
    fn open(
        &mut self,
        target: Target,
        opened: f32,
        (angle, velocity): Shaft,
        is_direct: bool,
    ) -> Target {
        if opened >= 1.0 {
            return target;
        }
        let measured = angle.filter(|angle| angle.is_finite());
        match (target, measured) {
            (Target::Angle(target), Some(measured)) => {
                let start = *self.angle.get_or_insert(measured);
                let way = target - start;
                let way = if is_direct { way } else { way.wrapped() };
                Target::Angle(start + way * opened)
            }
            (Target::Velocity(target), _) => {
                let start = *self.velocity.get_or_insert(velocity);
                let way = target - start;
                Target::Velocity(if start.is_finite() { start + way * opened } else { target })
            }
            (Target::Impedance(target), Some(measured)) => {
                let start = *self.angle.get_or_insert(measured);
                let angle = start + (target.angle - start) * opened;
                Target::Impedance(Impedance { angle, ..target })
            }
            (target, _) => target,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn inside(here: f32, velocity: f32) -> Inside {
        Inside { lower: -1.0, upper: 2.0, here, velocity }
    }

    fn torque(here: f32, velocity: f32, torque_nm: f32) -> f32 {
        let spring = Impedance { torque_nm, ..Impedance::FREE };
        let Target::Impedance(sent) = inside(here, velocity).target(Target::Impedance(spring))
        else {
            panic!("another kind")
        };
        let alone = inside(here, velocity).target(Target::Torque(torque_nm));
        assert_eq!(alone, Target::Torque(sent.torque_nm));
        sent.torque_nm
    }

    #[test]
    fn each_part_of_a_spring_is_that_of_the_drive_where_the_joint_is_turned_round() {
        let zero = Zero::Placed(Angle::from_radians(0.5));
        let joint = Joint { sign: -1.0, zero, ..Joint::DIRECT };
        let spring = |angle, velocity, torque_nm| Impedance {
            angle: Angle::from_radians(angle),
            velocity: AngularVelocity::from_rad_per_s(velocity),
            torque_nm,
            ..Impedance::FREE
        };
        let of_drive = joint.impedance_of_drive(spring(1.25, 2.0, 3.0));
        assert_eq!(of_drive, Ok(Target::Impedance(spring(-0.75, -2.0, -3.0))));
    }

    #[test]
    fn a_spring_and_a_velocity_are_on_their_way_from_where_the_shaft_was_first() {
        let velocity = AngularVelocity::from_rad_per_s;
        let spring = |angle| {
            let angle = Angle::from_radians(angle);
            Target::Impedance(Impedance { angle, torque_nm: 3.0, ..Impedance::FREE })
        };
        let mut start = Start::NONE;
        for (opened, here, angle, speed) in [
            (0.0, 1.0, 1.0, 2.0),
            (0.25, 1.5, 2.0, 4.0),
            (0.5, 9.0, 3.0, 6.0),
            (1.0, 9.0, 5.0, 10.0),
        ] {
            let shaft = (Some(Angle::from_radians(here)), velocity(2.0 * here));
            assert_eq!(start.goal(spring(5.0), opened, shaft, None, None), spring(angle));
            let goal = start.goal(Target::Velocity(velocity(10.0)), opened, shaft, None, None);
            assert_eq!(goal, Target::Velocity(velocity(speed)));
        }
    }

    #[test]
    fn an_outward_torque_fades_then_brakes_with_way_and_velocity_and_an_inward_one_stays() {
        for (here, velocity, expected) in [
            (0.0, 0.0, 3.0),
            (1.99, 0.0, 1.5), // half of the last 0.02 rad
            (1.99, -0.5, 1.5),
            (2.0, 0.0, 0.0),
            (2.5, 0.0, 0.0),
            (2.5, 1.0, -1.5),
            (2.5, 7.0, -3.0),
            (2.5, -7.0, 0.0),
            (1.0, 5.0, 3.0), // at 10 rad/s the shaft is at the limit in 0.1 s
            (1.0, 7.5, 1.5),
            (1.0, 10.0, 0.0),
            (1.0, 12.5, -1.5),
            (1.0, 50.0, -3.0),
            (1.0, -50.0, 3.0),
            (-9.0, 0.0, 3.0),
        ] {
            assert!((torque(here, velocity, 3.0) - expected).abs() < 1e-4, "{here}, {velocity}");
            let mirrored = torque(1.0 - here, -velocity, -3.0);
            assert!((mirrored + expected).abs() < 1e-4, "{here}, {velocity}: {mirrored}");
        }
    }

    #[test]
    fn an_outward_velocity_is_the_way_in_a_tenth_of_a_second_and_leads_back_slowly_from_beyond() {
        for (here, wanted, expected) in [
            (0.0, 5.0, 5.0),
            (1.9, 5.0, 1.0),
            (2.0, 5.0, 0.0),
            (2.02, 5.0, -0.2),
            (2.5, 5.0, -0.5),
            (2.5, 0.1, -0.1),
            (2.5, -5.0, -5.0),
            (-1.5, -5.0, 0.5),
            (-0.9, -5.0, -1.0),
            (-1.5, 0.0, 0.0),
            (2.5, 0.0, 0.0),
        ] {
            let target = Target::Velocity(AngularVelocity::from_rad_per_s(wanted));
            let Target::Velocity(sent) = inside(here, 0.0).target(target) else { panic!() };
            assert!((sent.as_rad_per_s() - expected).abs() < 1e-4, "{here}, {wanted}: {sent:?}");
        }
    }

    /// Each step is 0.1 s. The place of the shaft, the target, and the angle in its place; `None` for a velocity.
    #[test]
    fn a_velocity_beyond_a_limit_is_an_angle_that_moves_inward_alone() {
        for (is_upper, turns) in [(true, 0.0), (false, 0.0), (true, TAU), (false, -TAU)] {
            // Of the limits -1 and 2 rad: mirrored, and moved on halfway.
            let place = |angle: f32, turns| turns + if is_upper { angle } else { 1.0 - angle };
            let mut start = Start::NONE;
            for (step, (here, wanted, expected)) in [
                (2.5, 3.0, Some(2.45)),
                (2.45, 0.0, Some(2.45)),
                (2.5, 0.2, Some(2.43)),
                (2.65, 9.0, Some(2.4)), // 0.25 rad ahead
                (2.7, 0.0, Some(2.4)),  // pushed
                (2.6, 9.0, Some(2.35)),
                (2.6, 9.0, Some(2.35)),
                (2.3, 9.0, Some(2.3)), // no further outward than the shaft
                (2.3, -0.2, Some(2.28)),
                (2.3, -0.6, Some(2.22)),
                (2.3, 0.1, Some(2.21)),
                (2.0, 9.0, Some(2.0)),
                (1.99, 9.0, None),
                (2.0, 9.0, Some(2.0)),
                (2.0, 9.0, Some(2.0)),
                (2.0, -0.5, Some(1.95)),
                (2.0, -2.0, Some(1.75)),
                (2.0, -2.0, Some(1.6)), // the way in 0.2 s ahead
                (2.0, -0.5, Some(1.6)),
                (2.3, -0.5, Some(2.25)), // anew
            ]
            .into_iter()
            .enumerate()
            {
                let turns = if step < 6 { 0.0 } else { turns };
                if step == 6 {
                    start.turn(Angle::from_radians(turns));
                }
                let inside = Inside {
                    lower: -1.0 + turns,
                    upper: 2.0 + turns,
                    here: place(here, turns),
                    velocity: 0.0,
                };
                let wanted =
                    AngularVelocity::from_rad_per_s(if is_upper { wanted } else { -wanted });
                let target = Target::Velocity(wanted);
                let shaft = (Some(Angle::from_radians(inside.here)), AngularVelocity::ZERO);
                // The way is that of an open output from the beginning.
                let goal = start.goal(target, 0.5, shaft, Some(inside), Some(0.1));
                match (goal, expected) {
                    (Target::Angle(angle), Some(expected)) => {
                        let off = angle.as_radians() - place(expected, turns);
                        assert!(off.abs() < 1e-5, "{step}, {is_upper}: {angle:?}");
                    }
                    (Target::Velocity(_), None) => {}
                    _ => panic!("{step}: {goal:?}"),
                }
            }
            // Neither another kind of target nor a mode without angles nor a lost zero.
            let outside = Some(inside(2.5, 0.0));
            let shaft = (Some(Angle::from_radians(2.5)), AngularVelocity::ZERO);
            let velocity = Target::Velocity(AngularVelocity::from_rad_per_s(1.0));
            for (target, inside, dt_s) in [
                (Target::Torque(1.0), outside, Some(0.1)),
                (velocity, outside, None),
                (velocity, None, Some(0.1)),
            ] {
                start.goal(velocity, 1.0, shaft, outside, Some(0.1));
                assert!(start.lead.is_some());
                let goal = start.goal(target, 1.0, shaft, inside, dt_s);
                assert!(start.lead.is_none() && !matches!(goal, Target::Angle(_)), "{goal:?}");
            }
        }
    }

    /// A quarter of a radian further outward at once, the way is anew from where the shaft is.
    #[test]
    fn a_shaft_that_was_turned_further_is_not_pulled_back() {
        for (here, expected) in [(2.2, 2.0), (2.25, 2.25), (2.3, 2.3)] {
            let (mut start, step) = (Start::NONE, Some(0.1));
            let mut goal = |here: f32| {
                let shaft = (Some(Angle::from_radians(here)), AngularVelocity::ZERO);
                let still = Target::Velocity(AngularVelocity::ZERO);
                start.goal(still, 1.0, shaft, Some(inside(here, 0.0)), step)
            };
            goal(2.0);
            assert_eq!(goal(here), Target::Angle(Angle::from_radians(expected)));
        }
    }

    /// 1400 rad/s² at most, with feedback that is a step old.
    #[test]
    fn a_light_joint_comes_to_rest_at_a_limit() {
        let (mut angle, mut velocity, mut torque_nm) = (0.0, 0.0, 0.0);
        let mut changes = 0;
        for ms in 0..3_000 {
            velocity += 1e-3 * torque_nm / 0.005;
            angle += 1e-3 * velocity;
            let next = inside(angle, velocity).torque(7.0);
            changes += u32::from(ms > 2_000 && next * torque_nm < 0.0 && next.abs() > 0.01);
            torque_nm = next;
        }
        assert!(changes == 0 && (angle - 2.0).abs() < 0.02, "{changes} changes, at {angle} rad");
    }

    #[test]
    fn an_angle_at_a_limit_or_opposite_the_middle_stays_on_one_side() {
        for (lower, upper, wanted) in
            [(-4.712_389, 4.712_389, 4.712_389), (-1.5, 1.5, core::f32::consts::PI)]
        {
            let mut angles = Vec::new();
            for step in 0_u8..200 {
                let here = upper - 0.001 * f32::from(step);
                angles.push(Inside { lower, upper, here, velocity: 0.0 }.nearest(wanted));
            }
            assert!(
                angles.iter().all(|angle| angle.to_bits() == angles[0].to_bits()),
                "{angles:?}"
            );
        }
    }

    #[test]
    fn a_spring_has_the_limits_of_its_angle_and_of_its_velocity() {
        for (here, side, expected) in [(1.9, 1.0, (2.0, 1.0)), (-0.8, -1.0, (-1.0, -2.0))] {
            let spring = Impedance {
                angle: Angle::from_radians(9.0 * side),
                velocity: AngularVelocity::from_rad_per_s(5.0 * side),
                ..Impedance::FREE
            };
            let target = inside(here, 0.0).target(Target::Impedance(spring));
            let Target::Impedance(sent) = target else { panic!() };
            assert!((sent.angle.as_radians() - expected.0).abs() < 1e-5, "{here}: {sent:?}");
            assert!((sent.velocity.as_rad_per_s() - expected.1).abs() < 1e-5, "{here}: {sent:?}");
        }
    }

    #[test]
    fn an_angle_is_reached_inside_and_one_outside_is_the_limit_next_to_it() {
        let wide = |here| Inside { lower: -4.0, upper: 4.0, here, velocity: 0.0 };
        let narrow = |here| inside(here, 0.0);
        for (inside, wanted, expected) in [
            (narrow(0.0), 1.5, 1.5),
            (narrow(0.0), 1.5 + TAU, 1.5),
            (narrow(0.0), 2.3, 2.0),
            (narrow(0.0), -1.4, -1.0),
            (narrow(1.9), -1.4, -1.0), // although 2.98 rad upward
            (narrow(2.5), 3.0, 2.0),
            (wide(0.0), 3.0, 3.0),
            (wide(3.0), -3.0, 3.283_185_5),
            (wide(3.9), -2.0, -2.0), // 0.38 rad upward lies the limit
            (wide(9.0), 9.0 - TAU, 9.0 - TAU),
            (wide(4.0), 4.0, 4.0),
            (wide(3.2), 4.5, 4.0), // a limit, and not 4.5 rad less a turn
            (wide(0.0), -4.5, -4.0),
            (wide(9.0), 9.5 - TAU, 9.5 - TAU), // inside lies -3.07 rad too, a turn further
            (wide(-9.0), TAU - 9.5, TAU - 9.5),
        ] {
            let target = Target::Angle(Angle::from_radians(wanted));
            let Target::Angle(sent) = inside.target(target) else { panic!() };
            assert!((sent.as_radians() - expected).abs() < 1e-5, "{inside:?}, {wanted}: {sent:?}");
            let Target::Angle(next) = inside.next(Target::Angle(sent)) else { panic!() };
            let way = wrap_pi(next.as_radians() - inside.here);
            assert!(way * (expected - inside.here) >= 0.0, "{inside:?}, {wanted}: {way}");
        }
    }
}
