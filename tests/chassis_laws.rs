//! The laws that every wheel layout keeps, for random geometry: forward undoes inverse and is linear, and slowing the
//! wheels to their limit keeps the direction of travel.

#![cfg(test)]

use drivetrain::chassis::{
    Differential, Kinematics, Mecanum, ModuleState, Omni, Swerve, WheelSpeed,
};
use drivetrain::geometry::{Body, Pose2, Twist, Vec2};
use drivetrain::units::{Angle, AngularVelocity};
use proptest::prelude::*;

/// What rounding may leave, in parts of the motion. The angles of swerve modules are as coarse as the arc tangent.
const EXACT: f32 = 1e-5;
const BY_ARC_TANGENT: f32 = if cfg!(feature = "micromath") { 6e-3 } else { EXACT };

/// What a wheel does, as a vector: what has to add up.
trait Speed: WheelSpeed {
    fn of(vector: (f32, f32)) -> Self;
    fn plus(self, other: Self) -> Self;
}

impl Speed for AngularVelocity {
    fn of((speed, _): (f32, f32)) -> Self {
        Self::from_rad_per_s(speed)
    }

    fn plus(self, other: Self) -> Self {
        self + other
    }
}

impl Speed for ModuleState {
    fn of((x, y): (f32, f32)) -> Self {
        let angle = Angle::from_radians(y.atan2(x));
        Self::new(AngularVelocity::from_rad_per_s(x.hypot(y)), angle)
    }

    fn plus(self, other: Self) -> Self {
        let parts = [self, other].map(|module| {
            let (sine, cosine) = module.angle.as_radians().sin_cos();
            (module.velocity.as_rad_per_s() * cosine, module.velocity.as_rad_per_s() * sine)
        });
        Self::of((parts[0].0 + parts[1].0, parts[0].1 + parts[1].1))
    }
}

/// The size of a motion where its wheels are: `reach_m` is how far out they stand.
fn size(motion: Twist<Body>, reach_m: f32) -> f32 {
    motion.linear().norm() + reach_m * motion.wz_rad_s.abs()
}

fn near(
    is: Twist<Body>,
    should: Twist<Body>,
    reach_m: f32,
    bound: f32,
) -> Result<(), TestCaseError> {
    let error = size(is - should, reach_m);
    prop_assert!(error <= bound, "{is:?} and not {should:?}: off by {error}, {bound} are allowed");
    Ok(())
}

fn wheels<K: Kinematics>(layout: &K, vectors: &[(f32, f32)]) -> K::Wheels<K::Speed>
where
    K::Speed: Speed,
{
    let mut vectors = vectors.iter();
    K::map(layout.inverse(Twist::ZERO), |_| K::Speed::of(*vectors.next().unwrap()))
}

/// What a case draws: a motion, two settings of eight wheels in any contradiction, a factor, a limit.
#[derive(Debug, Clone)]
struct Case {
    motion: Twist<Body>,
    one: Vec<(f32, f32)>,
    other: Vec<(f32, f32)>,
    factor: f32,
    limit: f32,
}

fn cases() -> impl Strategy<Value = Case> {
    let vector = (-50.0_f32..50.0, -50.0_f32..50.0);
    let vectors = || proptest::collection::vec(vector.clone(), 8);
    let motion = (-5.0_f32..5.0, -5.0_f32..5.0, -20.0_f32..20.0);
    (motion, vectors(), vectors(), -2.0_f32..2.0, 0.1_f32..100.0).prop_map(
        |((vx, vy, wz), one, other, factor, limit)| Case {
            motion: Twist::new(vx, vy, wz),
            one,
            other,
            factor,
            limit,
        },
    )
}

fn laws<K: Kinematics>(
    layout: &K,
    case: &Case,
    reach_m: f32,
    relative: f32,
) -> Result<(), TestCaseError>
where
    K::Speed: Speed,
{
    let Case { motion, ref one, ref other, factor, limit } = *case;
    // Forward undoes inverse.
    let rolling = layout.inverse(motion);
    near(layout.forward(rolling), motion, reach_m, relative * size(motion, reach_m))?;

    // Forward is linear, whatever the wheels do, and they need not agree.
    let (one, other) = (wheels(layout, one), wheels(layout, other));
    let sum = K::map(K::zip(one, other), |(one, other)| one.scaled(factor).plus(other));
    let apart = layout.forward(one) * factor + layout.forward(other);
    let fastest = 75.0 * (1.0 + factor.abs()) * layout.wheel_radius_m(); // m/s of any wheel
    near(layout.forward(sum), apart, reach_m, 10.0 * relative * fastest)?;

    // At their limit all wheels are slowed by one factor.
    let limit = AngularVelocity::from_rad_per_s(limit);
    let mut most = 0.0_f32;
    let (limited, slower) = layout.desaturate(rolling, limit);
    let _: K::Wheels<()> = K::map(rolling, |wheel| {
        most = most.max(wheel.velocity().as_rad_per_s().abs());
    });
    let scale = (limit.as_rad_per_s() / most).min(1.0);
    prop_assert!((slower - scale).abs() <= 1e-6, "{} instead of {}", slower, scale);
    let mut fastest = 0.0_f32;
    let _: K::Wheels<()> = K::map(limited, |wheel| {
        fastest = fastest.max(wheel.velocity().as_rad_per_s().abs());
    });
    prop_assert!(fastest <= limit.as_rad_per_s() * (1.0 + 1e-6));
    prop_assert!(fastest >= most.min(limit.as_rad_per_s()) * (1.0 - 1e-5), "too slow");
    let expected = motion * scale;
    near(layout.forward(limited), expected, reach_m, 2.0 * relative * size(expected, reach_m))
}

