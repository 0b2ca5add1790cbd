//! Turns and phase of an output shaft, and the positions written by users.

use super::gear::{COUNTS_PER_TURN, GearRatio};
use crate::math::limited;
use crate::units::Angle;
use core::f32::consts::TAU;
use core::num::{NonZeroI16, NonZeroU16};

/// Returns the shortest way from one 13-bit angle to the next, in counts: -4096 to 4095.
///
/// Half a turn is undecidable and is taken as -4096.
///
/// # Examples
/// ```
/// use drivetrain::encoder::shortest;
///
/// assert_eq!(shortest(8190, 1), 3); // over the top
/// assert_eq!(shortest(1, 8190), -3); // and back
/// ```
#[must_use]
pub const fn shortest(previous: u16, next: u16) -> i32 {
    const UNUSED_BITS: u32 = 32 - COUNTS_PER_TURN.trailing_zeros();
    ((next as i32 - previous as i32) << UNUSED_BITS) >> UNUSED_BITS
}

/// Turns and phase of an output shaft, advanced by rotor counts.
///
/// The phase is counted in *fine counts*: rotor counts divided by the gear's output turns. For 3591:187 a rotor
/// count is 187 fine counts and an output turn is 8192 * 3591 of them, so nothing is ever rounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shaft {
    turns: Turns,
    phase: i32,
    radians_per_fine: f32,
    /// 8192 of these are the fine counts of a turn.
    rotor: u16,
    /// Fine counts of a rotor count, negative for a reversed shaft.
    fine_per_count: NonZeroI16,
}

/// Whole turns in 64 bits, in two halves: a struct with them needs no alignment to 8 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Turns {
    high: i32,
    low: u32,
}

impl Turns {
    #[expect(clippy::cast_possible_truncation, reason = "splits")]
    pub(crate) const fn new(turns: i64) -> Self {
        Self { high: (turns >> 32) as i32, low: turns.cast_unsigned() as u32 }
    }

    /// Returns the lower half, for values stored in the place of turns.
    pub(crate) const fn low(self) -> u32 {
        self.low
    }

    pub(crate) const fn get(self) -> i64 {
        (self.high as i64) << 32 | self.low as i64
    }

    #[inline]
    const fn add(self, more: i64) -> Self {
        Self::new(self.get().wrapping_add(more))
    }
}

impl Shaft {
    /// Takes the gear, and whether the rotor's positive direction is the shaft's negative direction.
    #[must_use]
    pub(crate) const fn new(gear: GearRatio, reversed: bool) -> Self {
        #[expect(clippy::cast_possible_wrap, reason = "a gear ratio has at most 8192 output turns")]
        let output = gear.output() as i16;
        Self {
            turns: Turns::new(0),
            phase: 0,
            radians_per_fine: TAU / (COUNTS_PER_TURN as f32 * gear.rotor() as f32),
            rotor: gear.rotor(),
            fine_per_count: match NonZeroI16::new(if reversed { -output } else { output }) {
                Some(fine) => fine,
                None => NonZeroI16::MAX, // no gear has zero output turns
            },
        }
    }

    #[inline(always)]
    const fn fine_per_turn(&self) -> i32 {
        self.rotor as i32 * COUNTS_PER_TURN as i32
    }

    /// Returns whether the encoder sits on the output shaft: then its angle is known after any gap.
    #[must_use]
    pub(crate) const fn is_direct(&self) -> bool {
        self.rotor == 1 && self.fine_per_count.unsigned_abs().get() == 1
    }

    /// Starts from the first angle of the rotor: within the first turn, no turn counted.
    ///
    /// A reversed shaft sees the angle `8192 - rotor_angle`.
    pub(crate) const fn seed(&mut self, rotor_angle: u16) {
        self.set_zero();
        let angle = rotor_angle as i32 % COUNTS_PER_TURN as i32;
        let reversed = self.fine_per_count.is_negative() && angle != 0;
        self.advance_far(if reversed { angle - COUNTS_PER_TURN as i32 } else { angle });
        self.turns = Turns::new(0);
    }

    /// Makes the present position zero.
    pub(crate) const fn set_zero(&mut self) {
        self.turns = Turns::new(0);
        self.phase = 0;
    }

    /// Calls the present position `position`. A NaN or infinite angle counts as zero.
    pub(crate) const fn set_position(&mut self, position: Position) {
        (self.turns, self.phase) = self.locate(position);
    }

