//! The motors of a session as one device: those of DJI on a bus, all others beside it.

use crate::drive::Drive;
use crate::motors::{Model, Spec};
use drivetrain::control::PidConfig;
use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Counters, Facts, Gm6020Current, Gm6020Voltage, M2006,
    M3508, Model as _,
};
use drivetrain::motor::{Devices, Health, Link, MotorName, TargetError, Visitor};
use drivetrain::units::AngularVelocity;

/// Gentle limits for a first try: amperes of M3508 and M2006, volts of GM6020.
const M3508_SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0).with_output_limit(6.0);
const M2006_SPEED: PidConfig = PidConfig::new(0.15, 1.5, 0.0).with_output_limit(3.0);
const GM6020_SPEED: PidConfig = PidConfig::new(1.0, 5.0, 0.0).with_output_limit(10.0);
const GM6020_CURRENT_SPEED: PidConfig = PidConfig::new(0.1, 1.0, 0.0).with_output_limit(1.0);

/// Target of a motor, at its output shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Target {
    /// In rad/s.
    Velocity(f32),
    /// In A, V or Nm: [`Robot::unit`] says which.
    Effort(f32),
}

/// What a motor reports.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    pub(crate) rad_per_s: f32,
    pub(crate) turns: Option<f64>,
    /// In A or Nm: [`Robot::measured_unit`] says which.
    pub(crate) effort: Option<f32>,
    pub(crate) error: Option<String>,
    pub(crate) health: Health,
}

impl Reading {
    pub(crate) fn is_heard(&self) -> bool {
        self.health.link == Link::Online
    }
}

#[derive(Debug)]
struct Dji {
    handle: AnyHandle,
    facts: &'static Facts,
    speed: PidConfig,
}

#[derive(Debug)]
enum Place {
    Dji(Dji),
    /// By its place among those of other families.
    Actuator(usize),
}

/// Returns the facts of a model of DJI.
fn facts(model: Model) -> Option<&'static Facts> {
    match model {
        Model::M3508 => Some(M3508::FACTS),
        Model::M2006 => Some(M2006::FACTS),
        Model::Gm6020 => Some(Gm6020Voltage::FACTS),
        Model::Gm6020Current => Some(Gm6020Current::FACTS),
        _ => None,
    }
}

/// The motors of a session.
#[derive(Debug)]
pub(crate) struct Robot {
    bus: Bus,
    own: Vec<Drive>,
    places: Vec<(MotorName, Place)>,
}

impl Devices for Robot {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        if self.places.len() > self.own.len() {
            self.bus.visit(visitor);
        }
        self.own.iter_mut().for_each(|drive| drive.visit(visitor));
    }
}

impl Robot {
    /// Attaches all of them. In a chassis the motors 1 and 4, on the right side, are reversed.
    ///
    /// # Errors
    /// Names the motor that is none, and two that share an id.
    pub(crate) fn new(specs: &[Spec], is_chassis: bool) -> Result<Self, String> {
        let mut robot = Self { bus: Bus::new(), own: Vec::new(), places: Vec::new() };
        for spec in specs {
            let place = match facts(spec.model) {
                Some(facts) => Place::Dji(robot.attach(*spec, facts, is_chassis)?),
                None => {
                    robot.own.push(Drive::new(*spec)?);
                    Place::Actuator(robot.own.len() - 1)
                }
            };
            let name = match &place {
                Place::Dji(dji) => robot
                    .bus
                    .motors()
                    .find(|(handle, _)| *handle == dji.handle)
                    .map(|(_, name)| name),
                Place::Actuator(index) => robot.own.get(*index).map(|drive| drive.health().motor),
            };
            robot.places.push((name.ok_or("a motor without a name")?, place));
        }
        match robot.clash() {
            Some((one, other)) => Err(format!("--motors: {one}, which is {other}")),
            None => Ok(robot),
        }
    }

