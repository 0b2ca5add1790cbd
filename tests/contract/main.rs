//! Every device keeps the contract of `Devices`: each model, tuples and arrays of buses, a motor of one's own, joints, and
//! motors on pins; and the check finds devices that do not.

#![cfg(test)]

mod careless;
mod damiao;
mod dji;
mod joints;
mod lk;
mod mit;
mod odrive;
#[cfg(feature = "hal")]
mod pins;
mod rmd;
mod robstride;
mod vesc;

use drivetrain::control::PidConfig;
use drivetrain::dji::{AnyHandle, Bus, Config, Model};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, Claim, Devices, DriveProtocol, Ingest, MotorName, Order, TargetError, VelocityDrive,
    Vitals,
};
use drivetrain::sim::contract::{Subject, check_contract};
use drivetrain::units::AngularVelocity;
use embedded_can::Frame;

#[expect(dead_code, reason = "the example's own main and simulation")]
#[path = "../../examples/custom_motor.rs"]
mod custom_motor;
use custom_motor::MyMotor;

const SPEED: PidConfig = PidConfig::new(1.0, 4.0, 0.0);
const RULES: usize = 29;

fn velocity(share: f32) -> AngularVelocity {
    AngularVelocity::from_rad_per_s(5.0 * share)
}

fn rest(id: u16) -> Option<CanFrame> {
    CanFrame::standard(id, [0x10, 0, 0, 0, 0, 0, 30, 0])
}

/// Anything with a list of feedback ids and a function that drives it.
struct Mixed<D> {
    device: D,
    ids: Vec<u16>,
    drive: fn(&mut D, f32) -> Result<(), TargetError>,
}

impl<D: Devices> Subject for Mixed<D> {
    type Device = D;
    fn device(&mut self) -> &mut D {
        &mut self.device
    }
    fn motors(&self) -> usize {
        self.ids.len()
    }
    fn feedback(&self, motor: usize) -> Option<CanFrame> {
        match self.ids[motor] {
            own @ 0x140..0x150 => CanFrame::new(id(own), &[0, 0, 30]),
            dji => rest(dji),
        }
    }
    fn drive(&mut self, share: f32) -> Result<(), TargetError> {
        (self.drive)(&mut self.device, share)
    }
}

fn id(raw: u16) -> embedded_can::StandardId {
    embedded_can::StandardId::new(raw).unwrap()
}

fn bus<M: Model>(ids: &[u8]) -> Bus {
    let mut bus = Bus::new();
    for id in ids {
        bus.attach(Config::<M>::new(*id).speed_loop(SPEED)).unwrap();
    }
    bus
}

fn drive_all(bus: &mut Bus, share: f32) -> Result<(), TargetError> {
    let motors: Vec<AnyHandle> = bus.motors().map(|(motor, _)| motor).collect();
    bus.drive(motors.into_iter().map(|motor| (motor, velocity(share))))
}

fn drive_own(motor: &mut Actuator<MyMotor>, share: f32) -> Result<(), TargetError> {
    motor.set_velocity((), velocity(share))
}

/// A motor that claims blocks of ids: its frames differ in bits that the masks leave out.
struct Block(MyMotor, u16);

impl Block {
    const MASK: u32 = 0x7F3;

    /// The next of the four ids.
    fn next(&mut self, frame: CanFrame) -> CanFrame {
        self.1 = (self.1 + 4) % 16;
        CanFrame::new(id(u16::try_from(frame.header()).unwrap() + self.1), frame.data()).unwrap()
    }
}

impl DriveProtocol for Block {
    fn name(&self) -> MotorName {
        self.0.name()
    }
    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        self.0.claims().into_iter().map(|claim| claim.with_mask(Self::MASK))
    }
    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        self.0.decode(frame)
    }
    fn velocity(&self) -> AngularVelocity {
        self.0.velocity()
    }
    fn rest(&mut self) -> CanFrame {
        let frame = self.0.rest();
        self.next(frame)
    }
    fn control(&mut self, order: Order) -> CanFrame {
        let frame = self.0.control(order);
        self.next(frame)
    }
    fn reset(&mut self) {
        self.0.reset();
    }
    fn vitals(&self) -> Vitals {
        self.0.vitals()
    }
}

// At d71443a: `ClaimsFeedback` broken, and `SendsWhatItClaims`, as the check looked at the first id of a block only.
#[test]
fn motors_that_claim_blocks_of_ids_keep_the_contract() {
    let motor = |id| Actuator::new(Block(MyMotor::new(id).unwrap(), 0));
    let made = || Mixed {
        device: [motor(1), motor(2)],
        ids: vec![0x145, 0x14E],
        drive: |motors: &mut [Actuator<Block>; 2], share| {
            let [first, second] =
                motors.each_mut().map(|motor| motor.set_velocity((), velocity(share)));
            first.and(second)
        },
    };
    assert_eq!(check_contract(made), Ok(RULES));
}