    /// Moves by rotor counts: at most half a rotor turn (-4096 to 4096), as [`shortest`] gives.
    #[inline(always)]
    pub(crate) const fn advance(&mut self, counts: i32) {
        let turn = self.fine_per_turn();
        let next = self.phase.wrapping_add(counts.wrapping_mul(self.fine_per_count.get() as i32));
        // One comparison for both ends: below zero is far above, unsigned.
        if next.cast_unsigned() < turn.cast_unsigned() {
            self.phase = next;
            return;
        }
        seldom();
        if next < 0 {
            self.phase = next.wrapping_add(turn);
            self.turns = self.turns.add(-1);
        } else {
            self.phase = next.wrapping_sub(turn);
            self.turns = self.turns.add(1);
        }
    }

    /// Moves by any number of rotor counts: across a gap of many turns.
    pub(crate) const fn advance_far(&mut self, counts: i32) {
        const STEP: i32 = COUNTS_PER_TURN as i32 / 2;
        let mut rest = counts;
        while rest > STEP {
            self.advance(STEP);
            rest -= STEP;
        }
        while rest < -STEP {
            self.advance(-STEP);
            rest += STEP;
        }
        self.advance(rest);
    }

    /// Returns the position as turns and angle; the angle is rounded to `f32`.
    #[must_use]
    #[inline]
    pub(crate) const fn position(&self) -> Position {
        Position { turns: self.turns.get(), angle: self.angle() }
    }

    /// Returns the angle within the turn: 0 up to, but not including, one turn.
    #[must_use]
    pub(crate) const fn angle(&self) -> Angle {
        const BELOW_ONE_TURN: f32 = TAU.next_down();
        let radians = self.phase as f32 * self.radians_per_fine;
        Angle::from_radians(if radians < TAU { radians } else { BELOW_ONE_TURN })
    }

    /// Returns the rotor's counts in the direction of the shaft, since the seed (which counts its angle) or since zero
    /// was set; exact. After a position other than zero was set, rounded to whole counts.
    #[must_use]
    #[inline]
    pub(crate) const fn rotor_counts(&self) -> i64 {
        let fine = self
            .turns
            .get()
            .wrapping_mul(self.fine_per_turn() as i64)
            .wrapping_add(self.phase as i64);
        let counts = divide(fine.unsigned_abs(), self.fine_per_count.unsigned_abs()).cast_signed();
        if fine < 0 { counts.wrapping_neg() } else { counts }
    }

    /// Returns turns and phase of a position in this shaft's counts.
    #[must_use]
    pub(crate) const fn locate(&self, position: Position) -> (Turns, i32) {
        #[expect(clippy::cast_possible_truncation, reason = "0 to one turn; NaN is 0")]
        let phase = (position.angle().as_radians() / self.radians_per_fine + 0.5) as i32;
        if phase < self.fine_per_turn() {
            (Turns::new(position.turns()), phase)
        } else {
            (Turns::new(position.turns().saturating_add(1)), 0)
        }
    }

    /// Returns the lower half of the turns of a located position; beyond a distance of 2^30 turns, the turns at 2^30
    /// turns in that direction.
    #[must_use]
    pub(crate) const fn near(&self, turns: Turns) -> u32 {
        const FAR: i64 = 1 << 30;
        let here = self.turns.get();
        let (way, is_alike) = (turns.get().wrapping_sub(here), (turns.get() ^ here) >= 0);
        // Of one sign: the difference did not overflow.
        if is_alike && way.wrapping_add(FAR).cast_unsigned() <= 2 * FAR.cast_unsigned() {
            return turns.low();
        }
        seldom();
        let way = turns.get().saturating_sub(here);
        if way > FAR {
            self.turns.add(FAR).low()
        } else if way < -FAR {
            self.turns.add(-FAR).low()
        } else {
            turns.low()
        }
    }

    /// Returns the way to a [near](Self::near) located position, in radians: exact near zero, saturated at 63 turns.
    #[must_use]
    #[inline(always)]
    pub(crate) const fn way_to(&self, turns: u32, phase: i32) -> f32 {
        let whole = turns.wrapping_sub(self.turns.low).cast_signed();
        let mut fine = phase.wrapping_sub(self.phase);
        if whole != 0 {
            let within = whole.wrapping_add(63).cast_unsigned() <= 126;
            let whole = if within { whole } else { far(whole) };
            fine = fine.wrapping_add(whole.wrapping_mul(self.fine_per_turn()));
        }
        fine as f32 * self.radians_per_fine
    }

