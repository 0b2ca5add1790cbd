//! Two seconds of a robot on the simulator: four wheels with speed loops and a yaw axis with a cascade, through lost
//! frames, a cable that is out and a new start. The same file runs on the host, in the tests of the crate, and
//! has to give the same bits.

use drivetrain::control::PidConfig;
use drivetrain::dji::{AnyHandle, Bus, Config, Gm6020Voltage, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{Fault, Line, MotorConfig, Simulation};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};

/// FNV-1a.
struct Hash(u64);

impl Hash {
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }

    fn add_frame(&mut self, frame: &CanFrame) {
        self.add(&frame.header().to_le_bytes());
        self.add(frame.bytes());
    }

    fn add_state(&mut self, bus: &Bus, motor: AnyHandle) {
        if let Some(state) = bus.state(motor) {
            self.add(&state.rotor_counts.to_le_bytes());
            self.add(&state.position.turns().to_le_bytes());
            for value in [
                state.position.angle().as_radians(),
                state.velocity.as_rad_per_s(),
                state.current.as_amperes(),
            ] {
                self.add(&value.to_bits().to_le_bytes());
            }
        }
    }
}

/// Runs it all; returns the hash of every frame on the wire and of every state after each tick, and how many
/// frames there were.
pub(crate) fn run() -> (u64, u32) {
    const SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0);
    const YAW_SPEED: PidConfig = PidConfig::new(1.0, 8.0, 0.0);
    const YAW: PidConfig = PidConfig::new(12.0, 0.0, 0.0);
    let at = |ms: u64| Instant::from_micros(ms * 1_000);

    let world = Simulation::new(2_026);
    let mut bus = Bus::new();
    for id in 1..=4 {
        world.attach(MotorConfig::m3508(id)).unwrap();
    }
    world.attach(MotorConfig::gm6020_voltage(5)).unwrap();
    let lost = Fault::LostFrames { line: Line::Can1, id: None, probability: 0.05 };
    world.fault(lost, at(300)..at(600)).unwrap();
    world.fault(Fault::Unplugged(Line::Can1), at(1_000)..at(1_130)).unwrap();

    let wheels = bus.attach_all([1, 2, 3, 4].map(|id| Config::<M3508>::new(id).speed_loop(SPEED)));
    let wheels = wheels.unwrap();
    let yaw = bus.attach(Config::<Gm6020Voltage>::new(5).position_loop(YAW, YAW_SPEED)).unwrap();

    let mut hash = Hash(0xCBF2_9CE4_8422_2325);
    let mut frames = 0;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    while world.now() < at(2_000) {
        world.advance_with(Duration::from_micros(100), |record| {
            hash.add_frame(&record.frame);
            frames += 1;
        });
        runner.poll(16);
        let Some(tick) = runner.due() else { continue };
        let ms = tick.now().as_micros() / 1_000;
        let is_armed = wheels.iter().all(|wheel| runner.device().is_motor_armed(*wheel));
        // An operator presses the key each 110 ms.
        if !is_armed && ms % 110 == 0 {
            _ = runner.arm(tick);
        }
        let ms = ms as f32;
        for (index, wheel) in wheels.iter().enumerate() {
            let speed = AngularVelocity::from_rad_per_s((index as f32 - 1.5) * ms * 0.01);
            _ = runner.device_mut().set_velocity(*wheel, speed);
        }
        _ = runner.device_mut().set_angle(yaw, Angle::from_degrees(ms * 0.5));
        runner.tick(tick);
        for motor in wheels.map(|wheel| wheel.erase()).into_iter().chain([yaw.erase()]) {
            hash.add_state(runner.device(), motor);
        }
    }
    (hash.0, frames)
}
