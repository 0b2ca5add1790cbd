//! Motors of any family as one device, and the run: armed, turned, left at rest.

use crate::motors::{Model, Spec};
use crate::own::{Kind, each};
use drivetrain::control::PidConfig;
use drivetrain::dji::{self, AnyHandle, Bus};
use drivetrain::encoder::GearRatio;
use drivetrain::error::ConfigError;
use drivetrain::motor::{
    Actuator, Devices, DriveProtocol as _, ImpedanceControl, VelocityDrive, Visitor,
};
use drivetrain::runner::{Port, Runner};
use drivetrain::time::{Clock, Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};
use std::error::Error;

const SPEED: AngularVelocity = AngularVelocity::from_rpm(30.0);
/// A VESC follows no speed below 900 electrical rpm.
const VESC_ERPM: f32 = 2_000.0;
/// The share of its largest torque that a motor of the other families is given.
const GENTLE: f32 = 0.1;
/// The motor at a VESC or an ODrive, which only its owner knows.
const MOTOR_NM_PER_A: f32 = 0.035;
const MOTOR_A: f32 = 5.0;
const FASTEST: AngularVelocity = AngularVelocity::from_rpm(2_000.0);

/// How long the motors may take until they are heard and can be armed, and how long they turn.
const PATIENCE: Duration = Duration::from_millis(2_000);
const TIME: Duration = Duration::from_millis(5_000);
const ZEROS: u32 = 300;

/// The motors of a command line: those of DJI on their bus, all others beside it with their speeds.
pub(crate) struct Robot {
    bus: Bus,
    dji: Vec<AnyHandle>,
    own: Vec<(Kind, AngularVelocity)>,
}

impl Devices for Robot {
    fn visit(&mut self, visitor: &mut impl Visitor) {
        if !self.dji.is_empty() {
            self.bus.visit(visitor);
        }
        for (kind, _) in &mut self.own {
            each!(kind, own => own.visit(visitor));
        }
    }
}

impl Robot {
    /// # Errors
    /// Names the value that a motor refuses, and two motors with one id.
    pub(crate) fn new(specs: &[Spec]) -> Result<Self, Box<dyn Error>> {
        let mut robot = Self { bus: Bus::new(), dji: Vec::new(), own: Vec::new() };
        for spec in specs {
            robot.add(spec)?;
        }
        match robot.clash() {
            Some((one, other)) => Err(format!("{one}, which is {other}").into()),
            None => Ok(robot),
        }
    }

    fn add(&mut self, &Spec { model, id, host }: &Spec) -> Result<(), Box<dyn Error>> {
        let (kind, speed) = match model {
            // A speed loop of ours within so many A, or V for a GM6020 in voltage mode.
            Model::M3508 => return self.attach::<dji::M3508>(id, 1.9, 2.4, 3.0),
            Model::M2006 => return self.attach::<dji::M2006>(id, 0.15, 1.5, 2.0),
            Model::Gm6020 => return self.attach::<dji::Gm6020Voltage>(id, 1.0, 5.0, 6.0),
            Model::Gm6020Current => return self.attach::<dji::Gm6020Current>(id, 0.1, 1.0, 0.5),
            // MIT mode and operation mode, the modes at delivery: a speed loop of ours on the torque.
            Model::Damiao(model) => {
                let motor = damiao::Motor::new(model, id, torque(model.tmax_nm())?)?;
                let master = host.unwrap_or(0x10 + u16::from(id));
                (Kind::Damiao(Actuator::new(motor.with_master_id(master)?)), SPEED)
            }
            Model::RobStride(model) => {
                let motor = robstride::Motor::new(model, id, torque(model.tmax_nm())?)?;
                let host = u8::try_from(host.unwrap_or(0xFD)).map_err(|_| "a host id is a byte")?;
                (Kind::RobStride(Actuator::new(motor.with_host_id(host)?)), SPEED)
            }
            // The loop of the drive, here and below. For RMD, VESC and LK V2.35 the drive alone limits the torque.
            Model::Lk(model) => {
                let nm = GENTLE * model.max_torque_nm();
                let mode = lk::Mode::velocity_with_torque_limit(SPEED, nm);
                (Kind::Lk(Actuator::new(lk::Motor::new(model, id, mode)?)), SPEED)
            }
            Model::Rmd(model) => {
                let mode = rmd::Mode::velocity(SPEED);
                (Kind::Rmd(Actuator::new(rmd::Motor::new(model, id, mode)?)), SPEED)
            }
            Model::Odrive(firmware) => {
                let model = odrive::Model::new("ODrive", 8.27 / MOTOR_NM_PER_A)?;
                let mode = odrive::Mode::velocity(MOTOR_A * MOTOR_NM_PER_A);
                let motor = odrive::Motor::new(model, firmware, id, FASTEST, mode)?;
                (Kind::Odrive(Actuator::new(motor)), SPEED)
            }
            Model::Vesc(pole_pairs) => {
                let model = vesc::Model {
                    name: "VESC",
                    pole_pairs,
                    gear: GearRatio::DIRECT,
                    torque_constant_nm_per_a: MOTOR_NM_PER_A,
                    current_limit_a: MOTOR_A,
                    max_velocity: FASTEST,
                };
                let motor = vesc::Motor::new(model, id, vesc::Mode::velocity())?;
                let speed = AngularVelocity::from_rpm(VESC_ERPM / f32::from(pole_pairs));
                (Kind::Vesc(Actuator::new(motor)), speed)
            }
        };
        self.own.push((kind, speed));
        Ok(())
    }

