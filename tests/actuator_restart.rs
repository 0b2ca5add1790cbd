//! A joint whose drive may have started again: what shows it, and what does not.

#![cfg(test)]
#![expect(clippy::cast_precision_loss, reason = "milliseconds of a second")]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, Capabilities, Capability, Claim, Condition, Devices, DriveProtocol,
    HealthConfig, Ingest, MotorName, Order, Target, TargetError, Timeouts,
};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{Frame, StandardId};
use std::f32::consts::{PI, TAU};

/// A drive that reports angle and velocity in rad and rad/s, and takes an angle.
#[derive(Debug, Clone, Copy)]
struct Plain {
    angle: f32,
    velocity: f32,
    is_absolute: bool,
}

fn id(raw: u16) -> StandardId {
    StandardId::new(raw).unwrap()
}

impl DriveProtocol for Plain {
    fn name(&self) -> MotorName {
        MotorName::new("plain", 1)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let name = MotorName::new("plain", 1);
        [Claim::command(id(0x123), name), Claim::feedback(id(0x124), name)]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let [a, b, c, d, e, f, g, h] = *frame.data() else {
            return Ingest::WrongLength(frame.length());
        };
        (self.angle, self.velocity) =
            (f32::from_le_bytes([a, b, c, d]), f32::from_le_bytes([e, f, g, h]));
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rad_per_s(self.velocity)
    }

    fn angle(&self) -> Option<Angle> {
        self.angle.is_finite().then(|| Angle::from_radians(self.angle))
    }

    fn rest(&mut self) -> CanFrame {
        CanFrame::of(id(0x123), [])
    }

    fn control(&mut self, Order { target, share: _, step: _ }: Order) -> CanFrame {
        let Target::Angle(angle) = target else { return self.rest() };
        CanFrame::of(id(0x123), angle.as_radians().to_le_bytes())
    }

    fn reset(&mut self) {}

    fn capabilities(&self) -> Capabilities {
        let offered = Capabilities::of(&[Capability::Angle, Capability::Feedback]);
        if self.is_absolute { offered.with(Capability::AbsoluteAngle) } else { offered }
    }
}

fn at_ms(ms: u64) -> Instant {
    Instant::from_micros(1_000 * ms)
}

struct Bench(Actuator<Plain>);

impl Bench {
    /// A joint at a zero of its own, armed and led there.
    fn new(is_absolute: bool, angle: f32) -> Self {
        let drive = Plain { angle, velocity: 0.0, is_absolute };
        let mut bench = Self(Actuator::new(drive).with_opening(Duration::ZERO));
        bench.hear(1, angle, 0.0);
        bench.0.set_present_angle(Angle::ZERO).unwrap();
        bench.update(1, 0.001);
        bench.0.arm(at_ms(1)).unwrap();
        bench.hear(2, angle, 0.0);
        bench.0.set_angle((), Angle::ZERO).unwrap();
        assert_eq!(bench.update(2, 0.001), Some(angle));
        bench
    }

    fn hear(&mut self, ms: u64, angle: f32, velocity: f32) {
        let ([a, b, c, d], [e, f, g, h]) = (angle.to_le_bytes(), velocity.to_le_bytes());
        let frame = CanFrame::of(id(0x124), [a, b, c, d, e, f, g, h]);
        assert_eq!(self.0.ingest(&frame, at_ms(ms)), Ingest::Taken);
    }

    /// Returns the angle that the drive is sent; `None` for rest.
    fn update(&mut self, ms: u64, dt_s: f32) -> Option<f32> {
        self.0.update(Tick::new(at_ms(ms), dt_s));
        let frame = self.0.next_frame(0)?;
        frame.data().try_into().ok().map(f32::from_le_bytes)
    }

    fn angle(&self) -> Option<f32> {
        self.0.angle(()).map(Angle::as_radians)
    }
}

fn assert_near(found: Option<f32>, expected: f32) {
    assert!(found.is_some_and(|found| (found - expected).abs() < 1e-3), "{found:?}, {expected}");
}

