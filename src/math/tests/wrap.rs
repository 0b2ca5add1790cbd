//! Angles in a turn.

use crate::math::*;
use proptest::prelude::*;

fn spacing(x: f32) -> f64 {
    f64::from(f32::from_bits(x.abs().to_bits() + 1)) - f64::from(x.abs())
}

/// How far `wrapped` is from `x` by the nearest whole number of periods.
fn congruence(wrapped: f32, x: f32, period: f64) -> f64 {
    let difference = f64::from(wrapped) - f64::from(x);
    (difference - (difference / period).round() * period).abs()
}

#[test]
fn half_a_period_either_way_is_the_lower_end() {
    assert_eq!(wrap(180.0, 360.0), -180.0);
    assert_eq!(wrap(-180.0, 360.0), -180.0);
    assert_eq!(wrap(540.0, 360.0), -180.0);
    assert_eq!((wrap_pi(PI), wrap_pi(-PI)), (-PI, -PI));
}

#[test]
fn the_upper_end_is_never_reached() {
    for tiny in [-f32::MIN_POSITIVE, -1e-30, -1e-9, -1e-6, -1e-5] {
        assert!(wrap_positive(tiny, 360.0) < 360.0 && wrap_tau(tiny) < TAU);
    }
    let below = f32::from_bits(360.0_f32.to_bits() - 1);
    assert_eq!(wrap_positive(below, 360.0), below);
    assert_eq!(wrap_positive(360.0, 360.0), 0.0);
}

#[test]
fn the_wrap_of_nan_and_infinity_is_nan() {
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(wrap_pi(x).is_nan() && wrap_tau(x).is_nan());
        assert!(wrap(x, 360.0).is_nan() && wrap_positive(x, 360.0).is_nan());
    }
}

#[test]
fn a_bad_period_is_nan() {
    for period in [0.0, -0.0, -360.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert!(wrap(10.0, period).is_nan() && wrap_positive(10.0, period).is_nan(), "{period}");
        assert!(wrap(0.0, period).is_nan() && wrap_positive(-1e9, period).is_nan(), "{period}");
    }
}

#[test]
fn the_shortest_way_stays_in_range_for_any_argument() {
    for x in [180.0, -180.0, 540.0, 1e7, -6.1e9, 3e12, f32::MAX, f32::MIN, f32::NAN, f32::INFINITY]
    {
        let way = shortest(x, 180.0);
        assert!((-180.0..180.0).contains(&way), "{x} {way}");
        assert!(x.abs() > 1e9 || x.is_nan() || way == wrap(x, 360.0), "{x} {way}");
    }
}

#[test]
fn huge_arguments_stay_in_range() {
    for x in [1e7, 3e7, -6.1e8, 1e20, f32::MAX, f32::MIN] {
        assert!((-PI..PI).contains(&wrap_pi(x)) && (0.0..TAU).contains(&wrap_tau(x)));
        for period in [1e-30, 0.1, 360.0, 1e30] {
            assert!((-0.5 * period..0.5 * period).contains(&wrap(x, period)));
            assert!((0.0..period).contains(&wrap_positive(x, period)));
        }
    }
}

/// At 1e10 the result was 0, and past 46 000 turns the error was up to the spacing of `f32`.
#[test]
fn huge_arguments_are_wrapped_exactly() {
    assert_eq!((wrap(1e10, 360.0), wrap(-1e10, 360.0)), (-80.0, 80.0));
    assert_eq!((wrap_positive(1e10, 360.0), wrap_positive(-1e10, 360.0)), (280.0, 80.0));
    // 2^128 less 2^104, in integers of 128 bits.
    let rest = ((1_u128 << 127) % 360 * 2 + 360 - (1_u128 << 104) % 360) % 360;
    assert_eq!(f64::from(wrap_positive(f32::MAX, 360.0)), f64::from(u16::try_from(rest).unwrap()));
    // 2^24 - 1 times 2^253, by 11: the rest is 10.
    assert_eq!(wrap(f32::MAX, f32::from_bits(11)), -f32::from_bits(1));
    assert_eq!(wrap(f32::MAX, f32::MIN_POSITIVE), 0.0);
}