    fn attach<M: dji::Model>(
        &mut self,
        id: u8,
        kp: f32,
        ki: f32,
        limit: f32,
    ) -> Result<(), Box<dyn Error>> {
        let speed = PidConfig::new(kp, ki, 0.0).with_output_limit(limit);
        let motor = self.bus.attach(dji::Config::<M>::new(id).speed_loop(speed))?;
        self.dji.push(motor.into());
        Ok(())
    }

    /// The shortest period, 1 to 4 ms, in which commands and answers take half of 1 Mbit/s: motors of DJI send at 1 kHz anyway, and
    /// feedback is late after 10 ms.
    pub(crate) fn period(&self) -> Duration {
        let load = |kind: &Kind, ms: u32| each!(kind, own => own.load(1_000_000, 1_000 / ms));
        let sum = |ms| self.own.iter().map(|(kind, _)| load(kind, ms).worst_case()).sum::<f32>();
        Duration::from_millis((1..4).find(|ms| sum(*ms) < 0.5).unwrap_or(4).into())
    }

    /// Sets the target of each motor. A motor that is not armed refuses it.
    fn turn(&mut self) {
        _ = self.bus.drive(self.dji.iter().map(|motor| (*motor, SPEED)));
        for (kind, speed) in &mut self.own {
            _ = each!(kind, own => own.set_velocity((), *speed));
        }
    }

    /// A line for each motor, with its name and its speed.
    fn report(&self) -> String {
        let dji = self.bus.motors().map(|(motor, name)| (name, self.bus.velocity(motor)));
        let own = |kind: &Kind| each!(kind, own => (own.motor().name(), own.velocity(())));
        let line = |(name, velocity): (_, Option<AngularVelocity>)| match velocity {
            Some(velocity) => format!("{name}: {:.1} rpm\n", velocity.as_rpm()),
            None => format!("{name} is not heard\n"),
        };
        dji.chain(self.own.iter().map(|(kind, _)| own(kind))).map(line).collect()
    }

    /// A line for each motor, with its conditions and its error code.
    fn health(&self) -> String {
        let dji = self.dji.iter().filter_map(|motor| self.bus.health(*motor));
        let own = self.own.iter().map(|(kind, _)| each!(kind, own => own.health()));
        dji.chain(own).map(|health| format!("\n{health}")).collect()
    }
}

/// Speeds by a loop of ours from rad/s to Nm. The example `tune` finds better gains.
fn torque(most_nm: f32) -> Result<ImpedanceControl, ConfigError> {
    let nm = GENTLE * most_nm;
    let speed = PidConfig::new(0.1 * nm, 0.3 * nm, 0.0);
    ImpedanceControl::new(nm)?.with_loops(PidConfig::new(0.0, 0.0, 0.0), speed)
}

/// Arms the motors, turns them for 5 s and leaves them at rest. `pause` lets a little time pass, and returns whether to end.
/// Returns the last speeds.
///
/// # Errors
/// Says why the motors were not armed, or what relaxed them.
pub(crate) fn drive<P: Port, K: Clock>(
    runner: &mut Runner<P, K, Robot>,
    mut pause: impl FnMut() -> bool,
) -> Result<String, String> {
    let mut armed = None;
    let outcome = loop {
        let (tick, ends) = wait(runner, &mut pause);
        match armed {
            Some(_) if !runner.is_armed() => break Err(relaxed(runner)),
            Some(armed) if tick.now().since(armed) > TIME => break Ok(runner.device().report()),
            _ if ends => break Ok(runner.device().report()),
            Some(_) => runner.device_mut().turn(),
            // The drives are to be heard first, and to say how they are set.
            None => match runner.arm(tick) {
                Ok(()) => armed = Some(tick.now()),
                Err(error) if tick.now().since(Instant::START) > PATIENCE => {
                    break Err(format!("not armed: {error}{}", runner.device().health()));
                }
                Err(_) => {}
            },
        }
        runner.tick(tick);
    };
    for _ in 0..ZEROS {
        let (tick, _) = wait(runner, &mut pause);
        runner.device_mut().disarm();
        runner.tick(tick);
    }
    outcome
}

/// Waits for the next step, and returns whether the run is to end.
fn wait<P: Port, K: Clock>(
    runner: &mut Runner<P, K, Robot>,
    mut pause: impl FnMut() -> bool,
) -> (Tick, bool) {
    loop {
        let ends = pause();
        runner.poll(64);
        if let Some(tick) = runner.due() {
            return (tick, ends);
        }
    }
}

/// What began at the bus and at the motors, and how the motors are.
fn relaxed<P: Port, K: Clock>(runner: &mut Runner<P, K, Robot>) -> String {
    let mut text = "no longer armed".to_owned();
    while let Some(edge) = runner.next_edge() {
        text += &format!("\n{edge}");
    }
    while let Some(edge) = runner.device_mut().next_edge() {
        text += &format!("\n{edge}");
    }
    text + &runner.device().health()
}
