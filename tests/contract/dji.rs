//! DJI motors, alone, combined, and beside a motor of one's own.

use super::*;
use drivetrain::dji::{Gm6020Current, Gm6020Voltage, Handle, M2006, M3508};
use drivetrain::encoder::Position;
use drivetrain::time::Duration;

/// A bus with motors of one model, driven through `VelocityDrive`.
pub(crate) struct OneModel<M: Model, const N: usize>(Bus, [Handle<M>; N], [u8; N]);

impl<M: Model, const N: usize> OneModel<M, N> {
    pub(crate) fn new(ids: [u8; N], config: impl Fn(Config<M>) -> Config<M>) -> Self {
        let mut bus = Bus::new();
        let handles = bus.attach_all(ids.map(|id| config(Config::new(id).speed_loop(SPEED))));
        Self(bus, handles.unwrap(), ids)
    }
}

impl<M: Model, const N: usize> OneModel<M, N> {
    pub(crate) fn bus(&self) -> &Bus {
        &self.0
    }
}

impl<M: Model, const N: usize> Subject for OneModel<M, N> {
    type Device = Bus;
    fn device(&mut self) -> &mut Bus {
        &mut self.0
    }
    fn motors(&self) -> usize {
        N
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        rest(M::FACTS.feedback_base + u16::from(self.2[motor]))
    }
    /// A lost phase is 3 for C610 and C620; for a GM6020 no list of codes is known, and none is a fault.
    fn fault(&self, motor: usize) -> Option<CanFrame> {
        let id = M::FACTS.feedback_base + u16::from(self.2[motor]);
        let frame = CanFrame::standard(id, [0x10, 0, 0, 0, 0, 0, 30, 3]);
        frame.filter(|_| !M::FACTS.name.starts_with("GM6020"))
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        self.0.drive(self.1.map(|handle| (handle, velocity(share))))
    }
    fn drive_unsupported(&mut self) -> Result<(), TargetError> {
        let positions = self.1.map(|handle| self.0.set_position(handle, Position::ZERO));
        positions.into_iter().collect()
    }
}

#[test]
fn a_bus_of_each_model_keeps_the_contract() {
    assert_eq!(check_contract(|| OneModel::<M3508, 4>::new([1, 2, 3, 4], |c| c)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<M3508, 2>::new([2, 7], Config::reversed)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<M2006, 3>::new([1, 5, 8], |c| c)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<Gm6020Voltage, 2>::new([1, 7], |c| c)), Ok(RULES));
    assert_eq!(check_contract(|| OneModel::<Gm6020Current, 2>::new([4, 5], |c| c)), Ok(RULES));
    let opening = Duration::from_millis(50);
    let ramps =
        || OneModel::<M3508, 2>::new([1, 2], |config| config.with_resume().with_opening(opening));
    assert_eq!(check_contract(ramps), Ok(RULES));
}

#[test]
fn tuples_and_arrays_of_buses_keep_the_contract() {
    let pair = || Mixed {
        device: (bus::<M3508>(&[1, 2]), bus::<Gm6020Voltage>(&[5])),
        ids: vec![0x201, 0x202, 0x209],
        drive: |(wheels, yaw), share| drive_all(wheels, share).and(drive_all(yaw, share)),
    };
    assert_eq!(check_contract(pair), Ok(RULES));
    let array = || Mixed {
        device: [bus::<M3508>(&[1]), bus::<M2006>(&[6]), bus::<Gm6020Current>(&[7])],
        ids: vec![0x201, 0x206, 0x20B],
        drive: |buses, share| {
            let outcomes = buses.each_mut().map(|bus| drive_all(bus, share));
            outcomes.into_iter().collect()
        },
    };
    assert_eq!(check_contract(array), Ok(RULES));
}

#[test]
fn the_motor_of_the_example_keeps_the_contract_alone_and_beside_dji_motors() {
    let alone = || Mixed {
        device: Actuator::new(MyMotor::new(3).unwrap()),
        ids: vec![0x143],
        drive: drive_own,
    };
    assert_eq!(check_contract(alone), Ok(RULES));
    let beside = || Mixed {
        device: (
            bus::<M3508>(&[1]),
            Actuator::new(MyMotor::new(3).unwrap()),
            Actuator::new(MyMotor::new(4).unwrap()),
        ),
        ids: vec![0x201, 0x143, 0x144],
        drive: |(bus, third, fourth), share| {
            let (bus, third) = (drive_all(bus, share), drive_own(third, share));
            bus.and(third).and(drive_own(fourth, share))
        },
    };
    assert_eq!(check_contract(beside), Ok(RULES));
}