#[test]
fn a_drive_that_counts_anew_moves_no_joint_and_no_target() {
    for gap_ms in [1, 5, 20, 99] {
        // The drive knows its angle within a turn; it lost one turn.
        let mut bench = Bench::new(true, 4.0);
        bench.hear(2 + gap_ms, 4.0 - TAU, 0.0);
        assert_near(bench.angle(), 0.0);
        if gap_ms < 10 {
            assert_near(bench.update(2 + gap_ms, 0.001), 4.0 - TAU);
        }
        // The drive counts from where it was switched on: nobody knows how far that is.
        let mut bench = Bench::new(false, 1.5);
        bench.hear(2 + gap_ms, 0.0, 0.0);
        assert_eq!((bench.angle(), bench.0.is_armed()), (None, false));
        assert_eq!(bench.update(2 + gap_ms, 0.001), None);
    }
}

/// An age of 32 bits repeats after 71 minutes, and counts as none from half of that on.
#[test]
fn a_drive_that_was_silent_for_an_hour_has_lost_its_zero() {
    for minutes in [1, 20, 36, 50, 71, 72, 110] {
        let mut bench = Bench::new(false, 1.5);
        let end = minutes * 60_000;
        for ms in (30_000..end).step_by(30_000) {
            assert_eq!(bench.update(ms, 0.001), None);
        }
        for ms in end..end + 12 {
            bench.hear(ms, 1.5, 0.0);
        }
        assert_eq!(bench.angle(), None, "{minutes} minutes");
    }
}

/// A slipped encoder, a zero set by a tool, another drive with the same id: the joint is not where its angle says.
#[test]
fn an_angle_that_jumps_by_no_whole_turn_takes_the_zero_of_a_drive_that_knows_its_angle() {
    for jump in [1.0, -1.0, PI, TAU + 1.0] {
        let mut bench = Bench::new(true, 0.5);
        bench.hear(3, 0.5 + jump, 0.0);
        assert_eq!((bench.angle(), bench.0.is_armed()), (None, false), "{jump}");
        assert_eq!(bench.update(3, 0.001), None);
        assert!(edges(&mut bench).contains(&(Condition::PositionUncertain, true)));
        assert_eq!(bench.0.set_angle((), Angle::ZERO), Err(TargetError::Relaxed));
        for ms in 4..200 {
            bench.hear(ms, 0.5 + jump, 0.0);
            assert_eq!(bench.update(ms, 0.001), None);
        }
        bench.0.arm(at_ms(199)).unwrap();
        assert_eq!(bench.0.set_angle((), Angle::ZERO), Err(TargetError::NotHomed));
        bench.0.set_present_angle(Angle::ZERO).unwrap();
        assert_eq!(bench.0.set_angle((), Angle::ZERO), Ok(()));
    }
    // Frames of 31 ms that are taken at one time, at 30 rad/s, are no jump; nor is an angle that comes back after a silence.
    let mut bench = Bench::new(true, 0.0);
    let angle = |ms: u64| 0.03 * (ms - 2) as f32;
    for (ms, of_ms) in [(36, 3), (36, 4), (36, 5), (37, 37)] {
        bench.hear(ms, angle(of_ms), 30.0);
    }
    assert_near(bench.angle(), angle(37));
    bench.hear(400, angle(37) + 1.0, 0.0);
    assert_near(bench.angle(), angle(37) + 1.0);
}

/// A held step repeats no command from before: it has the other count. Without a restart it repeats one once.
#[test]
fn a_held_step_after_a_restart_sends_no_angle_from_before() {
    let mut bench = Bench::new(true, 4.0);
    bench.hear(3, 4.0, 0.0);
    assert_eq!(bench.update(3, 0.0), Some(4.0));
    bench.hear(4, 4.0, 0.0);
    assert_eq!(bench.update(4, 0.0), None);
    let mut bench = Bench::new(true, 4.0);
    bench.hear(3, 4.0 - TAU, 0.0);
    assert_eq!(bench.update(3, 0.0), None);
    bench.hear(4, 4.0 - TAU, 0.0);
    assert_near(bench.update(4, 0.001), 4.0 - TAU);
}

#[test]
fn an_angle_within_a_turn_is_no_restart_at_its_ends() {
    for is_absolute in [true, false] {
        let mut bench = Bench::new(is_absolute, 3.0);
        for ms in 3..3_000 {
            let way = 0.006 * (ms - 3) as f32;
            bench.hear(ms, (3.0 + way + PI).rem_euclid(TAU) - PI, 6.0);
            bench.update(ms, 0.001);
            assert_near(bench.angle(), way);
        }
        assert!(bench.0.is_armed());
    }
}