    /// Returns the shortest way to a phase in radians: half a turn at most.
    #[must_use]
    #[inline]
    pub(crate) const fn shortest_way_to(&self, phase: i32) -> f32 {
        let turn = self.fine_per_turn();
        let way = phase.wrapping_sub(self.phase);
        let way = if way >= turn / 2 {
            way.wrapping_sub(turn)
        } else if way < -(turn / 2) {
            way.wrapping_add(turn)
        } else {
            way
        };
        way as f32 * self.radians_per_fine
    }
}

/// Marks a way as seldom: its code stands behind the other way.
#[cold]
#[inline(always)]
const fn seldom() {}

/// Returns 63 turns in the direction of `way`; seldom, and so out of the line of [`Shaft::way_to`].
#[cold]
#[inline(never)]
const fn far(way: i32) -> i32 {
    if way < 0 { -63 } else { 63 }
}

/// Divides with 32-bit divisions only; exact. Takes one of them below 2^32: an M3508 within 146 turns of its shaft.
#[inline]
const fn divide(dividend: u64, divisor: NonZeroU16) -> u64 {
    let divisor = divisor.get() as u32;
    if dividend >> 32 == 0 {
        #[expect(clippy::cast_possible_truncation, reason = "below 2^32")]
        return (dividend as u32 / divisor) as u64;
    }
    let (mut quotient, mut rest, mut shift) = (0_u64, 0_u32, 64);
    while shift > 0 {
        shift -= 16;
        let digit = rest << 16 | ((dividend >> shift) & 0xFFFF) as u32;
        quotient = quotient << 16 | (digit / divisor) as u64;
        rest = digit % divisor;
    }
    quotient
}

/// A multi-turn position of an output shaft: whole turns and an angle within the turn.
///
/// The turns are an integer, so a position keeps its resolution however far the shaft has gone.
///
/// # Examples
/// ```
/// use drivetrain::encoder::Position;
/// use drivetrain::units::Angle;
///
/// let position = Position::new(-1, Angle::from_degrees(270.0));
/// assert_eq!(position, Position::from_angle(Angle::from_degrees(-90.0)));
/// assert_eq!(position.as_turns(), -0.25);
/// assert_eq!(Position::from_turns(1_000_000).angle(), Angle::ZERO);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Position {
    turns: i64,
    angle: Angle,
}

impl Position {
    /// Zero turns, zero angle.
    pub const ZERO: Self = Self { turns: 0, angle: Angle::ZERO };

    /// Takes whole turns and an angle to add. A NaN or infinite angle is kept and later refused.
    #[must_use]
    pub const fn new(turns: i64, angle: Angle) -> Self {
        let Self { turns: more, angle } = Self::from_angle(angle);
        Self { turns: turns.saturating_add(more), angle }
    }

    /// Takes whole turns.
    #[must_use]
    pub const fn from_turns(turns: i64) -> Self {
        Self { turns, angle: Angle::ZERO }
    }

    /// Takes any angle, also of more than one turn; saturates beyond 2^31 turns.
    #[must_use]
    pub const fn from_angle(angle: Angle) -> Self {
        let turns = angle.as_turns();
        if !turns.is_finite() {
            return Self { turns: 0, angle };
        }
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let truncated = turns as i32;
        let whole = if truncated as f32 > turns { truncated.saturating_sub(1) } else { truncated };
        let rest = turns - whole as f32;
        // A negative tiny rest rounds up to a whole turn; beyond 2^31 turns nothing sensible is left, in either direction.
        if rest >= 1.0 {
            Self { turns: whole as i64 + 1, angle: Angle::ZERO }
        } else if rest < 0.0 {
            Self { turns: whole as i64, angle: Angle::ZERO }
        } else {
            Self { turns: whole as i64, angle: Angle::from_radians(rest * TAU) }
        }
    }

    /// Returns whole turns, rounded towards minus infinity.
    #[must_use]
    pub const fn turns(self) -> i64 {
        self.turns
    }

    /// Returns the angle within the turn: 0 up to, but not including, one turn.
    #[must_use]
    pub const fn angle(self) -> Angle {
        self.angle
    }

    /// Returns the position in turns, rounded to `f32`: single rotor counts are lost after some hundred turns.
    #[must_use]
    pub const fn as_turns(self) -> f32 {
        self.turns as f32 + self.angle.as_turns()
    }

