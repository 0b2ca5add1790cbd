//! Efforts that hold an arm, for `judges/manipulator.py`.
//!
//! ```text
//! drivetrain-judges manipulator POSES    f32 in, an arm after the other: number of joints (1 to 6); gravity (3); payload: mass and
//!                                        centre (4); for each joint: 1 if it turns or 0, axis (3), place (3), mass, centre (3);
//!                                        POSES times the positions of all joints. Out: POSES times the efforts
//! ```

use crate::defect::defects;
use crate::{Outcome, floats};
use drivetrain::geometry::Vec3;
use drivetrain::manipulator::{ArmJoint, SerialArm};
use std::io::{Read, Write};

defects! {
    /// The first axis points the other way.
    Sign = "sign",
    /// The last link weighs nothing.
    Link = "link",
    /// The last axis is off by a millimetre.
    Place = "place",
    Payload = "payload",
    /// The base counts as upright.
    Gravity = "gravity",
}

pub fn run(arguments: &[&str], mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = Defect::split(arguments)?;
    let [poses] = arguments else {
        return Err("see the head of judges/src/manipulator.rs for the arguments".into());
    };
    let poses = poses.parse()?;
    while let Some([joints]) = floats::next(&mut input)? {
        let hold = [hold::<1>, hold::<2>, hold::<3>, hold::<4>, hold::<5>, hold::<6>]
            .into_iter()
            .zip(1_u8..)
            .find_map(|(hold, count)| (f32::from(count) == joints).then_some(hold));
        hold.ok_or("1 to 6 joints")?(poses, defect, &mut input, output)?;
    }
    Ok(())
}

fn hold<const N: usize>(
    poses: u32,
    defect: Defect,
    input: &mut dyn Read,
    output: &mut dyn Write,
) -> Outcome<()> {
    let gravity = vector(input)?;
    let [payload_kg] = floats::read(input)?;
    let payload_m = vector(input)?;
    let mut joints = Vec::new();
    for index in 0..N {
        let [turns] = floats::read(input)?;
        let (mut axis, mut through) = (vector(input)?, vector(input)?);
        let ([mut mass], centre) = (floats::read(input)?, vector(input)?);
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
        let efforts =
            arm.holding_efforts(&floats::read(input)?).ok_or("a position is not finite")?;
        floats::write(efforts, output)?;
    }
    Ok(())
}

fn vector(input: &mut dyn Read) -> Outcome<Vec3> {
    let [x, y, z] = floats::read(input)?;
    Ok(Vec3::new(x, y, z))
}
