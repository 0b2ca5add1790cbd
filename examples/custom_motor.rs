//! A motor of your own beside DJI motors, on one bus and one runner: the `MyMotor` of many a team's base class.
//!
//! Its motor has a gear of 27, an id of its own and frames of its own; everything else, from arming to the command
//! deadline and the look-out for stalls, it has from the crate. `cargo run --example custom_motor`

mod console;

use drivetrain::control::{Pid, PidConfig};
use drivetrain::dji::{Bus, Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Claim, DriveProtocol, Ingest, MotorName, Order};
use drivetrain::motor::{Target, Vitals};
use drivetrain::units::AngularVelocity;
use embedded_can::{Frame, Id, StandardId};

const GEAR: f32 = 27.0;
const NO_LOAD_RAD_PER_S: f32 = 50.0;
const LIMIT_A: f32 = 8.0;
/// A per rad/s and A per rad of the output shaft.
const SPEED: PidConfig = PidConfig::new(0.4, 4.0, 0.0).with_output_limit(LIMIT_A);

/// Command 0x120 + id: amperes as `f32`. Feedback 0x140 + id: rotor rpm as `i16`, temperature. Little-endian.
#[derive(Debug)]
pub(crate) struct MyMotor {
    id: u8,
    rotor_rpm: i16,
    temperature_c: u8,
    effort: f32,
    speed: Pid,
}

impl MyMotor {
    pub(crate) fn new(id: u8) -> Result<Self, drivetrain::error::ConfigError> {
        Ok(Self { id, rotor_rpm: 0, temperature_c: 0, effort: 0.0, speed: Pid::new(SPEED)? })
    }

    fn command(&self, amperes: f32) -> CanFrame {
        CanFrame::of(standard(0x120 + u16::from(self.id)), amperes.to_le_bytes())
    }
}

impl DriveProtocol for MyMotor {
    fn name(&self) -> MotorName {
        MotorName::new("MyMotor", self.id)
    }

    fn claims(&self) -> impl IntoIterator<Item = Claim> {
        let id = |base| standard(base + u16::from(self.id));
        [Claim::command(id(0x120), self.name()), Claim::feedback(id(0x140), self.name())]
    }

    fn decode(&mut self, frame: &CanFrame) -> Ingest {
        let [low, high, temperature_c] = *frame.data() else {
            return Ingest::WrongLength(frame.length());
        };
        (self.rotor_rpm, self.temperature_c) = (i16::from_le_bytes([low, high]), temperature_c);
        Ingest::Taken
    }

    fn velocity(&self) -> AngularVelocity {
        AngularVelocity::from_rpm(f32::from(self.rotor_rpm) / GEAR)
    }

    fn rest(&mut self) -> CanFrame {
        self.command(0.0)
    }

    fn control(&mut self, Order { target, share, step }: Order) -> CanFrame {
        let Target::Velocity(target) = target else { return self.rest() };
        let config = SPEED.with_output_limit(share * LIMIT_A); // the integral keeps within it
        let Ok(()) = self.speed.set_config(config) else { return self.rest() };
        let measured = self.velocity().as_rad_per_s();
        let amperes = self.speed.step(target.as_rad_per_s(), measured, &step);
        self.effort = amperes / LIMIT_A;
        self.command(amperes)
    }

    fn reset(&mut self) {
        self.effort = 0.0;
        self.speed.reset();
    }

    fn vitals(&self) -> Vitals {
        Vitals {
            temperature_c: Some(self.temperature_c.into()),
            effort: self.effort,
            speed: self.velocity().as_rad_per_s() / NO_LOAD_RAD_PER_S,
            ..Vitals::default()
        }
    }
}

fn standard(raw: u16) -> Id {
    StandardId::new(raw).unwrap_or(StandardId::MAX).into()
}

/// That is all of it. From here on: the simulator, with the part of the motor's own ESC played by hand.
fn main() -> Result<(), Box<dyn std::error::Error>> {
    simulation::clash()?;
    simulation::drive()
}

mod simulation {
    use super::*;
    use drivetrain::motor::{ArmError, Condition, Devices, VelocityDrive};
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::sim::{Line, MotorConfig, Simulation};
    use drivetrain::time::{Duration, Instant};
    use drivetrain::wire::mit;
    use std::error::Error;

    /// The ESC and the shaft of `MyMotor`: 0.2 Nm for each ampere, 0.004 kg m² and some friction at the output.
    struct Esc {
        id: u8,
        amperes: f32,
        rad_per_s: f32,
    }

    impl Esc {
        fn hear(&mut self, frame: &CanFrame) {
            if frame.id() == standard(0x120 + u16::from(self.id)) {
                let [a, b, c, d, ..] = *frame.bytes();
                self.amperes = f32::from_le_bytes([a, b, c, d]);
            }
        }

        fn step(&mut self, dt_s: f32) {
            let torque_nm = 0.2 * self.amperes - 0.01 * self.rad_per_s;
            self.rad_per_s += torque_nm / 4e-3 * dt_s;
        }

        fn feedback(&self) -> Option<CanFrame> {
            let rotor_rpm = AngularVelocity::from_rad_per_s(self.rad_per_s).as_rpm() * GEAR;
            #[expect(clippy::cast_possible_truncation, reason = "saturates")]
            let [low, high] = (rotor_rpm as i16).to_le_bytes();
            CanFrame::new(standard(0x140 + u16::from(self.id)), &[low, high, 31])
        }
    }

