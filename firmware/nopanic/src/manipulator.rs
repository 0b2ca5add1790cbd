//! Efforts that hold an arm.

use crate::opaque::Function;
use drivetrain::manipulator::*;

pub fn call_all() {
    ArmJoint::revolute.call();
    ArmJoint::prismatic.call();
    ArmJoint::with_mass.call();
    ArmJoint::mass_kg.call();
    SerialArm::<6>::new.call();
    SerialArm::<6>::set_gravity.call();
    SerialArm::<6>::set_payload.call();
    SerialArm::<6>::holding_efforts.call();
}
