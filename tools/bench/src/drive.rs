//! A motor of a family whose drives have frames of their own, and the speed loop over its torque.

use crate::motors::{Model, Spec};
use crate::own::{Kind, each};
use drivetrain::control::{Pid, PidConfig};
use drivetrain::encoder::GearRatio;
use drivetrain::motor::{
    Actuator, CanDevice, Devices, DriveProtocol, Health, ImpedanceControl, TargetError, Visitor,
};
use drivetrain::time::TimeStep;
use drivetrain::units::AngularVelocity;
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};

/// The share of a motor's largest torque that the bench asks for at most, for a first try.
const GENTLE: f32 = 0.3;

/// The torque constant and the current of a motor at a VESC or an ODrive, which only its owner knows: gentle ones.
pub(crate) const MOTOR_NM_PER_A: f32 = 0.035;
const MOTOR_A: f32 = 10.0;
/// The velocity constant to that torque constant: 8.27 Nm/A for 1 rpm/V.
const ODRIVE_RPM_PER_V: f32 = 8.27 / MOTOR_NM_PER_A;
const MOTOR_RPM: f32 = 6_000.0;

/// The id under which a Damiao answers.
pub(crate) fn master_id(spec: Spec) -> u16 {
    spec.host.unwrap_or(0x10 + u16::from(spec.id))
}

/// A motor that takes torques, with a speed loop of the bench, so that its gains change while it turns.
#[derive(Debug)]
pub(crate) struct Drive {
    kind: Kind,
    speed: Pid,
    limit_nm: f32,
    /// The speed without load in rad/s, or that of the feedback's range.
    pub(crate) top_speed: f32,
}

impl Drive {
    /// # Errors
    /// Names what is wrong with the motor.
    pub(crate) fn new(spec: Spec) -> Result<Self, String> {
        let (kind, limit_nm) = kind(spec)?;
        // An unloaded shaft follows in some 0.1 s; `tune` finds better gains.
        let config =
            PidConfig::new(0.1 * limit_nm, 0.3 * limit_nm, 0.0).with_output_limit(limit_nm);
        let top_speed = top_speed(spec.model);
        Ok(Self { kind, speed: Pid::new(config).map_err(text)?, limit_nm, top_speed })
    }

    /// The largest torque in Nm that is asked for.
    pub(crate) fn limit_nm(&self) -> f32 {
        self.limit_nm
    }

    pub(crate) fn gains(&self) -> (f32, f32, f32) {
        self.speed.config().gains()
    }

    /// # Errors
    /// Names the gain that is none.
    pub(crate) fn set_gains(&mut self, kp: f32, ki: f32, kd: f32) -> Result<(), String> {
        self.speed.set_gains(kp, ki, kd).map_err(text)
    }

    /// Asks for a speed in rad/s by the loop over the torque; a refused target lets the loop begin anew.
    ///
    /// # Errors
    /// Says why the motor takes no target.
    pub(crate) fn set_velocity(&mut self, rad_per_s: f32, dt_s: f32) -> Result<(), TargetError> {
        let measured = self.velocity();
        let torque_nm = self.speed.step(rad_per_s, measured, &TimeStep::of(dt_s));
        let set = self.set_torque(torque_nm);
        if set.is_err() {
            self.speed.reset();
        }
        set
    }

    /// # Errors
    /// Says why the motor takes no target.
    pub(crate) fn set_torque(&mut self, torque_nm: f32) -> Result<(), TargetError> {
        let torque_nm = torque_nm.max(-self.limit_nm).min(self.limit_nm);
        each!(&mut self.kind, own => own.set_torque(torque_nm))
    }

    /// The measured velocity of the output shaft in rad/s.
    pub(crate) fn velocity(&self) -> f32 {
        each!(&self.kind, own => own.motor().velocity().as_rad_per_s())
    }

    /// The angle of the output shaft in turns, if it is known.
    pub(crate) fn turns(&self) -> Option<f64> {
        each!(&self.kind, own => own.motor().angle()).map(|angle| angle.as_turns().into())
    }