    pub(crate) fn drive() -> Result<(), Box<dyn Error>> {
        let world = Simulation::new(1);
        world.attach(MotorConfig::m3508(1))?;
        let mut esc = Esc { id: 3, amperes: 0.0, rad_per_s: 0.0 };

        let mut bus = Bus::new();
        let wheel =
            bus.attach(Config::<M3508>::new(1).speed_loop(PidConfig::new(1.9, 2.4, 0.0)))?;
        let robot = (bus, Actuator::new(MyMotor::new(3)?)); // a tuple of devices is a device
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), robot);

        let (rpm, mine_rpm) = (200.0, -150.0);
        let mut edges = Vec::new();
        for ms in 0..2_000 {
            world.advance_with(Duration::from_millis(1), |record| esc.hear(&record.frame));
            esc.step(0.001);
            if (600..1_400).contains(&ms) {
                esc.rad_per_s = 0.0; // blocked
            }
            if let Some(frame) = esc.feedback() {
                let _full = world.inject(Line::Can1, frame);
            }
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            // This robot arms by itself, which only a simulated one may.
            let _not_yet = runner.is_armed() || runner.arm(tick).is_ok();
            let (bus, mine) = runner.device_mut();
            _ = bus.set_velocity(wheel, AngularVelocity::from_rpm(rpm)); // refused until armed
            _ = mine.set_velocity((), AngularVelocity::from_rpm(mine_rpm));
            runner.tick(tick);
            while let Some(edge) = runner.device_mut().next_edge() {
                console::line(format_args!("{edge}"));
                edges.push((edge.condition, edge.began));
            }
            if ms % 200 == 199 {
                let (bus, mine) = runner.device();
                let dji = bus.velocity(wheel).map_or(f32::NAN, AngularVelocity::as_rpm);
                let own = mine.velocity(()).map_or(f32::NAN, AngularVelocity::as_rpm);
                console::line(format_args!(
                    "{:>5} ms   M3508 {dji:7.1} rpm   MyMotor {own:7.1} rpm",
                    ms + 1
                ));
            }
        }
        let (bus, mine) = runner.device();
        let dji = bus.velocity(wheel).ok_or("M3508 was lost")?.as_rpm();
        let own = mine.velocity(()).ok_or("MyMotor was lost")?.as_rpm();
        if (dji - rpm).abs() > 4.0 || (own - mine_rpm).abs() > 3.0 {
            return Err(format!("{dji} and {own} rpm are not {rpm} and {mine_rpm}").into());
        }
        console::line(format_args!("{}", mine.health()));
        if edges != [(Condition::Stalled, true), (Condition::Stalled, false)] {
            return Err(format!("one stall was expected, not {edges:?}").into());
        }
        if mine.health().temperature_c != Some(31) { Err("no 31 °C".into()) } else { Ok(()) }
    }

    /// A Damiao motor in its speed mode, command 0x200 + id: a classic trap beside DJI motors.
    struct DamiaoSpeed(MyMotor);

    impl DriveProtocol for DamiaoSpeed {
        fn name(&self) -> MotorName {
            MotorName::new("DM4310 (velocity)", self.0.id)
        }
        fn claims(&self) -> impl IntoIterator<Item = Claim> {
            let id = u16::from(self.0.id);
            let command = Claim::command(standard(0x200 + id), self.name());
            [command, Claim::feedback(standard(0x010 + id), self.name())]
        }
        fn decode(&mut self, frame: &CanFrame) -> Ingest {
            self.0.decode(frame)
        }
        fn velocity(&self) -> AngularVelocity {
            self.0.velocity()
        }
        fn rest(&mut self) -> CanFrame {
            CanFrame::of(standard(0x200 + u16::from(self.0.id)), mit::DISABLE)
        }
        fn control(&mut self, order: Order) -> CanFrame {
            let Target::Velocity(target) = order.target else { return self.rest() };
            let rad_per_s = target.as_rad_per_s() * order.share;
            CanFrame::of(standard(0x200 + u16::from(self.0.id)), rad_per_s.to_le_bytes())
        }
        fn enable(&mut self, _sent: u8) -> Option<CanFrame> {
            Some(CanFrame::of(standard(0x200 + u16::from(self.0.id)), mit::ENABLE))
        }
        fn reset(&mut self) {}
    }

    /// Both sides would send 0x201: refused when arming, before anything moves.
    pub(crate) fn clash() -> Result<(), Box<dyn Error>> {
        let mut bus = Bus::new();
        bus.attach(Config::<M3508>::new(1))?;
        let mut robot = (bus, Actuator::new(DamiaoSpeed(MyMotor::new(1)?)));
        match robot.arm(Instant::START) {
            Err(ArmError::Clash(one, other)) => {
                console::line(format_args!("refused: {one} clashes with {other}"));
                let clash = [&one, &other].map(Claim::is_feedback) == [true, false];
                if clash { Ok(()) } else { Err("the wrong clash".into()) }
            }
            outcome => Err(format!("expected a clash, got {outcome:?}").into()),
        }
    }
}
