use crate::encoder::Position;
use crate::units::AngularVelocity;
use core::f32::consts::TAU;

/// Share of a chamber's angle below which the shot counts.
const COUNTED_SHARE: f32 = 0.1;
/// Share of a chamber's angle below which the next shot may be released: the loader then need not slow down between two shots.
const NEXT_SHARE: f32 = 0.5;
/// Share of its target speed below which a loader counts as standing.
const STANDS_SHARE: f32 = 0.2;
/// Longest time of the turn back.
const BACK_S: f32 = 0.2;
/// Length of the turn back, in chambers.
const BACK_SHARE: f32 = 0.5;
/// Distance beyond the chambers to come at which the grid is not known any more, in chambers.
const LOST_SHARE: f32 = 1.0;
/// Turn by its measured velocity after which a loader must have passed a chamber, in chambers: less than two, so no second ball follows.
const UNCOUNTED_SHARE: f32 = 1.0 + NEXT_SHARE;

/// Result of a step of the loader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Feed {
    /// No shot is in the loader.
    Idle,
    /// Turns to the goal at this speed in rad/s.
    Forward(f32),
    /// Turns back at this speed in rad/s.
    Back(f32),
    /// Stood again after the last attempt.
    Jammed,
    /// The position contradicts the chambers to come, or the measured velocity.
    Lost,
}

/// A chamber of the grid, as turns and chambers since the first. A count of chambers alone would need a 64-bit division.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Chamber {
    turns: i64,
    within: u8,
}

impl Chamber {
    const FIRST: Self = Self { turns: 0, within: 0 };

    /// Returns the chamber `more` further on.
    const fn after(self, more: u8, chambers: u8) -> Self {
        let mut chamber = self;
        let mut left = more;
        while left > 0 {
            left -= 1;
            let is_last = chamber.within.saturating_add(1) >= chambers;
            chamber.turns = chamber.turns.saturating_add(is_last as i64);
            chamber.within = if is_last { 0 } else { chamber.within + 1 };
        }
        chamber
    }

    /// Returns the chamber `less` before.
    const fn before(self, less: u8, chambers: u8) -> Self {
        let mut chamber = self;
        let mut left = less;
        while left > 0 {
            left -= 1;
            let is_first = chamber.within == 0;
            chamber.turns = chamber.turns.saturating_sub(is_first as i64);
            chamber.within = if is_first { chambers.saturating_sub(1) } else { chamber.within - 1 };
        }
        chamber
    }
}

/// Chambers of the loader, counted from its first position. The grid is exact over any number of turns.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Loader {
    chambers: u8,
    tries_allowed: u8,
    home: Option<Position>,
    /// The last chamber passed, and the number of chambers to follow: released shots.
    counted: Chamber,
    waiting: u8,
    /// Turn since the last count by the measured velocity, in rad.
    turned_rad: f32,
    stood_s: f32,
    /// Rest of the time for the turn back in s, and distance to the goal in rad at its beginning.
    back: Option<(f32, f32)>,
    tries: u8,
}

impl Loader {
    pub(super) const fn new(chambers: u8, tries_allowed: u8) -> Self {
        Self {
            chambers,
            tries_allowed,
            home: None,
            counted: Chamber::FIRST,
            waiting: 0,
            turned_rad: 0.0,
            stood_s: 0.0,
            back: None,
            tries: 0,
        }
    }

    /// Drops pending shots.
    pub(super) fn stop(&mut self) {
        self.waiting = 0;
        (self.turned_rad, self.stood_s) = (0.0, 0.0);
        self.back = None;
        self.tries = 0;
    }