    /// The torque that the drive reports, in Nm, if it reports one.
    pub(crate) fn torque_nm(&self) -> Option<f32> {
        match &self.kind {
            Kind::Damiao(own) => Some(own.motor().feedback()?.measured.torque_nm),
            Kind::RobStride(own) => Some(own.motor().feedback()?.measured.torque_nm),
            Kind::Vesc(own) => Some(own.motor().feedback().current_a? * MOTOR_NM_PER_A),
            Kind::Lk(_) | Kind::Rmd(_) | Kind::Odrive(_) => None,
        }
    }

    /// Tells whether the drive reports when it is asked, and not by itself.
    pub(crate) fn answers_only(&self) -> bool {
        !matches!(self.kind, Kind::Odrive(_) | Kind::Vesc(_))
    }

    pub(crate) fn health(&self) -> Health {
        each!(&self.kind, own => own.health())
    }

    pub(crate) fn is_armed(&self) -> bool {
        each!(&self.kind, own => CanDevice::is_armed(own))
    }

    pub(crate) fn visit(&mut self, visitor: &mut impl Visitor) {
        each!(&mut self.kind, own => Devices::visit(own, visitor));
    }
}

/// Finds a register by its name in the crate or in the manual of the drive.
fn found<R: Copy + std::fmt::Debug>(
    registers: &[R],
    manual: fn(R) -> &'static str,
    name: &str,
) -> Result<R, String> {
    let names = |register: &R| [format!("{register:?}"), manual(*register).to_owned()];
    let is_named = |of: &[String; 2]| of.iter().any(|own| own.eq_ignore_ascii_case(name));
    let register = registers.iter().find(|register| is_named(&names(register)));
    let all: Vec<_> = registers.iter().map(|register| names(register).join(" = ")).collect();
    register.copied().ok_or(format!("no register {name}, but {}", all.join(", ")))
}

fn of_damiao(name: &str) -> Result<damiao::Register, String> {
    found(damiao::Register::ALL, damiao::Register::manual, name)
}

fn of_robstride(name: &str) -> Result<robstride::Register, String> {
    found(robstride::Register::ALL, robstride::Register::manual, name)
}

/// Registers and ids, of the families that have them.
impl Drive {
    pub(crate) fn has_registers(&self) -> bool {
        matches!(self.kind, Kind::Damiao(_) | Kind::RobStride(_))
    }

    /// # Errors
    /// If there is no such register.
    pub(crate) fn read(&mut self, name: &str) -> Result<(), String> {
        match &mut self.kind {
            Kind::Damiao(own) => own.motor_mut().read(of_damiao(name)?),
            Kind::RobStride(own) => own.motor_mut().read(of_robstride(name)?),
            _ => {}
        }
        Ok(())
    }

    /// # Errors
    /// If there is no such register, or the value cannot be written there.
    pub(crate) fn write(&mut self, name: &str, value: f32) -> Result<(), String> {
        match &mut self.kind {
            Kind::Damiao(own) => own.motor_mut().write(of_damiao(name)?, value).map_err(text),
            Kind::RobStride(own) => own.motor_mut().write(of_robstride(name)?, value).map_err(text),
            _ => Ok(()),
        }
    }

    /// The last answer, if it is of this register.
    pub(crate) fn answer(&self, name: &str) -> Option<f32> {
        let (is_its, value) = match &self.kind {
            Kind::Damiao(own) => {
                let (register, value) = own.motor().register()?;
                (of_damiao(name) == Ok(register), value)
            }
            Kind::RobStride(own) => {
                let (register, value) = own.motor().register()?;
                (of_robstride(name) == Ok(register), value)
            }
            _ => return None,
        };
        is_its.then_some(value)
    }

    /// Has the drive keep what was written, where it does so only then.
    ///
    /// # Errors
    /// If the drive has nothing to store with.
    pub(crate) fn store(&mut self) -> Result<(), String> {
        match &mut self.kind {
            Kind::Damiao(own) => own.motor_mut().store(),
            // Without a frame for it, the drive keeps what it is told by itself, or not at all.
            Kind::RobStride(own) => _ = own.motor_mut().store(),
            _ => {}
        }
        Ok(())
    }