#[test]
fn a_zero_given_to_a_driven_joint_is_placed() {
    let mut bench = Bench::new(true, 0.5);
    for ms in 3..300 {
        bench.hear(ms, 0.5, 0.0);
        bench.0.set_angle((), Angle::ZERO).unwrap();
        assert!(bench.update(ms, 0.001).is_some());
    }
    bench.0 = bench.0.with_zero(Angle::from_radians(0.2)).unwrap();
    bench.hear(300, 0.5, 0.0);
    assert!(bench.update(300, 0.001).is_some());
    assert_near(bench.angle(), 0.3);
    // The drive has an angle with a later frame only.
    bench.0 = bench.0.with_zero(Angle::from_radians(0.1)).unwrap();
    for (ms, angle, expected) in
        [(301, f32::NAN, None), (302, f32::NAN, None), (303, 0.5, Some(0.4))]
    {
        bench.hear(ms, angle, 0.0);
        assert!(bench.update(ms, 0.001).is_some());
        assert_eq!(bench.angle().map(|angle| (angle * 1e3).round() / 1e3), expected);
    }
}

#[test]
fn a_healthy_joint_keeps_its_zero() {
    // From rest to rest within a gap that is almost a loss.
    let mut bench = Bench::new(false, 0.0);
    bench.hear(101, 0.6, 0.0);
    assert_near(bench.angle(), 0.6);
    // The loop stood still for 31 ms, the controller kept the three oldest frames, and all of them are taken at one time.
    let mut bench = Bench::new(false, 0.0);
    let angle = |ms: u64| 0.03 * (ms - 2) as f32;
    for ms in [3, 4, 5] {
        bench.hear(36, angle(ms), 30.0);
    }
    bench.hear(37, angle(37), 30.0);
    assert_near(bench.angle(), angle(37));
    // A wheel at 200 rad/s, heard each 20 ms.
    let mut bench = Bench::new(false, 0.0);
    bench.hear(3, 0.0, 200.0);
    for ms in (23..1_000).step_by(20) {
        bench.hear(ms, 0.2 * (ms - 3) as f32, 200.0);
    }
    assert_near(bench.angle(), 0.2 * 980.0);
    // The same heard each 200 ms, with limits made for that.
    let timeouts = Timeouts::new()
        .with_feedback(Duration::from_millis(300), Duration::from_millis(500))
        .unwrap();
    let mut bench = Bench::new(false, 0.0);
    bench.0 = bench.0.with_timeouts(timeouts);
    bench.hear(3, 0.0, 200.0);
    for ms in (203..3_000).step_by(200) {
        bench.hear(ms, 0.2 * (ms - 3) as f32, 200.0);
        assert_near(bench.angle(), 0.2 * (ms - 3) as f32);
    }
    // A velocity that is no number tells nothing.
    let mut bench = Bench::new(false, 0.0);
    bench.hear(3, 0.1, f32::NAN);
    bench.hear(4, 0.2, f32::NAN);
    assert_near(bench.angle(), 0.2);
}

static WIDE: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_degrees(-270.0), Angle::from_degrees(270.0));

/// A joint with soft limits wider than a turn, whose drive counts so far.
fn limited(is_absolute: bool, angle: f32) -> Bench {
    let drive = Plain { angle, velocity: 0.0, is_absolute };
    let mut joint = Actuator::new(drive).with_opening(Duration::ZERO);
    if is_absolute {
        joint = joint.with_zero(Angle::ZERO).unwrap();
    }
    let mut bench = Bench(joint.with_health(&WIDE).unwrap());
    bench.hear(1, angle, 0.0);
    bench.update(1, 0.001);
    bench.0.set_present_angle(Angle::from_radians(angle)).unwrap();
    bench.hear(1, angle, 0.0);
    bench
}

static NARROW: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_degrees(-30.0), Angle::from_degrees(30.0));

/// A drive that knows its angle, with narrow limits around its zero, which is given or not.
fn narrow(is_given: bool) -> Bench {
    let drive = Plain { angle: 0.0, velocity: 0.0, is_absolute: true };
    let joint = Actuator::new(drive).with_opening(Duration::ZERO).with_health(&NARROW).unwrap();
    Bench(if is_given { joint.with_zero(Angle::ZERO).unwrap() } else { joint })
}

#[test]
fn limits_of_a_turn_and_more_need_a_zero() {
    let drive = Plain { angle: 0.0, velocity: 0.0, is_absolute: true };
    let refused = Actuator::new(drive).with_health(&WIDE).err();
    assert_eq!(refused, Some("soft limits of a turn and more, without a zero"));
    assert!(Actuator::new(drive).with_zero(Angle::ZERO).unwrap().with_health(&WIDE).is_ok());
    assert!(Actuator::new(Plain { is_absolute: false, ..drive }).with_health(&WIDE).is_ok());
}

