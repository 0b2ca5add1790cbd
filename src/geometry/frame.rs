/// The frame of the chassis: x forward, y left, origin where the kinematics put it (the centre of the wheels).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Body {}

/// The frame of the floor: fixed, with its origin and x axis where the heading was zeroed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum World {}

/// The frame of what the driver looks through: x where the gimbal points, turned against the chassis by its yaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Gimbal {}