fn length() -> impl Strategy<Value = f32> {
    0.05_f32..1.0
}

fn radius() -> impl Strategy<Value = f32> {
    0.02_f32..0.3
}

/// Wheels all round, none at its place exactly: `N` of them determine every motion well.
fn omni<const N: usize>(jitters: [(f32, f32, f32); N]) -> [Pose2<Body>; N] {
    let step = core::f32::consts::TAU / f32::from(u8::try_from(N).unwrap());
    let mut angle = 0.0;
    jitters.map(|(shift, distance, turn)| {
        angle += step;
        let mut wheel = Pose2::tangential(Angle::from_radians(angle + shift), distance);
        wheel.angle = wheel.angle + Angle::from_radians(turn);
        wheel
    })
}

fn jitters<const N: usize>() -> impl Strategy<Value = [(f32, f32, f32); N]> {
    proptest::collection::vec((-0.2_f32..0.2, 0.1_f32..0.6, -0.3_f32..0.3), N)
        .prop_map(|jitters| jitters.try_into().unwrap())
}

proptest! {
    #[test]
    fn mecanum(case in cases(), wheel_radius_m in radius(), half_wheelbase_m in length(), half_track_m in length()) {
        let reach_m = half_wheelbase_m + half_track_m;
        laws(&Mecanum::new(wheel_radius_m, Vec2::new(half_wheelbase_m, half_track_m)).unwrap(), &case, reach_m, EXACT)?;
        // With the other rollers the lever arm is the difference.
        let reach_m = (half_track_m - half_wheelbase_m).abs();
        if reach_m > 0.05 && reach_m > 0.04 * half_track_m.hypot(half_wheelbase_m) {
            laws(&Mecanum::<'X'>::with_rollers(wheel_radius_m, Vec2::new(half_wheelbase_m, half_track_m)).unwrap(), &case, reach_m, EXACT)?;
        }
    }

    #[test]
    fn omni_with_three_four_and_five_wheels(
        case in cases(), radius in radius(), distance in length(),
        three in jitters::<3>(), four in jitters::<4>(), five in jitters::<5>()
    ) {
        laws(&Omni::three(radius, distance).unwrap(), &case, distance, EXACT)?;
        laws(&Omni::four(radius, distance).unwrap(), &case, distance, EXACT)?;
        laws(&Omni::new(radius, omni(three)).unwrap(), &case, 0.1, EXACT)?;
        laws(&Omni::new(radius, omni(four)).unwrap(), &case, 0.1, EXACT)?;
        laws(&Omni::new(radius, omni(five)).unwrap(), &case, 0.1, EXACT)?;
    }

    #[test]
    fn differential(case in cases(), wheel_radius_m in radius(), half_track_m in length()) {
        let layout = Differential::new(wheel_radius_m, half_track_m).unwrap();
        // It cannot move sideways.
        let motion = Twist::new(case.motion.vx_m_s, 0.0, case.motion.wz_rad_s);
        laws(&layout, &Case { motion, ..case }, half_track_m, EXACT)?;
    }

    #[test]
    fn swerve_with_two_and_four_modules(
        case in cases(), radius in radius(), spread in 0.15_f32..0.6,
        jitter in proptest::array::uniform4((-0.1_f32..0.1, -0.1_f32..0.1))
    ) {
        let corners = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)];
        let mut jitter = jitter.into_iter();
        let places = corners.map(|(x, y)| {
            let (dx, dy) = jitter.next().unwrap();
            Vec2::new(spread * x + dx, spread * y + dy)
        });
        laws(&Swerve::new(radius, places).unwrap(), &case, spread, BY_ARC_TANGENT)?;
        let [one, other, ..] = places;
        laws(&Swerve::new(radius, [one, other]).unwrap(), &case, spread, BY_ARC_TANGENT)?;
    }
}