    /// Returns the position as one angle, rounded to `f32`.
    #[must_use]
    pub const fn as_angle(self) -> Angle {
        Angle::from_turns(self.as_turns())
    }

    /// Returns whether the angle is neither NaN nor infinite.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.angle.is_finite()
    }
}

impl core::ops::Add<Angle> for Position {
    type Output = Self;
    fn add(self, angle: Angle) -> Self {
        Self::new(self.turns, self.angle + angle)
    }
}

/// The way from one position to another; exact near zero, rounded to `f32` far away.
impl core::ops::Sub for Position {
    type Output = Angle;
    fn sub(self, from: Self) -> Angle {
        Angle::from_turns(self.turns.saturating_sub(from.turns) as f32) + (self.angle - from.angle)
    }
}

/// Feedback may have waited in a buffer for so long, in s.
const WAITED_S: f32 = 0.04;

/// Returns the largest way in rad of a shaft between two readings so many s apart: at this velocity in rad/s for a little longer than that,
/// or with a speed limit toward a target as far away; beside that 8 rad/s, for a shaft that sped up and stopped meanwhile.
pub(crate) fn furthest(gap_s: f32, velocity: f32, (to_target, speed): (f32, f32)) -> f32 {
    let time_s = limited(gap_s, WAITED_S, f32::MAX);
    let asked = limited(speed * time_s, 0.0, to_target);
    8.0 * gap_s + limited(1.5 * velocity * time_s, asked, f32::MAX)
}

#[cfg(test)]
mod tests {
    use super::super::shortest;
    use super::*;
    use proptest::prelude::*;

    /// By hand: 8 rad/s for the gap, beside one and a half times the velocity, or the way to the target at the speed limit, for 40 ms or more.
    #[test]
    fn a_shaft_turns_so_far_between_two_readings() {
        let near = |one: f32, other: f32| assert!((one - other).abs() < 1e-6, "{one} of {other}");
        near(furthest(0.01, 3.0, (0.0, 0.0)), 0.08 + 0.18);
        near(furthest(0.1, 3.0, (0.0, 0.0)), 0.8 + 0.45);
        near(furthest(0.1, 0.0, (100.0, 5.0)), 0.8 + 0.5);
        near(furthest(0.1, 0.0, (0.2, 5.0)), 0.8 + 0.2);
        near(furthest(0.1, 3.0, (0.2, 5.0)), 0.8 + 0.45);
    }

    const M3508: (u16, u16) = (3591, 187);
    const M2006: (u16, u16) = (36, 1);

    fn shaft(gear: (u16, u16), reversed: bool) -> Shaft {
        Shaft::new(GearRatio::new(gear.0, gear.1).unwrap(), reversed)
    }

    #[test]
    fn the_first_angle_is_absolute_with_no_turn() {
        for angle in [8000, 5000, 4097, 0, 8191] {
            for gear in [M3508, M2006, (1, 1)] {
                let mut shaft = shaft(gear, false);
                shaft.seed(angle);
                assert_eq!((shaft.position().turns(), shaft.rotor_counts()), (0, i64::from(angle)));
            }
        }
    }

    #[test]
    fn thirty_six_rotor_turns_of_a_m2006_are_one_output_turn() {
        let mut shaft = shaft(M2006, false);
        shaft.seed(8000);
        for _ in 0..36 {
            [4095, 4095, 2].iter().for_each(|counts| shaft.advance(*counts));
        }
        assert_eq!(shaft.rotor_counts(), 8000 + 36 * 8192);
        assert_eq!(shaft.position().turns(), 1);
    }

    #[test]
    fn only_a_shaft_without_gear_is_direct() {
        for reversed in [false, true] {
            assert!(shaft((1, 1), reversed).is_direct());
            for gear in [(1, 2), (2, 1), (36, 1), M3508] {
                assert!(!shaft(gear, reversed).is_direct(), "{gear:?}");
            }
        }
    }

    #[test]
    fn a_reversed_geared_shaft_starts_within_its_first_rotor_turn() {
        let mut shaft = shaft(M2006, true);
        shaft.seed(2048); // three quarters of a rotor turn are left to zero
        assert!((shaft.angle().as_degrees() - 270.0 / 36.0).abs() < 1e-4);
        assert_eq!(shaft.rotor_counts(), 6144);
    }

