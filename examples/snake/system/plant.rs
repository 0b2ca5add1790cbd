//! What the firmware acts on: joints, gripper and sensors.

use super::imu::Imu;
use super::servo::Servo;
use super::{JOINTS, degrees};
use drivetrain::sim::{AttachError, JointConfig, JointKey, JointState, Model, MotorConfig, World};
use drivetrain::time::Duration;

/// The loop of the firmware's main function, and the step of servo and sensors.
pub(crate) const STEP: Duration = Duration::from_micros(100);
const GRIPPER_KG_M2: f32 = 0.002;
/// The joint after which each IMU sits.
const IMU_AFTER: [usize; 4] = [0, 3, 6, 9];

pub(crate) struct Plant<'w> {
    pub(crate) world: &'w World,
    pub(crate) joints: [JointKey; JOINTS],
    pub(crate) servo: Servo,
    pub(crate) imus: [Imu; 4],
    /// Where the body was straight.
    straight: [i32; JOINTS],
}

impl<'w> Plant<'w> {
    pub(crate) fn new(world: &'w World, seed: u64) -> Result<Self, AttachError> {
        let mut joints = Vec::new();
        for id in 1..=12 {
            joints.push(world.attach_joint(JointConfig::new(id))?);
        }
        let joints = joints.try_into().map_err(|_| AttachError::Full)?;
        for (model, id) in [(Model::Gm6020Voltage, 1), (Model::M2006, 1)] {
            world.attach(MotorConfig::new(model, id).with_load_inertia_kg_m2(GRIPPER_KG_M2))?;
        }
        Ok(Self {
            world,
            joints,
            servo: Servo::new(seed + 100),
            imus: [0_u64, 1, 2, 3]
                .map(|index| Imu::new(seed + 200 + index, Duration::from_millis(2 * index))),
            straight: joints.map(|joint| world.joint(joint).map_or(0, |state| state.pulses)),
        })
    }

    /// Moves everything on by one step; shows each frame on the bus.
    pub(crate) fn step(&mut self, show: impl FnMut(&drivetrain::sim::Record)) {
        self.world.advance_with(STEP, show);
        let now = self.world.now();
        self.servo.step(now, STEP.as_secs_f32());
        let mut yaw_deg = 0.0;
        let states = self.states().map(|state| state.map_or(0, |state| state.pulses));
        for (index, (pulses, straight)) in states.into_iter().zip(self.straight).enumerate() {
            yaw_deg += degrees(pulses.wrapping_sub(straight));
            for (imu, _) in self.imus.iter_mut().zip(IMU_AFTER).filter(|(_, after)| *after == index)
            {
                imu.step(now, yaw_deg);
            }
        }
    }

    pub(crate) fn states(&self) -> [Option<JointState>; JOINTS] {
        self.joints.map(|joint| self.world.joint(joint))
    }
}
