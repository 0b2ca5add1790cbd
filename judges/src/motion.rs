//! Plans of `control::Motion`, for `judges/motion.py`.
//!
//! ```text
//! drivetrain-judges motion plan SAMPLES    eight f32 a motion in: position, velocity, acceleration, target position and velocity,
//!                                          limits of velocity, acceleration and jerk; out: the duration, then SAMPLES + 1 times
//!                                          time, position, velocity, acceleration and jerk, from the start to the end
//! ```

use crate::Outcome;
use drivetrain::control::{Motion, MotionLimits, MotionTarget, ProfileState};
use std::io::{ErrorKind, Read, Write};

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
    let ["plan", samples] = arguments else {
        return Err("see the head of judges/src/motion.rs for the arguments".into());
    };
    let samples: u16 = samples.parse()?;
    let mut bytes = [0; 32];
    loop {
        match input.read_exact(&mut bytes) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(()),
            read => read?,
        }
        let mut case = [0.0; 8];
        for (value, part) in case.iter_mut().zip(bytes.as_chunks().0) {
            *value = f32::from_le_bytes(*part);
        }
        defect.plant(&mut case);
        let [position, velocity, acceleration, target, target_velocity, top, steep, jerk] = case;
        let limits = MotionLimits::new(top, steep).with_jerk(jerk);
        let from = ProfileState { position, velocity, acceleration };
        let to = MotionTarget { position: target, velocity: target_velocity };
        let motion = Motion::plan(&from, &to, &limits)?;
        output.write_all(&motion.duration_s().to_le_bytes())?;
        for sample in 0..=samples {
            let time_s = motion.duration_s() * (f32::from(sample) / f32::from(samples));
            let ProfileState { position, velocity, acceleration } = motion.at(time_s);
            for value in [time_s, position, velocity, acceleration, motion.jerk_at(time_s)] {
                output.write_all(&value.to_le_bytes())?;
            }
        }
    }
}
