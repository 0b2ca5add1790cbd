//! Soft limits: 0.5 to 2 rad, on a motor whose encoder is on its shaft; 1304 counts are 1 rad.

use super::watching::{Bench, CALM, SOUND, Told};
use super::*;
use crate::motor::{Condition, HealthConfig};

static LIMITS: HealthConfig =
    HealthConfig::new().with_soft_limits(Angle::from_radians(0.5), Angle::from_radians(2.0));
const STILL: Told = Told { rpm: 0, counts_per_ms: 0, ..CALM };

fn config() -> Config<Gm6020Voltage> {
    Config::at_once(1).with_health(&LIMITS)
}

/// Moves the shaft to an angle, as one that is carried there, and tells what is left of both directions after a look, and
/// whether the limit is told.
fn at(bench: &mut Bench<Gm6020Voltage>, counts: u16, rpm: i16) -> (bool, bool, bool) {
    bench.angle = counts;
    let told = Told { rpm, ..STILL };
    let limited = bench.run(24, told, 0).contains(Condition::SoftLimit);
    let up = bench.tick(told, 5_000) != 0;
    let down = bench.tick(told, -5_000) != 0;
    bench.tick(told, 0);
    (down, up, limited)
}

#[test]
fn a_limit_takes_the_outward_direction_and_is_over_a_hundredth_of_a_radian_inside() {
    let mut bench = Bench::new(config());
    for (counts, expected) in [
        (1_300, (true, true, false)),
        (652, (true, true, false)), // 0.5001 rad
        (651, (false, true, true)), // 0.4993
        (660, (true, true, true)),  // 0.5062: not quite away from it
        (666, (true, true, false)), // 0.5108
        (660, (true, true, false)), // coming from inside
        (100, (false, true, true)),
        (1_300, (true, true, false)),
        (2_607, (true, true, false)), // 1.9996
        (2_608, (true, false, true)), // 2.0003
        (2_600, (true, true, true)),  // 1.9942
        (2_594, (true, true, false)), // 1.9896
        (3_000, (true, false, true)),
        (652, (true, true, true)),
        (1_300, (true, true, false)),
    ] {
        assert_eq!(at(&mut bench, counts, 0), expected, "{counts}");
    }
}

/// 100 rpm are 10.5 rad/s: 0.12 rad from one look to the next.
#[test]
fn a_shaft_that_will_be_beyond_a_limit_at_the_next_look_is_not_driven_there() {
    for (counts, rpm, expected) in [
        (2_550, 100, (true, false, true)), // 1.956 rad
        (2_550, -100, (true, true, false)),
        (2_400, 100, (true, true, false)), // 1.841
        (700, -100, (false, true, true)),  // 0.537
        (700, 100, (true, true, false)),
        (850, -100, (true, true, false)), // 0.652
    ] {
        let mut bench = Bench::new(config());
        assert_eq!(at(&mut bench, counts, rpm), expected, "{counts} at {rpm} rpm");
    }
}

#[test]
fn limits_are_those_of_the_shaft_however_the_motor_is_mounted_and_count_at_once() {
    for (config, sign) in [(config(), 1), (config().reversed(), -1)] {
        let mut bench = Bench::new(config);
        for (radians, down, up) in [(2.1, -5_000, 0), (0.4, 0, 5_000)] {
            let is_at = |bench: &mut Bench<Gm6020Voltage>, radians| {
                let here = Position::from_angle(Angle::from_radians(radians));
                bench.bus.set_present_position(bench.motor, here).unwrap();
            };
            is_at(&mut bench, 1.0);
            assert_eq!(bench.run(24, STILL, 0), SOUND);
            assert_eq!(bench.tick(STILL, -5_000), sign * -5_000);
            assert_eq!(bench.tick(STILL, 5_000), sign * 5_000);
            is_at(&mut bench, radians);
            assert_eq!(bench.tick(STILL, -5_000), sign * down, "down at {radians} rad");
            assert_eq!(bench.tick(STILL, 5_000), sign * up, "up at {radians} rad");
        }
    }
}

#[test]
fn a_geared_motor_has_no_limits_before_somebody_has_told_where_it_is() {
    static AROUND: HealthConfig =
        HealthConfig::new().with_soft_limits(Angle::from_radians(-1.0), Angle::from_radians(-0.5));
    let mut bench = Bench::new(Config::<M3508>::at_once(1).with_health(&AROUND));
    assert_eq!(bench.run(30, STILL, 5_000), SOUND);
    assert_eq!(bench.tick(STILL, 5_000), 5_000);
    bench.bus.zero(bench.motor).unwrap();
    assert_eq!(bench.tick(STILL, 5_000), 0);
    assert_eq!(bench.tick(STILL, -5_000), -5_000);
    assert_eq!(bench.run(30, STILL, 0), SOUND.with(Condition::SoftLimit));
}