    fn attach(
        &mut self,
        spec: Spec,
        facts: &'static Facts,
        is_chassis: bool,
    ) -> Result<Dji, String> {
        let (id, bus) = (spec.id, &mut self.bus);
        let is_right = is_chassis && matches!(id, 1 | 4);
        let done: Result<(AnyHandle, PidConfig), AttachError> = match spec.model {
            Model::M2006 => {
                let config = Config::<M2006>::new(id).speed_loop(M2006_SPEED);
                bus.attach(config).map(|motor| (motor.into(), M2006_SPEED))
            }
            Model::Gm6020 => {
                let config = Config::<Gm6020Voltage>::new(id).speed_loop(GM6020_SPEED);
                bus.attach(config).map(|motor| (motor.into(), GM6020_SPEED))
            }
            Model::Gm6020Current => {
                let config = Config::<Gm6020Current>::new(id).speed_loop(GM6020_CURRENT_SPEED);
                bus.attach(config).map(|motor| (motor.into(), GM6020_CURRENT_SPEED))
            }
            _ => {
                let config = Config::<M3508>::new(id).speed_loop(M3508_SPEED);
                let config = if is_right { config.reversed() } else { config };
                bus.attach(config).map(|motor| (motor.into(), M3508_SPEED))
            }
        };
        let (handle, speed) = done.map_err(|error| error.to_string())?;
        Ok(Dji { handle, facts, speed })
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = MotorName> {
        self.places.iter().map(|(name, _)| *name)
    }

    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    fn place(&self, motor: usize) -> Option<&Place> {
        self.places.get(motor).map(|(_, place)| place)
    }

    fn drive(&self, motor: usize) -> Option<&Drive> {
        match self.place(motor)? {
            Place::Actuator(index) => self.own.get(*index),
            Place::Dji(_) => None,
        }
    }

    /// The first motor, if it has registers.
    pub(crate) fn first_drive(&mut self) -> Option<&mut Drive> {
        match self.places.first()? {
            (_, Place::Actuator(index)) => {
                self.own.get_mut(*index).filter(|drive| drive.has_registers())
            }
            (_, Place::Dji(_)) => None,
        }
    }

    /// Tells whether a motor reports when it is asked, and not by itself.
    pub(crate) fn answers_only(&self, motor: usize) -> bool {
        self.drive(motor).is_some_and(Drive::answers_only)
    }

    /// The unit of [`Target::Effort`].
    pub(crate) fn unit(&self, motor: usize) -> &'static str {
        match self.place(motor) {
            Some(Place::Dji(dji)) if dji.facts.name == "GM6020 (voltage)" => "V",
            Some(Place::Dji(_)) => "A",
            _ => "Nm",
        }
    }

    /// The torque in Nm for a unit of effort; `None` for a voltage.
    pub(crate) fn torque_constant_nm(&self, motor: usize) -> Option<f32> {
        match self.place(motor)? {
            Place::Dji(_) if self.unit(motor) == "V" => None,
            Place::Dji(dji) => Some(dji.facts.torque_constant_nm_per_a),
            Place::Actuator(_) => Some(1.0),
        }
    }

