//! What the firmware acts on: joints, gripper and sensors.

use super::JOINTS;
use super::imu::Imu;
use super::servo::Servo;
use drivetrain::encoder::Position;
use drivetrain::sim::{Line, MotorConfig, MotorKey, MotorState, SimError, Simulation};
use drivetrain::time::Duration;

/// The loop of the firmware's main function, and the step of servo and sensors.
pub(crate) const STEP: Duration = Duration::from_micros(100);
const GRIPPER_KG_M2: f32 = 0.002;
/// The joint after which each IMU sits.
const IMU_AFTER: [usize; 4] = [0, 3, 6, 9];

pub(crate) struct Plant<'w> {
    pub(crate) world: &'w Simulation,
    pub(crate) joints: [MotorKey; JOINTS],
    pub(crate) servo: Servo,
    pub(crate) imus: [Imu; 4],
    /// Where the body was straight.
    straight: [Position; JOINTS],
}

impl<'w> Plant<'w> {
    pub(crate) fn new(world: &'w Simulation, seed: u64) -> Result<Self, SimError> {
        let mut joints = Vec::new();
        for id in 1..=12 {
            joints.push(world.attach_joint(Line::Can1, id, None)?);
        }
        let joints = joints.try_into().map_err(|_| SimError::Full)?;
        for gripper in [MotorConfig::gm6020_voltage(1), MotorConfig::m2006(1)] {
            world.attach(gripper.with_load_inertia_kg_m2(GRIPPER_KG_M2))?;
        }
        Ok(Self {
            world,
            joints,
            servo: Servo::new(seed + 100),
            imus: [0_u64, 1, 2, 3]
                .map(|index| Imu::new(seed + 200 + index, Duration::from_millis(2 * index))),
            straight: joints.map(|joint| position(world.motor(joint))),
        })
    }

    /// Moves everything on by one step; shows each frame on the bus.
    pub(crate) fn step(&mut self, show: impl FnMut(&drivetrain::sim::Transmission)) {
        self.world.advance_with(STEP, show);
        let now = self.world.now();
        self.servo.step(now, STEP.as_secs_f32());
        let mut yaw_deg = 0.0;
        let positions = self.states().map(position).into_iter().zip(self.straight);
        for (index, (position, straight)) in positions.enumerate() {
            yaw_deg += (position - straight).as_degrees();
            for (imu, _) in self.imus.iter_mut().zip(IMU_AFTER).filter(|(_, after)| *after == index)
            {
                imu.step(now, yaw_deg);
            }
        }
    }

    pub(crate) fn states(&self) -> [Option<MotorState>; JOINTS] {
        self.joints.map(|joint| self.world.motor(joint))
    }
}

fn position(joint: Option<MotorState>) -> Position {
    joint.map_or(Position::ZERO, |joint| joint.position)
}