/// P of 1 rad/s a radian, and 1 V per rad/s: 0.015 rad inside of a limit a load is held.
#[test]
fn a_position_beyond_a_limit_is_taken_to_it() {
    let mut bench = Bench::new(config().position_loop(SPEED, SPEED));
    bench.angle = 1_304;
    bench.run(24, STILL, 0);
    for (target, way) in
        [(1.5, 0.5), (0.7, -0.3), (5.0, 0.985), (-3.0, -0.485), (2.0, 0.985), (0.5, -0.485)]
    {
        let target = Position::from_angle(Angle::from_radians(target));
        bench.bus.relax(bench.motor);
        bench.ms += 1;
        bench.hear(STILL);
        bench.bus.set_position(bench.motor, target).unwrap();
        step(&mut bench.bus, bench.ms);
        let volts = f32::from(sent(&mut bench.bus)[0].1[0]) * 24.0 / 25_000.0;
        assert!((volts - way).abs() < 2e-3, "{volts} V, {way} rad to {target:?}");
    }
}

/// P of 1 rad/s a radian, and 1 V per rad/s: 0.6 rad inwards, with half of the ramp.
#[test]
fn a_shaft_beyond_a_limit_is_led_back_while_the_range_opens() {
    for (counts, target, way) in [(2_738, 1.5, -0.6), (391, 0.9, 0.6)] {
        let ramp = config().with_opening(Duration::from_millis(1_000));
        let mut bench = Bench::new(ramp.position_loop(SPEED, SPEED));
        bench.angle = counts;
        let mut volts = 0.0;
        while bench.ms < 501 {
            bench.ms += 1;
            bench.hear(STILL);
            let target = Position::from_angle(Angle::from_radians(target));
            bench.bus.set_position(bench.motor, target).unwrap();
            step(&mut bench.bus, bench.ms);
            volts = sent(&mut bench.bus).last().map_or(0.0, |(_, words)| f32::from(words[0]))
                * 24.0
                / 25_000.0;
        }
        assert!((volts - 0.5 * way).abs() < 0.015, "{volts} V, {way} rad to {target}");
    }
}

/// The feedback of a fast rotor, 2 ms apart, is judged alone, whereas a check looks 12 ms ahead: 0.3 rad.
#[test]
fn a_limit_ahead_begins_once_while_the_range_opens() {
    let (mut bus, [motor]) = armed([Config::<M2006>::new(1).with_health(&LIMITS)]);
    step(&mut bus, 2);
    bus.set_present_position(motor, Position::from_angle(Angle::from_radians(1.8))).unwrap();
    for ms in 3..=200 {
        if ms % 2 == 0 {
            _ = bus.ingest(&feedback(0x201, 0, 9_000), at_ms(ms));
        }
        step(&mut bus, ms);
    }
    let edges = core::iter::from_fn(|| bus.next_edge());
    let of_limit = edges.filter(|edge| edge.condition == Condition::SoftLimit);
    assert_eq!(of_limit.map(|edge| edge.began).collect::<Vec<_>>(), [true]);
}

/// A quarter of a narrow range is left at each end: 0.5 to 0.54 rad ends at 0.53.
#[test]
fn a_position_beyond_a_narrow_range_ends_a_quarter_of_it_inside() {
    static NARROW: HealthConfig =
        HealthConfig::new().with_soft_limits(Angle::from_radians(0.5), Angle::from_radians(0.54));
    let config =
        Config::<Gm6020Voltage>::at_once(1).with_health(&NARROW).position_loop(SPEED, SPEED);
    for (counts, is_upward) in [(689, true), (693, false)] {
        let (mut bus, [yaw]) = armed([config]);
        let mut words = Vec::new();
        for ms in 2..60 {
            assert_eq!(bus.ingest(&feedback(0x205, counts, 0), at_ms(ms)), Ingest::Taken);
            bus.set_position(yaw, Position::from_angle(Angle::from_radians(1.0))).unwrap();
            step(&mut bus, ms);
            words = sent(&mut bus);
        }
        let [(_, [word, ..])] = words[..] else { panic!("{words:?}") };
        assert!(word != 0 && (word > 0) == is_upward, "{counts}: {word}");
    }
}