    #[test]
    fn a_whole_turn_ends_at_zero_of_the_next() {
        let mut shaft = shaft((1, 1), false);
        shaft.advance(4096);
        shaft.advance(4096);
        assert_eq!((shaft.position().turns(), shaft.angle()), (1, Angle::ZERO));
        shaft.set_position(Position::from_angle(Angle::from_radians(TAU.next_down())));
        assert_eq!((shaft.position().turns(), shaft.angle()), (1, Angle::ZERO));
    }

    #[test]
    fn the_shortest_way_is_at_most_half_a_turn_and_half_a_turn_leads_down() {
        for (from, to, way) in [
            (0, 100, 100_i16),
            (0, 8092, -100),
            (0, 4095, 4095),
            (0, 4096, -4096),
            (4096, 0, -4096),
            (4097, 0, 4095),
            (8000, 100, 292),
            (100, 0, -100),
        ] {
            let mut shaft = shaft((1, 1), false);
            shaft.seed(from);
            let counts = shaft.shortest_way_to(to) / shaft.radians_per_fine;
            assert!((counts - f32::from(way)).abs() < 0.1, "from {from} to {to}: {counts}");
        }
    }

    #[test]
    fn a_reversed_shaft_sees_the_complement_and_turns_the_other_way() {
        let mut shaft = shaft((1, 1), true);
        shaft.seed(2048);
        assert!((shaft.angle().as_degrees() - 270.0).abs() < 1e-4);
        shaft.advance(-1024); // the rotor turns clockwise, the shaft counter-clockwise
        assert!((shaft.angle().as_degrees() - 315.0).abs() < 1e-4);
    }

    #[test]
    fn three_hundred_thousand_turns_lose_no_count() {
        for gear in [M3508, M2006, (1, 1)] {
            for reversed in [false, true] {
                let mut shaft = shaft(gear, reversed);
                shaft.seed(0);
                let (mut angle, mut expected) = (0_u16, 0_i64);
                while expected < 300_000 * 8192 {
                    let next = (angle + 4001) % 8192;
                    shaft.advance(shortest(angle, next));
                    (angle, expected) = (next, expected + 4001);
                }
                assert_eq!(shaft.rotor_counts(), if reversed { -expected } else { expected });
                assert!(expected > 1_000_000_000);
            }
        }
    }

    #[test]
    fn zeroing_then_the_next_frame_is_no_turn() {
        let mut shaft = shaft(M3508, false);
        shaft.seed(8190);
        shaft.set_zero();
        shaft.advance(shortest(8190, 3));
        assert_eq!((shaft.position().turns(), shaft.rotor_counts()), (0, 5));
    }

    #[test]
    fn a_set_position_is_read_back() {
        let mut shaft = shaft(M3508, false);
        for (turns, degrees) in [(0, 0.0), (-3, 359.9), (1_000_000_000_000, 123.4)] {
            let position = Position::new(turns, Angle::from_degrees(degrees));
            shaft.set_position(position);
            assert!((shaft.position() - position).as_degrees().abs() < 1e-4);
        }
        shaft.set_position(Position::from_angle(Angle::from_radians(f32::NAN)));
        assert_eq!(shaft.position(), Position::ZERO);
    }

    #[test]
    fn the_angle_never_reaches_a_whole_turn() {
        let mut shaft = shaft((4096, 1), false);
        shaft.seed(0);
        shaft.advance(-1);
        assert!(shaft.angle().as_radians() < TAU);
        assert_eq!(shaft.position().turns(), -1);
    }

    #[test]
    fn the_way_to_a_target_is_exact_however_far_the_shaft_has_gone() {
        let mut shaft = shaft(M3508, false);
        for turns in [0, 1_000_000, 1_000_000_000_000] {
            shaft.set_position(Position::from_turns(turns));
            let (turns, phase) = shaft.locate(Position::new(turns, Angle::from_degrees(-1.0)));
            let way_to = |turns| shaft.way_to(shaft.near(turns), phase);
            assert!((way_to(turns).to_degrees() + 1.0).abs() < 1e-4);
            for far in [-64, -500, -(1 << 30), -(1 << 31), -(1 << 32), -(1 << 32) + 1] {
                assert!((way_to(turns.add(far)) + 63.0 * TAU).abs() < 7.0, "{far}");
                assert!((way_to(turns.add(-far)) - 63.0 * TAU).abs() < 7.0, "{far}");
            }
            assert!((way_to(Turns::new(i64::MAX)) - 63.0 * TAU).abs() < 7.0);
            assert!((way_to(Turns::new(i64::MIN)) + 63.0 * TAU).abs() < 7.0);
        }
    }

