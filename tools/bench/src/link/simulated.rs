//! The simulated robot: motors with lifted wheels on one bus of the simulator.

use super::{Heard, Taken};
use crate::drive::{MOTOR_NM_PER_A, master_id};
use crate::motors::{Model, Spec};
use crate::own::each;
use drivetrain::encoder::GearRatio;
use drivetrain::frame::CanFrame;
use drivetrain::odrive::Firmware;
use drivetrain::sim::{
    DamiaoDrive, Drive, DriveShaft, Fault, Line, LkDrive, MotorConfig, MotorKey, OdriveDrive,
    RmdDrive, RobStrideDrive, Simulation, VescDrive,
};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use drivetrain::vesc;
use embedded_can::{Error as _, nb::Can};

/// The bus of the robot.
const BUS: Line = Line::Can1;

/// The load of a GM6020 by voltage: without one, its shaft follows a voltage too fast to be identified.
const TURRET_KG_M2: f32 = 0.03;

/// The time that the world moves on at once.
const STEP: Duration = Duration::from_micros(250);

/// A drive that hears each frame of the bus.
#[derive(Debug)]
enum Kind {
    Damiao(DamiaoDrive),
    Lk(LkDrive),
    Rmd(RmdDrive),
    RobStride(RobStrideDrive),
    Odrive(OdriveDrive),
    Vesc(VescDrive),
}

#[derive(Debug)]
enum Place {
    Dji(MotorKey),
    Actuator(Box<Kind>),
}

#[derive(Debug)]
struct Motor {
    place: Place,
    /// A drive of another family is cut off until then.
    silent_until: Instant,
}

/// The simulated motors, in the order in which the command line names them.
#[derive(Debug)]
pub(crate) struct Simulated {
    world: Simulation,
    motors: Vec<Motor>,
}

impl Simulated {
    /// # Errors
    /// Names the motor that the simulator does not have.
    pub(crate) fn new(specs: &[Spec], seed: u64) -> Result<Self, String> {
        let world = Simulation::new(seed);
        let motors = specs.iter().map(|spec| {
            let place = match dji(*spec) {
                Some(config) => {
                    Place::Dji(world.attach(config).map_err(|error| error.to_string())?)
                }
                None => {
                    Place::Actuator(Box::new(kind(*spec).ok_or("a motor that is not simulated")?))
                }
            };
            Ok(Motor { place, silent_until: Instant::START })
        });
        let motors = motors.collect::<Result<_, String>>()?;
        Ok(Self { world, motors })
    }

    /// Moves the world on by a quarter of a millisecond.
    pub(crate) fn advance(&mut self) -> Duration {
        let now = self.world.now();
        let mut drives: Vec<(Line, &mut dyn Drive)> = Vec::new();
        for motor in &mut self.motors {
            let Place::Actuator(kind) = &mut motor.place else { continue };
            if motor.silent_until <= now {
                drives.push((BUS, kind.drive()));
            } else {
                kind.drive().step(STEP.as_secs_f32());
            }
        }
        // A bus that is full of foreign frames loses an answer, as a real one does.
        _ = self.world.advance_drives(STEP, &mut drives);
        STEP
    }

    /// Cuts a motor off for a while.
    pub(crate) fn silence(&mut self, motor: usize, time: Duration) {
        let (now, until) = (self.world.now(), self.world.now() + time);
        let Some(motor) = self.motors.get_mut(motor) else { return };
        match &motor.place {
            // Refused only if 16 faults last already.
            Place::Dji(key) => _ = self.world.fault(Fault::Silent(*key), now..until),
            Place::Actuator(_) => motor.silent_until = until,
        }
    }

    pub(crate) fn send(&mut self, frame: &CanFrame) -> Taken {
        match self.world.controller_on(BUS).transmit(frame) {
            Ok(_) => Taken::Yes,
            Err(nb::Error::WouldBlock) => Taken::Full,
            Err(nb::Error::Other(error)) => Taken::Failed(error.kind()),
        }
    }

