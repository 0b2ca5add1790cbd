//! Plans of `control::Motion`, for `judges/motion.py`.
//!
//! ```text
//! drivetrain-judges motion plan SAMPLES    eight f32 a motion in: position, velocity, acceleration, target position and velocity,
//!                                          limits of velocity, acceleration and jerk; out: the duration, then SAMPLES + 1 times
//!                                          time, position, velocity, acceleration and jerk, from the start to the end
//! drivetrain-judges motion step SAMPLES    the same of three motions after each other in step, without the jerk: NaN
//! ```

use crate::{Outcome, floats};
use drivetrain::control::{Motion, MotionLimits, Motions, ProfileState};
use std::io::{Read, Write};

/// A mistake that the judge has to find.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Defect {
    None,
    /// One limit is lower or higher by 1 in 10 000.
    Limit(usize, f32),
    /// The target is farther by this share of the way.
    End,
}

impl Defect {
    fn named(name: &str) -> Outcome<Self> {
        Ok(match name {
            "slow" => Self::Limit(5, 0.999_9),
            "velocity" => Self::Limit(5, 1.000_1),
            "acceleration" => Self::Limit(6, 1.000_1),
            "jerk" => Self::Limit(7, 1.000_1),
            "end" => Self::End,
            _ => return Err(format!("no defect {name}").into()),
        })
    }

    fn plant(self, case: &mut [f32; 8]) {
        match self {
            Self::None => {}
            Self::Limit(place, factor) => case[place] *= factor,
            Self::End => case[3] += 1e-4 * (case[3] - case[0]),
        }
    }
}

pub fn run(arguments: &[&str], mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = match arguments {
        [rest @ .., "--plant", name] => (rest, Defect::named(name)?),
        _ => (arguments, Defect::None),
    };
    match arguments {
        ["plan", samples] => plan(samples.parse()?, defect, &mut input, output),
        ["step", samples] => step(samples.parse()?, defect, &mut input, output),
        _ => Err("see the head of judges/src/motion.rs for the arguments".into()),
    }
}

fn plan(
    samples: u16,
    defect: Defect,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    while let Some((from, to, limits)) = read(defect, input)? {
        let motion = Motion::plan(&from, &to, &limits)?;
        let states = times(motion.duration_s(), samples)
            .map(|time_s| (time_s, motion.at(time_s), motion.jerk_at(time_s)));
        write(motion.duration_s(), states, output)?;
    }
    Ok(())
}

fn step(
    samples: u16,
    defect: Defect,
    input: &mut impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    while let Some(first) = read(defect, input)? {
        let mut next =
            || -> Outcome<Case> { Ok(read(defect, input)?.ok_or("three motions go together")?) };
        let axes = [first, next()?, next()?];
        let motions = Motions::plan(
            &axes.map(|axis| axis.0),
            &axes.map(|axis| axis.1),
            &axes.map(|axis| axis.2),
        )?;
        for axis in 0..axes.len() {
            let states = times(motions.duration_s(), samples)
                .map(|time_s| (time_s, motions.at(time_s)[axis], f32::NAN));
            write(motions.duration_s(), states, output)?;
        }
    }
    Ok(())
}

type Case = (ProfileState, ProfileState, MotionLimits);

/// Reads a motion; `None` at the end of the input.
fn read(defect: Defect, input: &mut impl Read) -> Outcome<Option<Case>> {
    let Some(mut case) = floats::next(input)? else { return Ok(None) };
    defect.plant(&mut case);
    let [position, velocity, acceleration, target, target_velocity, top, steep, jerk] = case;
    let limits = MotionLimits::new(top, steep).with_jerk(jerk);
    let from = ProfileState { position, velocity, acceleration };
    Ok(Some((
        from,
        ProfileState { position: target, velocity: target_velocity, ..ProfileState::default() },
        limits,
    )))
}

fn times(duration_s: f32, samples: u16) -> impl Iterator<Item = f32> {
    (0..=samples).map(move |sample| duration_s * (f32::from(sample) / f32::from(samples)))
}

fn write(
    duration_s: f32,
    states: impl Iterator<Item = (f32, ProfileState, f32)>,
    output: &mut impl Write,
) -> Outcome<()> {
    let rows = states.flat_map(|(time_s, state, jerk)| {
        [time_s, state.position, state.velocity, state.acceleration, jerk]
    });
    floats::write(std::iter::once(duration_s).chain(rows), output)
}