    /// Begins at the present position. The grid stays, so the next shot completes a chamber already begun. If the loader is far from its
    /// last position, the grid begins anew.
    pub(super) fn start(&mut self, position: Position) {
        self.stop();
        let passed = COUNTED_SHARE - self.way_rad(position, self.counted) / self.pitch_rad();
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let whole = passed as i32 - i32::from(passed < 0.0);
        match (u8::try_from(whole.unsigned_abs()), self.home.is_some()) {
            (Ok(chambers), true) if whole >= 0 => self.counted = self.ahead(chambers),
            (Ok(chambers), true) => self.counted = self.counted.before(chambers, self.chambers),
            _ => (self.home, self.counted) = (Some(position), Chamber::FIRST),
        }
        self.turned_rad = -self.way_rad(position, self.counted);
    }

    /// Sets how often a jam of one shot may be tried to clear.
    pub(super) const fn allow_tries(&mut self, tries: u8) {
        self.tries_allowed = tries;
    }

    pub(super) const fn tries(&self) -> u8 {
        self.tries
    }

    pub(super) const fn is_feeding(&self) -> bool {
        self.waiting > 0
    }

    /// Tells whether the loader can accept one more shot without losing its position in the grid.
    pub(super) fn takes_next(&self, position: Position) -> bool {
        self.back.is_none()
            && self.way_rad(position, self.ahead(self.waiting)) < NEXT_SHARE * self.pitch_rad()
    }

    pub(super) const fn admit(&mut self) {
        self.waiting = self.waiting.saturating_add(1);
    }

    /// Turns to the due chamber. Returns the motion of the loader, and the number of shots counted.
    pub(super) fn step(
        &mut self,
        (position, velocity): (Position, AngularVelocity),
        (feed, gain_per_s, jam_s): (f32, f32, f32),
        dt_s: f32,
    ) -> (Feed, u32) {
        let pitch = self.pitch_rad();
        let mut counted = 0;
        let turned_rad = self.turned_rad + velocity.as_rad_per_s() * dt_s;
        self.turned_rad = turned_rad.max(-LOST_SHARE * pitch);
        while self.is_feeding() && self.way_rad(position, self.ahead(1)) <= COUNTED_SHARE * pitch {
            self.counted = self.ahead(1);
            self.waiting -= 1;
            counted += 1;
            (self.turned_rad, self.stood_s) = (0.0, 0.0);
            (self.back, self.tries) = (None, 0);
        }
        let way = self.way_rad(position, self.ahead(self.waiting));
        let has_rolled_on = way < -LOST_SHARE * pitch && way > -2.0 * LOST_SHARE * pitch;
        if !self.is_feeding() && has_rolled_on {
            // By itself, or by hand: no shot of an order.
            self.start(position);
            return (Feed::Idle, counted);
        }
        if self.is_lost(way / pitch) {
            return (Feed::Lost, counted);
        }
        if !self.is_feeding() {
            // The part of a chamber that is begun counts for the next shot.
            (self.turned_rad, self.stood_s) = (-way, 0.0);
            return (Feed::Idle, counted);
        }
        if let Some((left_s, from)) = self.back {
            let left_s = left_s - dt_s;
            let is_done = left_s <= 0.0 || way - from >= BACK_SHARE * pitch;
            self.back = (!is_done).then_some((left_s, from));
            return (Feed::Back(-feed), counted);
        }
        let target = (gain_per_s * way).min(feed);
        let stands = velocity.as_rad_per_s() < STANDS_SHARE * target;
        self.stood_s = if stands { self.stood_s + dt_s } else { 0.0 };
        if self.stood_s < jam_s {
            return (Feed::Forward(target), counted);
        }
        self.stood_s = 0.0;
        if self.tries >= self.tries_allowed {
            return (Feed::Jammed, counted);
        }
        self.tries += 1;
        self.back = Some((BACK_S, way));
        (Feed::Back(-feed), counted)
    }

    /// Tells whether a distance to the goal, in chambers, or the turn without a count shows a position that is not that of the shaft.
    fn is_lost(&self, way: f32) -> bool {
        let to_come = f32::from(self.waiting) + BACK_SHARE * f32::from(self.tries);
        let is_uncounted =
            self.is_feeding() && self.turned_rad > UNCOUNTED_SHARE * self.pitch_rad();
        way > to_come + LOST_SHARE || way < -LOST_SHARE || is_uncounted
    }

