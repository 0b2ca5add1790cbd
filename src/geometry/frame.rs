/// The frame of the chassis: x forward, y left, origin at the origin of the kinematics (the centre of the wheels).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Body {}

/// The frame of the floor: fixed, with its origin and x axis where the heading was zeroed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum World {}

/// The frame of the driver's view: x in the direction of the gimbal, turned against the chassis by its yaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Gimbal {}