/// -10 degrees are 350 degrees of a drive that counts from 0 to a turn.
#[test]
fn a_joint_is_heard_first_within_half_a_turn_of_the_middle_of_its_limits() {
    for is_given in [true, false] {
        let mut bench = narrow(is_given);
        for ms in 1..=10 {
            bench.hear(ms, 350_f32.to_radians(), 0.0);
            bench.update(ms, 0.001);
        }
        assert_near(bench.angle(), -10_f32.to_radians());
        bench.0.arm(at_ms(10)).unwrap();
        bench.0.set_angle((), Angle::ZERO).unwrap();
        bench.hear(11, 350_f32.to_radians(), 0.0);
        assert_near(bench.update(11, 0.001), TAU);
    }
    // The middle is at 175 degrees: the joint is between -5 and 355.
    static ASIDE: HealthConfig = HealthConfig::new()
        .with_soft_limits(Angle::from_degrees(100.0), Angle::from_degrees(250.0));
    for (of_drive, of_joint) in
        [(100_f32, 100_f32), (20.0, 20.0), (200.0, 200.0), (-20.0, 340.0), (358.0, -2.0)]
    {
        for is_reversed in [false, true] {
            let side = if is_reversed { -1.0 } else { 1.0 };
            let drive = Plain { angle: 0.0, velocity: 0.0, is_absolute: true };
            let joint = Actuator::new(drive).with_health(&ASIDE).unwrap();
            let mut bench = Bench(if is_reversed { joint.reversed() } else { joint });
            bench.hear(1, side * of_drive.to_radians(), 0.0);
            bench.update(1, 0.001);
            assert_near(bench.angle(), of_joint.to_radians());
        }
    }
}

/// An armed joint is placed when its angle comes, and rests until then.
#[test]
fn a_joint_whose_angle_comes_late_has_its_limits_from_then_on() {
    for is_given in [true, false] {
        let mut bench = narrow(is_given);
        for ms in 1..60 {
            bench.hear(ms, f32::NAN, 0.0);
            if ms == 10 {
                bench.0.arm(at_ms(10)).unwrap();
            }
            if ms >= 10 && !is_given {
                assert!(bench.0.health().conditions.contains(Condition::SoftLimit));
            }
            assert_eq!(bench.update(ms, 0.001), None);
        }
        bench.hear(60, 0.2, 0.0);
        bench.update(60, 0.001);
        bench.hear(61, 0.2, 0.0);
        bench.0.set_angle((), Angle::from_radians(1.5)).unwrap();
        assert_near(bench.update(61, 0.001), 30_f32.to_radians());
    }
}

/// The first frame after a silence has no angle yet.
#[test]
fn a_silence_before_an_angle_that_comes_later_takes_no_zero_of_a_drive_that_knows_its_angle() {
    let mut bench = Bench::new(true, 1.0);
    bench.hear(300, f32::NAN, 0.0);
    bench.hear(320, 1.2, 0.0);
    assert_near(bench.angle(), 0.2);
    bench.hear(600, f32::NAN, 0.0);
    bench.hear(620, 1.2 - TAU, 0.0);
    assert_near(bench.angle(), 0.2);
}

/// From one end of the range of a drive that counts over two turns each way to the other.
#[test]
fn a_count_that_wraps_in_a_silence_is_no_motion() {
    let mut bench = Bench::new(true, 12.5);
    bench.hear(202, -12.5, 0.0);
    assert_near(bench.angle(), 4.0 * TAU - 25.0);
}

#[test]
fn a_forgotten_zero_takes_the_target_with_it() {
    let mut bench = Bench::new(true, 0.9);
    bench.0.set_angle((), Angle::ZERO).unwrap();
    bench.0.forget_zero();
    bench.hear(3, 0.9, 0.0);
    assert_eq!(bench.update(3, 0.001), None);
}

fn edges(bench: &mut Bench) -> Vec<(Condition, bool)> {
    std::iter::from_fn(|| bench.0.next_edge()).map(|edge| (edge.condition, edge.began)).collect()
}

/// The program starts again, and the drive has kept its count.
#[test]
fn a_joint_with_soft_limits_counts_as_its_drive_and_keeps_its_turns_over_a_restart() {
    let mut bench = limited(true, 3.5);
    assert_near(bench.angle(), 3.5);
    bench.hear(2, 3.5 - TAU, 0.0);
    assert_near(bench.angle(), 3.5);
}