    #[test]
    fn a_dividend_with_no_lower_half_is_divided() {
        let three = NonZeroU16::new(3).unwrap();
        assert_eq!(divide(3 << 32, three), 1 << 32);
    }

    #[test]
    fn the_shortest_way_crosses_zero() {
        let mut shaft = shaft((1, 1), false);
        let degrees = |degrees| Position::from_angle(Angle::from_degrees(degrees));
        for (from, to, way) in [(350.0, 10.0, 20.0_f32), (10.0, 350.0, -20.0), (0.0, 180.0, -180.0)]
        {
            shaft.set_position(degrees(from));
            let (_, phase) = shaft.locate(degrees(to));
            assert!((shaft.shortest_way_to(phase).to_degrees() - way).abs() < 0.05);
        }
    }

    proptest! {
        /// Law: turns and phase are the exact quotient and remainder of all counts moved.
        #[test]
        fn unwrapping_is_exact_integer_arithmetic(
            gear in prop::sample::select(&[M3508, M2006, (1, 1), (27, 2), (1, 2)][..]),
            first in 0_u16..8192,
            steps in prop::collection::vec(-4096_i32..4096, 0..300),
            far in -200_000_i32..200_000,
        ) {
            let mut shaft = shaft(gear, false);
            shaft.seed(first);
            let start = shaft.rotor_counts();
            let mut angle = i64::from(first);
            for step in &steps {
                #[expect(clippy::cast_possible_truncation, reason = "0..8192")]
                let (before, after) = (angle.rem_euclid(8192) as u16, (angle + i64::from(*step)).rem_euclid(8192) as u16);
                shaft.advance(shortest(before, after));
                angle += i64::from(*step);
            }
            shaft.advance_far(far);
            let moved: i64 = steps.iter().copied().map(i64::from).sum::<i64>() + i64::from(far);
            prop_assert_eq!(shaft.rotor_counts() - start, moved);
            let fine = (start + moved) * i64::from(gear.1);
            let turn = 8192 * i64::from(gear.0);
            prop_assert_eq!((shaft.turns.get(), i64::from(shaft.phase)), (fine.div_euclid(turn), fine.rem_euclid(turn)));
        }

        /// Law: division by 16-bit digits is division.
        #[test]
        fn divide_is_division(dividend: u64, shift in 0..64, divisor in 1_u16..=8192) {
            let (dividend, by) = (dividend >> shift, NonZeroU16::new(divisor).unwrap());
            prop_assert_eq!(divide(dividend, by), dividend / u64::from(divisor));
        }
    }
}

#[cfg(test)]
mod position_tests {
    use super::*;

    #[test]
    fn a_negative_tiny_angle_is_not_a_whole_turn_within_the_turn() {
        for turns in [-1e-30_f32, -1e-9, -f32::MIN_POSITIVE] {
            let position = Position::from_angle(Angle::from_turns(turns));
            assert_eq!(position, Position::ZERO);
        }
    }

    #[test]
    fn the_angle_stays_within_its_turn() {
        for degrees in [-720.0_f32, -361.0, -0.01, 0.0, 359.99, 360.0, 1e6, -1e6, 3e12, -3e12] {
            let position = Position::from_angle(Angle::from_degrees(degrees));
            let turns = position.angle().as_turns();
            assert!((0.0..1.0).contains(&turns), "{degrees}: {position:?}");
            let error = (position.as_angle().as_degrees() - degrees).abs();
            assert!(error <= 1e-6 * degrees.abs().max(360.0) || degrees.abs() > 1e12);
        }
    }

    #[test]
    fn a_position_beyond_two_to_the_31_turns_saturates_on_a_whole_turn() {
        for (degrees, turns) in [(3e12, 1 << 31), (-3e12, -1 << 31), (-f32::MAX, -1 << 31)] {
            let position = Position::from_angle(Angle::from_degrees(degrees));
            assert_eq!(position, Position::from_turns(turns), "{degrees}");
        }
    }

    #[test]
    fn a_difference_far_out_is_as_exact_as_near_zero() {
        let far = Position::from_turns(1_000_000_000_000);
        let step = Angle::from_degrees(0.1);
        assert!((((far + step) - far).as_degrees() - 0.1).abs() < 1e-5);
    }

    #[test]
    fn nan_stays_visible() {
        assert!(!Position::from_angle(Angle::from_radians(f32::NAN)).is_finite());
        assert!(!Position::from_angle(Angle::from_radians(f32::INFINITY)).is_finite());
    }
}