    pub(crate) fn receive(&mut self) -> Option<Heard> {
        match self.world.controller_on(BUS).receive() {
            Ok(frame) => Some(Heard::Frame(frame)),
            Err(nb::Error::WouldBlock) => None,
            Err(nb::Error::Other(error)) => Some(Heard::Failed(error.kind())),
        }
    }

    /// The word or the torque at a motor, for a test.
    #[cfg(test)]
    pub(crate) fn is_at_rest(&self, motor: usize) -> bool {
        match &self.motors[motor].place {
            Place::Dji(key) => self.world.motor(*key).unwrap().command == 0,
            Place::Actuator(kind) => kind.torque_nm() == 0.0,
        }
    }

    /// The velocity of a shaft in rad/s, for a test.
    #[cfg(test)]
    pub(crate) fn velocity(&self, motor: usize) -> f32 {
        match &self.motors[motor].place {
            Place::Dji(key) => self.world.motor(*key).unwrap().velocity.as_rad_per_s(),
            Place::Actuator(kind) => kind.shaft().velocity_rad_per_s(),
        }
    }
}

/// A motor of DJI as the simulator has it.
fn dji(spec: Spec) -> Option<MotorConfig> {
    let Spec { id, .. } = spec;
    Some(match spec.model {
        Model::M3508 => MotorConfig::m3508(id),
        Model::M2006 => MotorConfig::m2006(id),
        Model::Gm6020 => MotorConfig::gm6020_voltage(id).with_load_inertia_kg_m2(TURRET_KG_M2),
        Model::Gm6020Current => MotorConfig::gm6020_current(id),
        _ => return None,
    })
}

/// An unloaded shaft that its motor's gentle torque brings to 30 rad/s in half a second.
fn shaft(limit_nm: f32) -> DriveShaft {
    DriveShaft::new(limit_nm / 60.0, limit_nm / 300.0)
}

/// A drive of another family.
fn kind(spec: Spec) -> Option<Kind> {
    let id = spec.id;
    Some(match spec.model {
        Model::Damiao(model) => {
            let drive = DamiaoDrive::of(model, id).with_register(7, f32::from(master_id(spec)));
            Kind::Damiao(drive.with_shaft(shaft(0.3 * model.tmax_nm())))
        }
        Model::Lk(model) => {
            let shaft = shaft(0.3 * model.max_torque_nm());
            Kind::Lk(LkDrive::of(model, id).with_shaft(shaft))
        }
        Model::Rmd(model) => {
            let drive = RmdDrive::new(id, model.torque_constant());
            Kind::Rmd(drive.with_shaft(shaft(0.3 * model.max_torque_nm())))
        }
        Model::RobStride(model) => {
            let shaft = shaft(0.3 * model.tmax_nm());
            Kind::RobStride(RobStrideDrive::of(model, id).with_shaft(shaft))
        }
        Model::Odrive(firmware) => {
            let is_0_6 = firmware == Firmware::V0_6;
            let drive = OdriveDrive::new(id, is_0_6, MOTOR_NM_PER_A, 1.0).with_periods(0.1, 0.002);
            Kind::Odrive(drive.with_shaft(shaft(0.35)))
        }
        Model::Vesc(pole_pairs) => {
            let motor = vesc::Model {
                name: "VESC",
                pole_pairs,
                gear: GearRatio::DIRECT,
                torque_constant_nm_per_a: MOTOR_NM_PER_A,
                current_limit_a: 60.0,
                max_velocity: AngularVelocity::from_rad_per_s(600.0),
            };
            let drive = VescDrive::of(motor, id).with_timeout(0.1, 0.0).with_status_hz(500.0);
            Kind::Vesc(drive.with_shaft(shaft(0.35)))
        }
        Model::M3508 | Model::M2006 | Model::Gm6020 | Model::Gm6020Current => return None,
    })
}

impl Kind {
    fn drive(&mut self) -> &mut dyn Drive {
        each!(self, drive => drive)
    }

    #[cfg(test)]
    fn torque_nm(&self) -> f32 {
        self.shaft().torque_nm()
    }

    #[cfg(test)]
    fn shaft(&self) -> &DriveShaft {
        each!(self, drive => drive.shaft())
    }
}