/// Further than a turn from its zero, a drive has not started again: the joint has turned in a silence. A turn from there it may have, and
/// a count that is one and a half turns further has wrapped: the joint has turned by half a turn at most.
#[test]
fn a_joint_that_turned_in_a_silence_is_where_its_drive_counts() {
    let mut bench = limited(true, 0.3);
    for (ms, angle) in [(500, 6.4), (1_000, 9.9)] {
        bench.hear(ms, angle, 0.0);
        assert_near(bench.angle(), angle);
    }
    for (from, to, expected) in [
        (0.3, 8.8, 8.8),
        (0.3, TAU, 0.0),
        (0.3, 9.8, 9.8 - 2.0 * TAU),
        (0.0, 1.5 * TAU, -PI), // as near as PI, and on the side of `wrap_pi`
    ] {
        let mut bench = limited(true, from);
        bench.hear(500, to, 0.0);
        assert_near(bench.angle(), expected);
    }
}

#[test]
fn a_joint_with_soft_limits_rests_while_its_angle_is_not_known() {
    let mut bench = limited(true, 4.5);
    bench.0.arm(at_ms(1)).unwrap();
    bench.0.set_angle((), Angle::from_radians(4.6)).unwrap();
    bench.hear(2, 4.5, 0.0);
    assert_near(bench.update(2, 0.001), 4.6);
    bench.hear(3, f32::NAN, 0.0);
    bench.0.set_angle((), Angle::from_radians(4.6)).unwrap();
    assert_eq!(bench.update(3, 0.001), None);
    assert!(bench.0.health().conditions.contains(Condition::SoftLimit));
    bench.hear(4, 4.5, 0.0);
    bench.0.set_angle((), Angle::from_radians(4.6)).unwrap();
    assert_near(bench.update(4, 0.001), 4.6);
}

#[test]
fn a_lost_zero_is_an_edge_until_it_is_set_again() {
    let mut bench = limited(false, 1.5);
    bench.0.set_present_angle(Angle::ZERO).unwrap();
    bench.update(2, 0.001);
    edges(&mut bench);
    bench.hear(3, 0.0, 0.0);
    bench.hear(4, 9.0, 0.0);
    bench.update(4, 0.001);
    assert!(edges(&mut bench).contains(&(Condition::PositionUncertain, true)));
    bench.0.set_present_angle(Angle::ZERO).unwrap();
    assert_eq!(edges(&mut bench).last(), Some(&(Condition::PositionUncertain, false)));
}

#[test]
fn a_forgotten_zero_takes_the_limits_with_it() {
    let mut bench = limited(false, 1.5);
    bench.0.set_present_angle(Angle::from_degrees(300.0)).unwrap();
    bench.update(2, 0.001);
    assert!(bench.0.health().conditions.contains(Condition::SoftLimit));
    bench.0.forget_zero();
    // Without an angle of the drive too.
    for (ms, angle) in [(3, 1.5), (4, f32::NAN)] {
        bench.hear(ms, angle, 0.0);
        bench.update(ms, 0.001);
        assert!(!bench.0.health().conditions.contains(Condition::SoftLimit));
    }
    bench.0.arm(at_ms(4)).unwrap();
    assert_eq!(bench.0.set_angle((), Angle::ZERO), Err(TargetError::NotHomed));
}

/// A motion from where the shaft is, in the time of an opening; at once where the new zero is at a limit or between both.
#[test]
fn a_new_zero_beyond_a_limit_moves_the_joint_back_from_where_it_is() {
    // The joint, its target, and the way between.
    for (here, target, way, opens) in [
        (360.0, 360.0, -90.0, true),
        (-360.0, -360.0, 90.0, true),
        (270.0, 240.0, -30.0, false),
        (-270.0, -240.0, 30.0, false),
        (100.0, 120.0, 20.0, false),
    ] {
        let mut bench = limited(true, 0.0);
        bench.0 = bench.0.with_opening(Duration::from_millis(200));
        bench.0.arm(at_ms(1)).unwrap();
        for ms in 2..400 {
            bench.hear(ms, 0.0, 0.0);
            bench.0.set_angle((), Angle::ZERO).unwrap();
            bench.update(ms, 0.001);
        }
        bench.0.set_present_angle(Angle::from_degrees(here)).unwrap();
        for ms in 400..601 {
            bench.hear(ms, 0.0, 0.0);
            bench.0.set_angle((), Angle::from_degrees(target)).unwrap();
            let sent = bench.update(ms, 0.001).unwrap();
            let opened = if opens { (ms - 400) as f32 / 200.0 } else { 1.0 };
            let expected = f32::to_radians(way) * opened;
            assert!((sent - expected).abs() < 0.02, "{here}, {ms} ms: {sent} rad");
        }
    }
}

