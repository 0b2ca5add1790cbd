//! What rounding leaves of rotations and transforms after 10^6 composed steps, against the same steps in double precision.
//!
//! The bounds are those that the documentation of the types states. Each step counts as what its `f32` say, because a
//! step that is itself rounded the same way a million times is another step, and no error of composing.

#![cfg(test)]

use drivetrain::geometry::{Body, Rotation2, Rotation3, Transform2, Transform3, Vec2, Vec3, World};
use drivetrain::units::Angle;

const STEPS: usize = 1_000_000;
const NORMALIZE_EVERY: usize = 1_000;

/// Draws numbers in -1..1.
struct Draw(u32);

impl Draw {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / 8_388_608.0 - 1.0
    }
}

/// The steps of a run: one and the same, or 64 drawn ones in turn; small and large.
fn runs<T>(mut step: impl FnMut(&mut Draw, f32) -> T) -> Vec<Vec<T>> {
    let mut draw = Draw(1);
    let mut runs = Vec::new();
    for size in [1e-4, 1e-3, 1e-2, 0.1, 1.0] {
        for count in [1, 1, 1, 64] {
            runs.push((0..count).map(|_| step(&mut draw, size)).collect());
        }
    }
    runs
}

type Quaternion = [f64; 4];

fn unit(q: Quaternion) -> Quaternion {
    let length = q.iter().map(|part| part * part).sum::<f64>().sqrt();
    q.map(|part| part / length)
}

fn times([a, b, c, d]: Quaternion, [w, x, y, z]: Quaternion) -> Quaternion {
    unit([
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    ])
}

fn conjugate([w, x, y, z]: Quaternion) -> Quaternion {
    [w, -x, -y, -z]
}

fn turned(q: Quaternion, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [w, a, b, c] = q;
    let cross = |u: [f64; 3], v: [f64; 3]| {
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    };
    let twice = cross([a, b, c], [x, y, z]).map(|part| 2.0 * part);
    let rest = cross([a, b, c], twice);
    [x + w * twice[0] + rest[0], y + w * twice[1] + rest[1], z + w * twice[2] + rest[2]]
}

fn exact(rotation: Rotation3) -> Quaternion {
    unit(rotation.to_quaternion().map(f64::from))
}

/// The angle between two turns, exact for small ones.
fn between(is: Quaternion, should: Quaternion) -> f64 {
    let [w, x, y, z] = times(conjugate(should), is);
    2.0 * (x * x + y * y + z * z).sqrt().atan2(w.abs())
}

fn length3(rotation: Rotation3) -> f64 {
    rotation.to_quaternion().iter().map(|&part| f64::from(part).powi(2)).sum::<f64>().sqrt()
}

fn drawn_turn(draw: &mut Draw, size: f32) -> Rotation3 {
    let [x, y, z] = [draw.next(), draw.next(), draw.next()].map(|part| 0.5 * size * part);
    Rotation3::from_quaternion(1.0, x, y, z).unwrap()
}

#[test]
fn rotation3_after_a_million_steps() {
    let (mut length, mut angle) = (0.0_f64, 0.0_f64);
    for steps in runs(drawn_turn) {
        let (mut is, mut should) = (Rotation3::IDENTITY, [1.0, 0.0, 0.0, 0.0]);
        for step in steps.iter().cycle().take(STEPS) {
            is = is.compose(*step);
            should = times(should, exact(*step));
        }
        length = length.max((length3(is) - 1.0).abs());
        angle = angle.max(between(exact(is), should));
    }
    println!("Rotation3: length {length:.2e}, angle {angle:.2e} rad");
    assert!(length < 2e-7 && angle < 3e-3, "{length} {angle}");
}

#[test]
fn rotation2_after_a_million_steps() {
    let angle_of = |rotation: Rotation2| f64::from(rotation.sin()).atan2(f64::from(rotation.cos()));
    let length_of =
        |rotation: Rotation2| f64::from(rotation.sin()).hypot(f64::from(rotation.cos()));
    let mut worst = [(0.0_f64, 0.0_f64); 2];
    for steps in runs(|draw, size| Rotation2::new(Angle::from_radians(size * draw.next()))) {
        let (mut bare, mut kept, mut should) = (Rotation2::IDENTITY, Rotation2::IDENTITY, 0.0_f64);
        for (count, step) in (1..).zip(steps.iter().cycle().take(STEPS)) {
            (bare, kept) = (bare.compose(*step), kept.compose(*step));
            if count % NORMALIZE_EVERY == 0 {
                kept = kept.normalized();
            }
            should += angle_of(*step);
        }
        for ((length, angle), is) in worst.iter_mut().zip([bare, kept]) {
            let error = angle_of(is) - should;
            let turns = (error / core::f64::consts::TAU).round();
            *length = length.max((length_of(is) - 1.0).abs());
            *angle = angle.max((error - turns * core::f64::consts::TAU).abs());
        }
    }
    let [(bare_length, bare_angle), (length, angle)] = worst;
    println!("Rotation2: length {bare_length:.2e}, angle {bare_angle:.2e} rad");
    println!("Rotation2, normalized: length {length:.2e}, angle {angle:.2e} rad");
    assert!(bare_length < 0.1 && bare_angle < 1e-3, "{bare_length} {bare_angle}");
    assert!(length < 2e-7 && angle < 1e-3, "{length} {angle}");
}