/// Of doubles, `%` is exact, and so is each `f32` as a double.
fn expected(x: f32, period: f32) -> f64 {
    let (x, period) = (f64::from(x), f64::from(period));
    let rest = x % period;
    if rest >= 0.5 * period {
        rest - period
    } else if rest < -0.5 * period {
        rest + period
    } else {
        rest
    }
}

#[test]
fn wrapped_angles_keep_their_error() {
    let worst = (-2_000_000..=2_000_000_i32)
        .map(|step| step as f32 * 0.005)
        .map(|x| congruence(wrap_pi(x), x, core::f64::consts::TAU))
        .fold(0.0, f64::max);
    assert!(worst <= 4e-7, "{worst}");
}

fn any_x() -> impl Strategy<Value = f32> {
    prop_oneof![-1e4_f32..1e4, -1e9_f32..1e9, any::<f32>().prop_filter("finite", |x| x.is_finite())]
}

proptest! {
    #[test]
    fn the_shortest_way_is_the_wrapped_way_to_within_the_spacing(
        x in -1e5_f32..1e5, period in 0.1_f32..1e4,
    ) {
        let way = shortest(x, 0.5 * period);
        prop_assert!((-0.5 * period..0.5 * period).contains(&way), "{way}");
        prop_assert!(congruence(way, x, period.into()) <= 2.0 * spacing(x), "{way}");
    }

    #[test]
    fn results_are_in_range(x in any_x(), period in 1e-3_f32..1e6) {
        prop_assert!((-0.5 * period..0.5 * period).contains(&wrap(x, period)));
        prop_assert!((0.0..period).contains(&wrap_positive(x, period)));
        prop_assert!((-PI..PI).contains(&wrap_pi(x)) && (0.0..TAU).contains(&wrap_tau(x)));
    }

    /// Law: the result is the exact remainder, for any number of periods.
    #[test]
    fn every_finite_argument_is_wrapped_exactly(
        x in any_x(),
        period in prop_oneof![
            Just(360.0_f32), Just(TAU), Just(0.1_f32), 1e-3_f32..1e6, f32::MIN_POSITIVE..f32::MAX, 1e-38_f32..1e-30,
        ],
        turns in -5000_i16..5000, part in -0.6_f32..0.6,
    ) {
        for x in [x, (f32::from(turns) + part) * period] {
            if x.is_finite() {
                prop_assert_eq!(f64::from(wrap(x, period)), expected(x, period), "{} by {}", x, period);
            }
        }
    }

    #[test]
    fn results_are_congruent_to_within_the_spacing_of_the_argument(x in any_x(), period in 1e-3_f32..1e6) {
        let period = period.max((x.abs() / 4.0e6).min(1e30));
        let x = x.clamp(-1e36, 1e36);
        let slack = spacing(x) + 1e-7 * f64::from(period);
        prop_assert!(congruence(wrap(x, period), x, f64::from(period)) <= slack);
        prop_assert!(congruence(wrap_positive(x, period), x, f64::from(period)) <= slack);
        if x.abs() < 2.5e7 {
            prop_assert!(congruence(wrap_pi(x), x, core::f64::consts::TAU) <= spacing(x) + 4e-7);
        }
    }

    #[test]
    fn wrapping_twice_is_wrapping_once(x in any_x(), period in 1e-3_f32..1e6) {
        let once = wrap(x, period);
        prop_assert_eq!(wrap(once, period), once);
        prop_assert_eq!(wrap_pi(wrap_pi(x)), wrap_pi(x));
    }

    #[test]
    fn whole_periods_change_nothing(x in -180_i16..180, sixteenths in 0_u8..16, turns in -1000_i16..1000) {
        let angle = f32::from(x) + f32::from(sixteenths) / 16.0;
        prop_assert_eq!(wrap(angle + 360.0 * f32::from(turns), 360.0), wrap(angle, 360.0));
    }
}