/// Feedback that comes and goes tells the limit once.
#[test]
fn a_joint_at_a_limit_is_told_once_over_late_feedback() {
    let mut bench = limited(true, 4.8);
    let mut begun = 0;
    for ms in 2..200 {
        if ms % 15 < 2 {
            bench.hear(ms, 4.8, 0.0);
        }
        bench.update(ms, 0.001);
        begun += edges(&mut bench).iter().filter(|edge| edge.0 == Condition::SoftLimit).count();
    }
    assert_eq!(begun, 1);
}

#[test]
fn turns_are_not_known_after_a_tenth_of_a_second_of_feedback_without_an_angle() {
    for (silent_ms, expected) in [(98, Some(0.0)), (110, None), (300, None)] {
        let mut bench = Bench::new(true, 4.0);
        for ms in 3..3 + silent_ms {
            bench.hear(ms, f32::NAN, 0.0);
        }
        bench.hear(3 + silent_ms, 4.0 - TAU, 0.0);
        assert_eq!(bench.angle().map(f32::round), expected, "{silent_ms} ms");
        assert_eq!(bench.0.is_armed(), expected.is_some());
    }
}

#[test]
fn a_gap_as_long_as_the_limit_of_late_feedback_or_100_ms_is_no_silence() {
    let limit = Duration::from_millis(300);
    let patient = Timeouts::new().with_feedback(limit, Duration::from_millis(500)).unwrap();
    for (timeouts, gap_ms, expected) in [
        (Timeouts::new(), 100, Some(0.0)),
        (Timeouts::new(), 101, None),
        (patient, 300, Some(0.0)),
        (patient, 301, None),
    ] {
        let mut bench = Bench::new(false, 1.5);
        bench.0 = bench.0.with_timeouts(timeouts);
        bench.hear(2 + gap_ms, 1.5, 0.0);
        assert_eq!(bench.angle(), expected, "{gap_ms} ms");
    }
}

#[test]
fn a_drive_that_knows_its_angle_has_soft_limits_from_its_own_zero() {
    static LIMITS: HealthConfig =
        HealthConfig::new().with_soft_limits(Angle::from_radians(-2.0), Angle::from_radians(0.7));
    // The target of the joint, and that of a drive at 0.5 rad.
    for (is_absolute, is_reversed, wanted, sent) in [
        (true, false, 1.5, 0.7),
        (true, false, -2.5, -2.0),
        (true, true, 1.5, -0.7),
        (true, true, -2.5, 2.0),
        (false, false, 1.5, 1.5),
    ] {
        let drive = Plain { angle: 0.5, velocity: 0.0, is_absolute };
        let own = Actuator::new(drive).with_opening(Duration::ZERO).with_health(&LIMITS).unwrap();
        let mut bench = Bench(if is_reversed { own.reversed() } else { own });
        for ms in 1..=3 {
            bench.hear(ms, 0.5, 0.0);
            bench.update(ms, 0.001);
        }
        bench.0.arm(at_ms(3)).unwrap();
        bench.0.set_angle((), Angle::from_radians(wanted)).unwrap();
        bench.hear(4, 0.5, 0.0);
        assert_near(bench.update(4, 0.001), sent);
    }
}

/// With the defaults of the trait: no question, so a drive that reports by itself, oftener than the loop runs.
#[test]
fn a_drive_that_reports_by_itself_is_alone_however_often_it_does() {
    for (period, reports) in [(1, 1), (1, 2), (2, 1), (4, 2)] {
        let mut bench =
            Bench(Actuator::new(Plain { angle: 0.0, velocity: 0.0, is_absolute: false }));
        for ms in 1..4_000 {
            (0..reports).for_each(|_| bench.hear(ms, 0.0, 0.0));
            if ms % period == 0 {
                bench.update(ms, 0.001);
            }
        }
        assert_eq!(bench.0.arm(at_ms(3_999)), Ok(()), "each {period} ms, {reports} reports a ms");
    }
}
