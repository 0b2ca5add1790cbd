//! Frames that are compared with the speed, because more come than one motor sends: here, than the bus was told.

use super::*;
use crate::motor::{Condition, HealthConfig, Reaction};

/// Below half a turn of the rotor at no-load speed.
const PERIOD_US: u64 = 2_700;

/// A motor that sends more often than it should, since a second. What comes after it is compared.
struct Crowd {
    bus: Bus,
    motor: Handle<M3508>,
    us: u64,
}

impl Crowd {
    fn new(health: &'static HealthConfig) -> Self {
        let mut bus = Bus::new().with_feedback_rate(100);
        let motor = bus.attach(Config::<M3508>::at_once(1).with_health(health)).unwrap();
        let mut crowd = Self { bus, motor, us: 1_000 };
        for _ in 0..800 {
            crowd.hear(0, 0, PERIOD_US);
        }
        assert!(crowd.bus.health(motor).is_some_and(|health| health.feedback_hz > 300));
        assert!(!crowd.is_double());
        crowd
    }

    fn hear(&mut self, angle: i32, rpm: i16, after_us: u64) {
        self.us += after_us;
        let angle = u16::try_from(angle.rem_euclid(8_192)).unwrap();
        let now = Instant::from_micros(self.us);
        assert_eq!(self.bus.ingest(&feedback(0x201, angle, rpm), now), Ingest::Taken);
        self.bus.update(Tick::new(now, 0.001));
    }

    fn is_double(&self) -> bool {
        self.bus.conditions(self.motor).contains(Condition::DuplicateId)
    }
}

static USUAL: HealthConfig = HealthConfig::new();

/// 200 counts, and what the speed makes of two periods of 1 ms: 273 at 1000 rpm.
#[test]
fn two_motors_are_told_by_angles_that_take_turns_farther_apart_than_a_speed_explains() {
    for (rpm, apart, expected) in [
        (0, 200, false),
        (0, 201, true),
        (1_000, 470, false),
        (1_000, 476, true),
        (-1_000, 476, true),
    ] {
        let mut crowd = Crowd::new(&USUAL);
        let mut angle = 0.0;
        for frame in 0..40 {
            let other = if frame % 2 == 0 { apart } else { 0 };
            #[expect(clippy::cast_possible_truncation, reason = "some turns")]
            crowd.hear(angle as i32 + other, rpm, PERIOD_US);
            angle += f32::from(rpm) * 8_192.0 / 60_000.0 * 2.7;
        }
        assert_eq!(crowd.is_double(), expected, "{apart} counts apart at {rpm} rpm");
    }
}

/// No shaft turns around so fast, but each way is the one that the two speeds before and after it explain.
#[test]
fn ways_that_the_speeds_explain_are_those_of_one_motor() {
    let mut crowd = Crowd::new(&USUAL);
    let way = 3_318; // of 9000 rpm in 2.7 ms
    let mut angle = 0;
    for _ in 0..20 {
        for (counts, rpm) in [(0, 9_000), (way, 9_000), (0, -9_000), (-way, -9_000)] {
            angle += counts;
            crowd.hear(angle, rpm, PERIOD_US);
        }
    }
    assert!(!crowd.is_double());
}

#[test]
fn two_motors_with_one_id_are_told_until_one_of_them_is_gone() {
    static IGNORE: HealthConfig =
        HealthConfig::new().with_reaction(Condition::DuplicateId, Reaction::Ignore);
    for (health, told) in [(&USUAL, true), (&IGNORE, false)] {
        let mut crowd = Crowd::new(health);
        let mut edges = Vec::new();
        for frame in 0..3_000 {
            crowd.hear(if frame % 2 == 0 { 3_000 } else { 0 }, 0, PERIOD_US);
            edges.extend(crowd.bus.next_edge());
        }
        assert_eq!(edges.len(), usize::from(told), "8 s, and one edge: {edges:?}");
        assert_eq!(crowd.is_double(), told);
        for _ in 0..400 {
            crowd.hear(0, 0, 2 * PERIOD_US);
        }
        assert!(!crowd.is_double(), "two seconds later");
    }
}

/// Compared or not, a turn that nobody saw is not made up, and one that the speed tells is counted.
#[test]
fn a_gap_is_bridged_with_the_speed_in_a_crowd_too() {
    let mut crowd = Crowd::new(&USUAL);
    let before = crowd.bus.state(crowd.motor).unwrap().rotor_counts;
    crowd.hear(0, 9_000, PERIOD_US);
    crowd.hear(6_144, 9_000, 5_000); // 1228.8 counts a millisecond
    assert_eq!(crowd.bus.state(crowd.motor).unwrap().rotor_counts - before, 6_144);
}

#[test]
fn frames_are_compared_for_as_long_as_half_a_turn_may_not_have_passed() {
    for (gap_us, doubts) in [(2_740, 0), (2_741, 1)] {
        let mut crowd = Crowd::new(&USUAL);
        let before = crowd.bus.state(crowd.motor).unwrap().ambiguous_gaps;
        crowd.hear(0, 20_000, gap_us); // later than that, it is not possible
        let after = crowd.bus.state(crowd.motor).unwrap().ambiguous_gaps;
        assert_eq!(after - before, doubts, "{gap_us} us");
    }
}