    const fn pitch_rad(&self) -> f32 {
        TAU / self.chambers as f32
    }

    const fn ahead(&self, more: u8) -> Chamber {
        self.counted.after(more, self.chambers)
    }

    /// Returns the distance from a position to a chamber in rad, positive if the chamber lies ahead. Large distances saturate.
    fn way_rad(&self, position: Position, chamber: Chamber) -> f32 {
        const FAR: i64 = 1 << 20;
        let Some(home) = self.home else { return 0.0 };
        let turns = chamber.turns.saturating_add(home.turns()).saturating_sub(position.turns());
        let turns = i32::try_from(turns.clamp(-FAR, FAR)).unwrap_or(0);
        let angle = home.angle().as_radians() - position.angle().as_radians();
        turns as f32 * TAU + angle + f32::from(chamber.within) * self.pitch_rad()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Angle, AngularVelocity};

    #[test]
    fn the_grid_is_exact_after_a_million_turns() {
        let mut loader = Loader::new(7, 3);
        let start = Angle::from_degrees(359.0);
        loader.start(Position::new(-3, start));
        for turns in [0, 1, 1_000_000, 1 << 40] {
            let there = Position::new(-3 + turns, start);
            loader.counted = Chamber { turns, within: 0 };
            assert!(loader.way_rad(there, loader.counted).abs() < 1e-6);
            for more in 1..=21 {
                let way = loader.way_rad(there, loader.ahead(more));
                assert!((way - f32::from(more) * TAU / 7.0).abs() < 1e-5, "{more}: {way}");
            }
        }
        assert_eq!(loader.ahead(8).within, 1);
    }

    fn at(degrees: f32, rad_per_s: f32) -> (Position, AngularVelocity) {
        let position = Position::from_angle(Angle::from_degrees(degrees));
        (position, AngularVelocity::from_rad_per_s(rad_per_s))
    }

    const RATES: (f32, f32, f32) = (5.0, 20.0, 0.1);

    #[test]
    fn a_shot_counts_at_nine_tenths_of_its_way_and_the_next_may_follow_at_half() {
        let mut loader = Loader::new(8, 3); // 45 degrees
        loader.start(at(10.0, 0.0).0);
        assert_eq!(loader.step(at(10.0, 0.0), RATES, 0.001), (Feed::Idle, 0));
        loader.admit();
        assert!(!loader.takes_next(at(30.0, 5.0).0));
        assert!(loader.takes_next(at(33.0, 5.0).0));
        assert_eq!(loader.step(at(50.0, 5.0), RATES, 0.001).1, 0);
        assert_eq!(loader.step(at(51.0, 5.0), RATES, 0.001), (Feed::Idle, 1));
        loader.admit();
        assert_eq!(loader.step(at(51.0, 0.0), RATES, 0.001), (Feed::Forward(5.0), 0));
    }

    /// Returns the true way of one shot in chambers, and whether the shot ended in a fault within 20 s. From the true angle in degrees,
    /// `reported` makes the angle and the share of the velocity that the loader reports.
    fn turned(reported: impl Fn(f32) -> (f32, f32)) -> (f32, bool) {
        let mut loader = Loader::new(8, 3);
        loader.start(at(0.0, 0.0).0);
        loader.admit();
        let (mut degrees, mut rad_per_s) = (0.0_f32, 0.0_f32);
        for _ in 0..20_000 {
            degrees += (0.001 * rad_per_s).to_degrees();
            let (position, share) = reported(degrees);
            rad_per_s = match loader.step(at(position, share * rad_per_s), RATES, 0.001).0 {
                Feed::Forward(velocity) | Feed::Back(velocity) => velocity,
                Feed::Idle => 0.0,
                Feed::Jammed | Feed::Lost => return (degrees / 45.0, true),
            };
        }
        (degrees / 45.0, false)
    }