#[test]
fn transform2_after_a_million_steps() {
    let (mut place, mut angle) = (0.0_f64, 0.0_f64);
    let drawn = |draw: &mut Draw, size: f32| {
        let turn = Rotation2::new(Angle::from_radians(size * draw.next()));
        Transform2::<Body, Body>::new(turn, Vec2::new(draw.next(), draw.next()) * (0.1 * size))
    };
    for steps in runs(drawn) {
        let mut is = Transform2::<Body, World>::IDENTITY;
        let (mut x, mut y, mut theta, mut reach) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        for (count, step) in (1..).zip(steps.iter().cycle().take(STEPS)) {
            is = is.compose(*step);
            if count % NORMALIZE_EVERY == 0 {
                is = is.normalized();
            }
            let (sine, cosine) = theta.sin_cos();
            let (a, b) = (f64::from(step.translation_m().x), f64::from(step.translation_m().y));
            (x, y) = (x + cosine * a - sine * b, y + sine * a + cosine * b);
            let turn = step.rotation();
            theta += f64::from(turn.sin()).atan2(f64::from(turn.cos()));
            reach = reach.max(x.hypot(y));
        }
        let at = is.translation_m();
        let off = (f64::from(at.x) - x).hypot(f64::from(at.y) - y) / reach;
        let error = f64::from(is.rotation().sin()).atan2(f64::from(is.rotation().cos())) - theta;
        let turns = (error / core::f64::consts::TAU).round();
        let error = (error - turns * core::f64::consts::TAU).abs();
        println!(
            "   {} steps: reach {reach:.2} m, place {off:.2e}, angle {error:.2e}",
            steps.len()
        );
        place = place.max(off);
        angle = angle.max(error);
    }
    println!("Transform2: place {place:.2e} of its reach, angle {angle:.2e} rad");
    assert!(place < 1e-3 && angle < 1e-3, "{place} {angle}");
}

#[test]
fn transform3_after_a_million_steps() {
    let (mut place, mut angle) = (0.0_f64, 0.0_f64);
    let drawn = |draw: &mut Draw, size: f32| {
        let way = Vec3::new(draw.next(), draw.next(), draw.next()) * (0.1 * size);
        Transform3::<Body, Body>::new(drawn_turn(draw, size), way)
    };
    for steps in runs(drawn) {
        let mut is = Transform3::<Body, World>::IDENTITY;
        let (mut at, mut should, mut reach) = ([0.0_f64; 3], [1.0, 0.0, 0.0, 0.0], 0.0_f64);
        let truth: Vec<_> = steps
            .iter()
            .map(|step| {
                let way = step.translation_m();
                // What the rows turn by is known better from them than from a quaternion in f32.
                (rows(*step), [way.x, way.y, way.z].map(f64::from))
            })
            .collect();
        for (count, (step, (turn, way))) in (1..).zip(steps.iter().zip(&truth).cycle().take(STEPS))
        {
            is = is.compose(*step);
            if count % NORMALIZE_EVERY == 0 {
                is = is.normalized();
            }
            let [x, y, z] = turned(should, *way);
            at = [at[0] + x, at[1] + y, at[2] + z];
            should = times(should, *turn);
            reach = reach.max(at.iter().map(|part| part * part).sum::<f64>().sqrt());
        }
        let t = is.translation_m();
        let off = [f64::from(t.x) - at[0], f64::from(t.y) - at[1], f64::from(t.z) - at[2]];
        let off = off.iter().map(|part| part * part).sum::<f64>().sqrt() / reach;
        let error = between(rows(is), should);
        println!(
            "   {} steps: reach {reach:.2} m, place {off:.2e}, angle {error:.2e}",
            steps.len()
        );
        place = place.max(off);
        angle = angle.max(error);
    }
    println!("Transform3: place {place:.2e} of its reach, angle {angle:.2e} rad");
    assert!(place < 5e-3 && angle < 0.04, "{place} {angle}");
}

/// The nearest turn to the rows of a transform, in double precision.
fn rows(transform: Transform3<Body, impl Copy>) -> Quaternion {
    let m = transform.to_matrix().map(|row| row.map(f64::from));
    // Four times the quaternion times one of its parts each; that of the largest part does not cancel.
    let candidates = [
        [
            1.0 + m[0][0] + m[1][1] + m[2][2],
            m[2][1] - m[1][2],
            m[0][2] - m[2][0],
            m[1][0] - m[0][1],
        ],
        [
            m[2][1] - m[1][2],
            1.0 + m[0][0] - m[1][1] - m[2][2],
            m[0][1] + m[1][0],
            m[0][2] + m[2][0],
        ],
        [
            m[0][2] - m[2][0],
            m[0][1] + m[1][0],
            1.0 - m[0][0] + m[1][1] - m[2][2],
            m[1][2] + m[2][1],
        ],
        [
            m[1][0] - m[0][1],
            m[0][2] + m[2][0],
            m[1][2] + m[2][1],
            1.0 - m[0][0] - m[1][1] + m[2][2],
        ],
    ];
    let largest =
        candidates.into_iter().enumerate().max_by(|(i, a), (j, b)| a[*i].total_cmp(&b[*j]));
    unit(largest.unwrap().1)
}
