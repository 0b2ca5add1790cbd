//! Efforts that hold an arm, for `judges/manipulator.py`.
//!
//! ```text
//! drivetrain-judges manipulator POSES    f32 in, an arm after the other: number of joints (1 to 6); gravity (3); payload: mass and
//!                                        centre (4); for each joint: 1 if it turns or 0, axis (3), place (3), mass, centre (3);
//!                                        POSES times the positions of all joints. Out: POSES times the efforts
//! ```

use crate::Outcome;
use drivetrain::geometry::Vec3;
use drivetrain::manipulator::{ArmJoint, SerialArm};
use std::io::{ErrorKind, Read, Write};

/// A mistake that the judge has to find.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Defect {
    None,
    /// The first axis points the other way.
    Sign,
    /// The last link weighs nothing.
    Link,
    /// The last axis is off by a millimetre.
    Place,
    Payload,
    /// The base counts as upright.
    Gravity,
}

impl Defect {
    fn named(name: &str) -> Outcome<Self> {
        Ok(match name {
            "sign" => Self::Sign,
            "link" => Self::Link,
            "place" => Self::Place,
            "payload" => Self::Payload,
            "gravity" => Self::Gravity,
            _ => return Err(format!("no defect {name}").into()),
        })
    }
}

pub fn run(arguments: &[&str], mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = match arguments {
        [rest @ .., "--plant", name] => (rest, Defect::named(name)?),
        _ => (arguments, Defect::None),
    };
    let [poses] = arguments else {
        return Err("see the head of judges/src/manipulator.rs for the arguments".into());
    };
    let poses = poses.parse()?;
    loop {
        let mut first = [0; 4];
        match input.read_exact(&mut first) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(()),
            read => read?,
        }
        let joints = f32::from_le_bytes(first);
        let hold = [hold::<1>, hold::<2>, hold::<3>, hold::<4>, hold::<5>, hold::<6>]
            .into_iter()
            .zip(1_u8..)
            .find_map(|(hold, count)| (f32::from(count) == joints).then_some(hold));
        hold.ok_or("1 to 6 joints")?(poses, defect, &mut input, output)?;
    }
}

fn hold<const N: usize>(
    poses: u32,
    defect: Defect,
    input: &mut dyn Read,
    output: &mut dyn Write,
) -> Outcome<()> {
    let gravity = vector(input)?;
    let [payload_kg] = numbers(input)?;
    let payload_m = vector(input)?;
    let mut joints = Vec::new();
    for index in 0..N {
        let [turns] = numbers(input)?;
        let (mut axis, mut through) = (vector(input)?, vector(input)?);
        let ([mut mass], centre) = (numbers(input)?, vector(input)?);
        match defect {
            Defect::Sign if index == 0 => axis = -axis,
            Defect::Link if index == N - 1 => mass = 0.0,
            Defect::Place if index == N - 1 => through = through + Vec3::new(0.001, 0.001, 0.001),
            _ => {}
        }
        let joint = if turns == 1.0 {
            ArmJoint::revolute(axis, through)
        } else {
            ArmJoint::prismatic(axis)
        };
        joints.push(joint?.with_mass(mass, centre)?);
    }
    let mut arm = SerialArm::<N>::new(joints.try_into().map_err(|_| "a joint is missing")?);
    if defect != Defect::Payload {
        arm.set_payload(payload_kg, payload_m)?;
    }
    if defect != Defect::Gravity {
        arm.set_gravity(gravity)?;
    }
    for _ in 0..poses {
        let efforts = arm.holding_efforts(&numbers(input)?).ok_or("a position is not finite")?;
        for effort in efforts {
            output.write_all(&effort.to_le_bytes())?;
        }
    }
    Ok(())
}

fn vector(input: &mut dyn Read) -> Outcome<Vec3> {
    let [x, y, z] = numbers(input)?;
    Ok(Vec3::new(x, y, z))
}

fn numbers<const N: usize>(input: &mut dyn Read) -> Outcome<[f32; N]> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        let mut bytes = [0; 4];
        input.read_exact(&mut bytes)?;
        *number = f32::from_le_bytes(bytes);
    }
    Ok(numbers)
}
