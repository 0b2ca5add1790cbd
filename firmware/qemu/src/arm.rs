//! The row of an arm: efforts that hold six joints.

use crate::meter::{CALLS, instructions};
use crate::report::row;
use core::hint::black_box;
use drivetrain::geometry::Vec3;
use drivetrain::manipulator::{ArmJoint, SerialArm};

#[unsafe(no_mangle)]
#[inline(never)]
fn manipulator_hold(arm: &SerialArm<6>, positions: &[f32; 6]) -> Option<[f32; 6]> {
    arm.holding_efforts(positions)
}

pub fn rows() {
    let (up, left, forward) =
        (Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.0, -1.0, 0.0), Vec3::new(1.0, 0.0, 0.0));
    // Base, shoulder, elbow, and a wrist of three axes.
    let joint = |axis, x_m: f32| {
        let joint = ArmJoint::revolute(axis, Vec3::new(x_m, 0.0, 0.2)).unwrap();
        joint.with_mass(0.5, Vec3::new(x_m + 0.1, 0.01, 0.2)).unwrap()
    };
    let arm = black_box(SerialArm::new([
        joint(up, 0.0),
        joint(left, 0.0),
        joint(left, 0.25),
        joint(forward, 0.4),
        joint(left, 0.45),
        joint(forward, 0.5),
    ]));
    let each = |hold: fn(&SerialArm<6>, &[f32; 6]) -> Option<[f32; 6]>, call| {
        let position = call as f32 / CALLS as f32;
        _ = black_box(hold(&arm, &[position, 0.5, -position, 1.0, 0.3, -0.2]));
    };
    row("arm_hold", &[instructions(manipulator_hold as _, each)]);
}