    #[test]
    fn a_position_that_jumps_or_stands_ends_the_shot_before_a_second_chamber() {
        assert!((0.9..1.1).contains(&turned(|degrees| (degrees, 1.0)).0));
        for jump in [-7_200.0, -360.0, -90.0, -46.0, -45.0, -30.0, 90.0, 360.0] {
            for from in [1.0, 20.0, 39.0] {
                let (way, _) = turned(|is| (if is > from { is + jump } else { is }, 1.0));
                assert!(way < 1.6, "{jump} from {from}: {way} chambers");
            }
        }
        let (way, is_fault) = turned(|is| (if is > 20.0 { is - 7_200.0 } else { is }, 1.0));
        assert!(is_fault && way < 0.5, "{way} chambers");
        // Of each chamber anew, and a position that stands while the shaft turns.
        let (way, is_fault) = turned(|is| (is % 20.0, 1.0));
        assert!(is_fault && way < 1.6, "{way} chambers");
        let (way, is_fault) = turned(|is| (is.min(20.0), 1.0));
        assert!(is_fault && way < 1.6, "{way} chambers");
    }

    #[test]
    fn a_shot_that_completes_a_chamber_ends_before_a_second_one_too() {
        for begun in [0.0, 0.3, 0.5, 0.85, 0.89] {
            for idle in [false, true] {
                let mut loader = Loader::new(8, 3);
                loader.start(at(0.0, 0.0).0);
                let from = begun * 45.0;
                loader.start(at(from, 0.0).0);
                if idle {
                    assert_eq!(loader.step(at(from, 0.0), RATES, 0.001), (Feed::Idle, 0));
                }
                loader.admit();
                // Its position stands, its velocity does not.
                let mut way = begun;
                while let (Feed::Forward(rate), _) = loader.step(at(from, 5.0), RATES, 0.001) {
                    way += 0.001 * 5.0_f32.to_degrees() / 45.0;
                    assert!(rate > 0.0 && way < 1.6, "{begun}: {way} chambers");
                }
            }
        }
    }

    #[test]
    fn a_loader_that_rolls_on_without_an_order_goes_on_from_there() {
        let mut loader = Loader::new(8, 3);
        loader.start(at(0.0, 0.0).0);
        for degrees in 0..200_u8 {
            let rolled = at(f32::from(degrees), 3.0);
            assert_eq!(loader.step(rolled, RATES, 0.001), (Feed::Idle, 0));
        }
        loader.admit();
        assert!(matches!(loader.step(at(199.0, 0.0), RATES, 0.001), (Feed::Forward(_), 0)));
        assert_eq!(loader.step(at(221.0, 0.0), RATES, 0.001), (Feed::Idle, 1));
    }

    #[test]
    fn a_loader_that_was_turned_by_hand_goes_on_to_the_next_chamber_of_its_grid() {
        let mut loader = Loader::new(8, 3);
        loader.start(at(0.0, 0.0).0);
        for (degrees, way) in [
            (0.0, 45.0),
            (20.0, 25.0),
            (40.0, 5.0),
            (41.0, 49.0),
            (135.0, 45.0),
            (-10.0, 10.0),
            (-200.0, 20.0),
        ] {
            let position = at(degrees, 0.0).0;
            loader.start(position);
            let next = loader.way_rad(position, loader.ahead(1)).to_degrees();
            assert!((next - way).abs() < 1e-3, "{degrees}: {next}");
        }
        // The motor lost its turns: it counts from where it stands.
        let far = Position::new(-5_000, Angle::from_degrees(17.0));
        loader.start(far);
        assert!((loader.way_rad(far, loader.ahead(1)).to_degrees() - 45.0).abs() < 1e-3);
    }
}