    /// # Errors
    /// If the drive cannot have the id.
    pub(crate) fn set_id(&mut self, id: u8) -> Result<(), String> {
        match &mut self.kind {
            Kind::Damiao(_) if !(1..=15).contains(&id) => {
                Err(format!("id {id}: 1 to 15 are allowed"))
            }
            Kind::Damiao(own) => {
                own.motor_mut().write(damiao::Register::Id, id.into()).map_err(text)
            }
            Kind::RobStride(own) => own.motor_mut().set_id(id).map_err(text),
            _ => Ok(()),
        }
    }
}

/// The speed without load in rad/s, by the torque constant where no table has it, or that of the feedback's range.
fn top_speed(model: Model) -> f32 {
    const SUPPLY_V: f32 = 24.0;
    match model {
        Model::Damiao(model) => model.vmax_rad_per_s(),
        Model::RobStride(model) => model.vmax_rad_per_s(),
        Model::Lk(model) => SUPPLY_V / model.torque_constant(),
        Model::Rmd(model) => SUPPLY_V / model.torque_constant(),
        _ => AngularVelocity::from_rpm(MOTOR_RPM).as_rad_per_s(),
    }
}

/// Makes the motor, and says how much torque it is to give at most.
fn kind(spec: Spec) -> Result<(Kind, f32), String> {
    let Spec { id, host, .. } = spec;
    let mode = |nm: f32| ImpedanceControl::new(nm).map_err(text);
    Ok(match spec.model {
        Model::Damiao(model) => {
            let nm = GENTLE * model.tmax_nm();
            let motor = damiao::Motor::new(model, id, mode(nm)?).map_err(text)?;
            let motor = match host {
                Some(master) => motor.with_master_id(master).map_err(text)?,
                None => motor,
            };
            (Kind::Damiao(Actuator::new(motor)), nm)
        }
        Model::Lk(model) => {
            let nm = GENTLE * model.max_torque_nm();
            (Kind::Lk(Actuator::new(lk::Motor::new(model, id, mode(nm)?).map_err(text)?)), nm)
        }
        Model::Rmd(model) => {
            let nm = GENTLE * model.max_torque_nm();
            (Kind::Rmd(Actuator::new(rmd::Motor::new(model, id, mode(nm)?).map_err(text)?)), nm)
        }
        Model::RobStride(model) => {
            let nm = GENTLE * model.tmax_nm();
            let motor = robstride::Motor::new(model, id, mode(nm)?).map_err(text)?;
            let motor = match host.map(u8::try_from) {
                Some(Ok(host)) => motor.with_host_id(host).map_err(text)?,
                Some(Err(_)) => return Err("a host id of RobStride is at most 255".into()),
                None => motor,
            };
            (Kind::RobStride(Actuator::new(motor)), nm)
        }
        Model::Odrive(firmware) => {
            let nm = MOTOR_A * MOTOR_NM_PER_A;
            let model = odrive::Model::new("ODrive", ODRIVE_RPM_PER_V).map_err(text)?;
            let fastest = AngularVelocity::from_rpm(MOTOR_RPM);
            let motor = odrive::Motor::new(model, firmware, id, fastest, mode(nm)?);
            (Kind::Odrive(Actuator::new(motor.map_err(text)?)), nm)
        }
        Model::Vesc(pole_pairs) => {
            let model = vesc::Model {
                name: "VESC",
                pole_pairs,
                gear: GearRatio::DIRECT,
                torque_constant_nm_per_a: MOTOR_NM_PER_A,
                current_limit_a: MOTOR_A,
                max_velocity: AngularVelocity::from_rpm(MOTOR_RPM),
            };
            let motor = vesc::Motor::new(model, id, vesc::Mode::current()).map_err(text)?;
            (Kind::Vesc(Actuator::new(motor)), model.torque_limit_nm())
        }
        Model::M3508 | Model::M2006 | Model::Gm6020 | Model::Gm6020Current => {
            return Err("a motor of DJI belongs to a bus".into());
        }
    })
}

fn text(error: impl ToString) -> String {
    error.to_string()
}