    /// The unit of [`Reading::effort`].
    pub(crate) fn measured_unit(&self, motor: usize) -> &'static str {
        if self.drive(motor).is_some() { "Nm" } else { "A" }
    }

    /// The largest effort that is asked for.
    pub(crate) fn limit(&self, motor: usize) -> f32 {
        match self.place(motor) {
            Some(Place::Dji(dji)) => dji.speed.output_range().1,
            _ => self.drive(motor).map_or(0.0, Drive::limit_nm),
        }
    }

    /// The speed without load in rad/s, as far as it is known.
    pub(crate) fn top_speed(&self, motor: usize) -> f32 {
        match self.place(motor) {
            Some(Place::Dji(dji)) => {
                AngularVelocity::from_rpm(dji.facts.no_load_rpm).as_rad_per_s()
            }
            _ => self.drive(motor).map_or(0.0, |drive| drive.top_speed),
        }
    }

    pub(crate) fn gains(&self, motor: usize) -> (f32, f32, f32) {
        match self.place(motor) {
            Some(Place::Dji(dji)) => dji.speed.gains(),
            _ => self.drive(motor).map_or((0.0, 0.0, 0.0), Drive::gains),
        }
    }

    /// Changes the gains of a speed loop, while it runs too.
    ///
    /// # Errors
    /// Names the gain that is none.
    pub(crate) fn set_gains(&mut self, motor: usize, gains: (f32, f32, f32)) -> Result<(), String> {
        let (kp, ki, kd) = gains;
        match self.places.get_mut(motor) {
            Some((_, Place::Dji(dji))) => {
                let speed = dji.speed.with_gains(kp, ki, kd);
                self.bus.set_speed_loop(dji.handle, speed).map_err(|error| error.to_string())?;
                dji.speed = speed;
                Ok(())
            }
            Some((_, Place::Actuator(index))) => match self.own.get_mut(*index) {
                Some(drive) => drive.set_gains(kp, ki, kd),
                None => Ok(()),
            },
            None => Ok(()),
        }
    }

    /// Asks a motor for something.
    ///
    /// # Errors
    /// Says why the motor takes no target.
    pub(crate) fn set(
        &mut self,
        motor: usize,
        target: Target,
        dt_s: f32,
    ) -> Result<(), TargetError> {
        match self.places.get(motor) {
            Some((_, Place::Dji(dji))) => match target {
                Target::Velocity(rad_per_s) => {
                    let velocity = AngularVelocity::from_rad_per_s(rad_per_s);
                    self.bus.set_velocity(dji.handle, velocity)
                }
                Target::Effort(effort) => {
                    let (lowest, highest) = dji.speed.output_range();
                    let word = dji.facts.to_word(effort.max(lowest).min(highest));
                    self.bus.set_raw(dji.handle, word)
                }
            },
            Some((_, Place::Actuator(index))) => {
                let drive = self.own.get_mut(*index).ok_or(TargetError::Detached)?;
                match target {
                    Target::Velocity(rad_per_s) => drive.set_velocity(rad_per_s, dt_s),
                    Target::Effort(torque_nm) => drive.set_torque(torque_nm),
                }
            }
            None => Err(TargetError::Detached),
        }
    }

    /// What a motor reports; `None` before it is heard.
    pub(crate) fn reading(&self, motor: usize) -> Option<Reading> {
        match self.place(motor)? {
            Place::Dji(dji) => {
                let (state, health) = (self.bus.state(dji.handle)?, self.bus.health(dji.handle)?);
                Some(Reading {
                    rad_per_s: state.velocity.as_rad_per_s(),
                    turns: Some(
                        state.position.turns() as f64
                            + f64::from(state.position.angle().as_turns()),
                    ),
                    effort: Some(state.current.as_amperes()),
                    error: state.error.map(|error| error.to_string()),
                    health,
                })
            }
            Place::Actuator(_) => {
                let drive = self.drive(motor)?;
                let health = drive.health();
                Some(Reading {
                    rad_per_s: drive.velocity(),
                    turns: drive.turns(),
                    effort: drive.torque_nm(),
                    error: (health.error_code != 0).then(|| format!("error {}", health.error_code)),
                    health,
                })
                .filter(|reading| reading.health.link != Link::Unheard)
            }
        }
    }

    /// The effort that holds the present speed, in the unit of [`Target::Effort`], as far as it is known: by the feedback, or of a
    /// voltage by the speed without load.
    pub(crate) fn holding_effort(&self, motor: usize) -> Option<f32> {
        let reading = self.reading(motor)?;
        match self.place(motor)? {
            Place::Dji(dji) if self.unit(motor) == "V" => {
                let no_load = AngularVelocity::from_rpm(dji.facts.no_load_rpm).as_rad_per_s();
                Some(dji.facts.command_full_scale * reading.rad_per_s / no_load)
            }
            _ => reading.effort,
        }
    }

    pub(crate) fn is_motor_armed(&self, motor: usize) -> bool {
        match self.place(motor) {
            Some(Place::Dji(dji)) => self.bus.is_motor_armed(dji.handle),
            _ => self.drive(motor).is_some_and(Drive::is_armed),
        }
    }

    /// Counters of the DJI bus.
    pub(crate) fn counters(&self) -> Counters {
        self.bus.counters()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motors;

    #[test]
    fn all_seven_families_are_one_device_and_have_a_unit_and_a_limit() {
        let list =
            "m3508:1,gm6020:5,damiao4310:1,mg4005e-i10:2,rmd-x8-90:3,rs02:4,odrive0.6:5,vesc7:6";
        let mut robot = Robot::new(&motors::parse(list).unwrap(), false).unwrap();
        assert_eq!((robot.len(), robot.names().count()), (8, 8));
        let units: Vec<_> = (0..8).map(|motor| robot.unit(motor)).collect();
        assert_eq!(units, ["A", "V", "Nm", "Nm", "Nm", "Nm", "Nm", "Nm"]);
        assert!((0..8).all(|motor| robot.limit(motor) > 0.0 && robot.reading(motor).is_none()));
        assert!(robot.claims().count() > 16);
    }

    #[test]
    fn gains_change_and_a_negative_one_is_refused() {
        for list in ["m3508:1", "damiao4310:1"] {
            let mut robot = Robot::new(&motors::parse(list).unwrap(), false).unwrap();
            robot.set_gains(0, (0.5, 0.25, 0.0)).unwrap();
            assert_eq!(robot.gains(0), (0.5, 0.25, 0.0));
            assert!(robot.set_gains(0, (-1.0, 0.0, 0.0)).unwrap_err().contains("kp"), "{list}");
            assert_eq!(robot.gains(0), (0.5, 0.25, 0.0));
        }
    }

    #[test]
    fn two_motors_with_one_id_are_named() {
        let error = Robot::new(&motors::parse("lk:1").unwrap_or_default(), false).map(|_| ());
        assert!(error.is_ok(), "no motors, no clash");
        let twice = motors::parse("damiao4310:1,damiao4340:1").unwrap();
        let error = Robot::new(&twice, false).unwrap_err();
        assert!(error.contains("DM-J4310 #1") && error.contains("DM-J4340 #1"), "{error}");
    }
}
