//! Any frame, any time, any call, any trouble of the drive: an actuator of each family keeps its drive at rest unless it is armed
//! and has a target. The judge is the simulated drive, which hears each frame.
#![no_main]

use drivetrain::control::PidConfig;
use drivetrain::encoder::GearRatio;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, CanDevice, Devices, DriveProtocol, Impedance, ImpedanceControl, Ingest,
    VelocityDrive,
};
use drivetrain::sim::{DamiaoDrive, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};
use drivetrain_fuzz::{Clock, Drive, Input};
use embedded_can::{ExtendedId, Frame, StandardId};
use libfuzzer_sys::fuzz_target;
use std::fmt::Debug;

/// Updates at 1 kHz after which feedback, or a target, is too old whatever their stamps were: twice their limits.
const LATE_MS: u32 = 21;
const OLD_MS: u32 = 201;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    match input.byte() % 25 {
        kind @ (0..=3 | 24) => damiao_of(kind, &mut input),
        kind @ 4..=7 => lk_of(kind, &mut input),
        kind @ 8..=11 => vesc_of(kind, &mut input),
        kind @ 12..=15 => odrive_of(kind, &mut input),
        kind @ 16..=19 => robstride_of(kind, &mut input),
        kind => rmd_of(kind, &mut input),
    }
});

/// 3 Nm at most.
fn torque() -> ImpedanceControl {
    ImpedanceControl::new(3.0).unwrap()
}

fn gains() -> ImpedanceControl {
    torque().with_gains(20.0, 0.6).unwrap()
}

const fn speed() -> AngularVelocity {
    AngularVelocity::from_rad_per_s(8.0)
}

const SPEED_LOOP: PidConfig = PidConfig::new(0.5, 2.0, 0.0);
const POSITION_LOOP: PidConfig = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(8.0);

/// Torques that a drive may have, in Nm.
#[derive(Debug, Clone, Copy)]
struct Limits {
    /// At rest: half a count of its command.
    rest_nm: f32,
    /// When driven; infinite where the torque is the business of the drive alone, or is reckoned from what feedback says.
    most_nm: f32,
}

impl Limits {
    const REST: Self = Self { rest_nm: 0.0, most_nm: f32::INFINITY };

    fn most(self, most_nm: f32) -> Self {
        Self { most_nm: most_nm * 1.001, ..self }
    }
}

fn damiao_of(kind: u8, input: &mut Input) {
    fn bench(mode: impl Into<damiao::Mode>, number: f32, input: &mut Input) {
        let motor = damiao::Motor::new(damiao::Model::J4310, 1, mode).unwrap();
        let drive = DamiaoDrive::of(damiao::Model::J4310, 1).with_register(10, number);
        let limits = Limits { rest_nm: 10.0 / 4095.0, ..Limits::REST };
        run(motor, drive, limits, |motor, kind, value| {
            use damiao::Register;
            const ALL: [Register; 5] = [
                Register::ControlMode,
                Register::TorqueRange,
                Register::Timeout,
                Register::MasterId,
                Register::OverCurrent,
            ];
            let register = ALL[usize::from(kind >> 2) % ALL.len()];
            match kind % 4 {
                0 => motor.read(register),
                1 | 2 => _ = motor.write(register, value),
                _ => motor.store(),
            }
        })(input);
    }
    match kind {
        0 => bench(torque(), 1.0, input),
        1 => bench(gains(), 1.0, input),
        2 => bench(damiao::Mode::position_velocity(speed()), 2.0, input),
        3 => bench(damiao::Mode::velocity(speed()), 3.0, input),
        _ => bench(damiao::Mode::force_position(speed(), 2.0), 4.0, input),
    }
}

fn lk_of(kind: u8, input: &mut Input) {
    fn bench(mode: impl Into<lk::Mode>, limits: Limits, input: &mut Input) {
        let model = lk::Model::MG4005E_I10;
        let motor = lk::Motor::new(model, 1, mode).unwrap();
        run(motor, LkDrive::of(model, 1), limits, |_, _, _| {})(input);
    }
    let rest = Limits::REST;
    match kind % 4 {
        0 => bench(torque(), rest.most(3.0), input),
        1 => bench(gains(), rest.most(3.0), input),
        2 => bench(lk::Mode::velocity_with_torque_limit(speed(), 2.0), rest.most(2.0), input),
        _ => bench(lk::Mode::position_velocity(speed()), rest, input),
    }
}

fn rmd_of(kind: u8, input: &mut Input) {
    fn bench(mode: impl Into<rmd::Mode>, limits: Limits, input: &mut Input) {
        let model = rmd::Model::X8_120;
        let drive = RmdDrive::new(1, model.torque_constant());
        let motor = rmd::Motor::new(model, 1, mode).unwrap();
        let drive = if input.coin() { drive.with_brake() } else { drive };
        run(motor, drive, limits, |motor, _, _| motor.reset_drive())(input);
    }
    let rest = Limits::REST;
    match kind % 4 {
        0 => bench(torque(), rest.most(3.0), input),
        1 => bench(gains(), rest.most(3.0), input),
        2 => bench(rmd::Mode::velocity(speed()), rest, input),
        _ => bench(rmd::Mode::position_velocity(speed()), rest, input),
    }
}

fn vesc_of(kind: u8, input: &mut Input) {
    const MODEL: vesc::Model = vesc::Model {
        name: "6374",
        pole_pairs: 7,
        gear: GearRatio::DIRECT,
        torque_constant_nm_per_a: 0.05,
        current_limit_a: 20.0,
        max_velocity: AngularVelocity::from_rad_per_s(300.0),
    };
    fn bench(mode: vesc::Mode, limits: Limits, input: &mut Input) {
        let motor_of = vesc::Motor::new(MODEL, 23, mode).unwrap();
        let drive = VescDrive::of(MODEL, 23).with_current_max(40.0).with_status_hz(1_000.0);
        run(motor_of, drive, limits, |_, _, _| {})(input);
    }
    let rest = Limits::REST;
    match kind % 4 {
        0 => {
            let loops = vesc::Mode::current_with_loops(POSITION_LOOP, SPEED_LOOP).unwrap();
            bench(loops, rest.most(1.0), input);
        }
        1 => bench(vesc::Mode::duty(0.5, SPEED_LOOP).unwrap(), rest, input),
        2 => {
            let brake = vesc::Rest::Brake(5.0);
            bench(vesc::Mode::velocity_with_standstill(brake), rest, input);
        }
        _ => bench(vesc::Mode::position(), rest, input),
    }
}

fn odrive_of(kind: u8, input: &mut Input) {
    use odrive::Firmware::{self, V0_5, V0_6};
    const GEAR: f32 = 5.0;
    const ENDPOINTS: odrive::Endpoints = odrive::Endpoints {
        control_mode: 1,
        input_mode: 2,
        watchdog_timeout: 3,
        enable_watchdog: 4,
    };
    fn bench(firmware: Firmware, mode: impl Into<odrive::Mode>, limits: Limits, input: &mut Input) {
        let model = odrive::Model::D6374;
        let motor = odrive::Motor::new(model, firmware, 3, speed(), mode).unwrap();
        let mut motor = motor.with_gear(GEAR).unwrap();
        if firmware == V0_6 && input.coin() {
            motor = motor.with_endpoints(ENDPOINTS, Duration::from_millis(100)).unwrap();
        }
        let drive = OdriveDrive::new(3, firmware == V0_6, model.torque_constant(), GEAR);
        run(motor, drive.with_periods(0.1, 0.002), limits, |motor, kind, _| match kind % 4 {
            0 => motor.stop(),
            _ => motor.clear_errors(),
        })(input);
    }
    let rest = Limits::REST;
    match kind % 4 {
        0 => bench(V0_5, torque(), rest.most(3.0), input),
        1 => bench(V0_6, gains(), rest.most(3.0), input),
        2 => bench(V0_5, odrive::Mode::velocity(2.0), rest, input),
        _ => bench(V0_6, odrive::Mode::position_with_trajectory(2.0, 20.0), rest, input),
    }
}

fn robstride_of(kind: u8, input: &mut Input) {
    fn bench(
        model: robstride::Model,
        mode: impl Into<robstride::Mode>,
        number: f32,
        input: &mut Input,
    ) {
        let limits = Limits { rest_nm: model.tmax_nm() / 65_535.0, ..Limits::REST };
        let drive = RobStrideDrive::of(model, 1).with_parameter(0x7005, number);
        let motor = robstride::Motor::new(model, 1, mode).unwrap();
        run(motor, drive, limits.most(3.0), |motor, kind, value| {
            use robstride::Register;
            const ALL: [Register; 4] = [
                Register::RunMode,
                Register::TorqueLimit,
                Register::CurrentLimit,
                Register::Timeout,
            ];
            let register = ALL[usize::from(kind >> 2) % ALL.len()];
            match kind % 4 {
                0 => motor.read(register),
                1 | 2 => _ = motor.write(register, value),
                _ if kind & 4 == 0 => _ = motor.set_zero(),
                _ => _ = motor.store(),
            }
        })(input);
    }
    use robstride::Model;
    match kind % 4 {
        0 if input.coin() => bench(Model::CYBERGEAR, gains(), 0.0, input),
        0 => bench(Model::RS02, gains(), 0.0, input),
        1 => bench(Model::RS02, robstride::Mode::current(3.0, 1.0), 3.0, input),
        2 => bench(Model::RS02, robstride::Mode::velocity(speed(), 3.0), 2.0, input),
        _ => bench(Model::RS02, robstride::Mode::position(speed(), 3.0), 5.0, input),
    }
}

/// A motor, its drive, and records apart from both.
struct Bench<M, D> {
    own: Actuator<M>,
    drive: D,
    limits: Limits,
    /// What the drive sent.
    answers: Vec<CanFrame>,
    clock: Clock,
    now: Instant,
    /// An arming was granted, and nothing disarmed the motor since.
    is_granted: bool,
    /// Updates since feedback, and since a target that was taken, as long as time goes well.
    unheard_ms: u32,
    untold_ms: u32,
    /// Updates that the drive may still need until it is at rest, as frames of rest did not reach it.
    owed: u32,
}

fn run<M: DriveProtocol + Copy + Debug, D: Drive>(
    motor: M,
    drive: D,
    limits: Limits,
    ask: impl Fn(&mut M, u8, f32),
) -> impl FnOnce(&mut Input) {
    move |input| {
        let mut clock = Clock::new(1_000);
        let now = Instant::from_micros(clock.read());
        let mut bench = Bench {
            own: Actuator::new(motor),
            drive,
            limits,
            answers: Vec::new(),
            clock,
            now,
            is_granted: false,
            unheard_ms: 0,
            untold_ms: 0,
            owed: 0,
        };
        bench.play(input, ask);
    }
}

impl<M: DriveProtocol + Copy + Debug, D: Drive> Bench<M, D> {
    fn play(&mut self, input: &mut Input, ask: impl Fn(&mut M, u8, f32)) {
        let mut left_ms = 1_000;
        while !input.is_empty() {
            match input.byte() {
                0..=49 => {
                    self.pass(input);
                    if let Some(frame) = self.frame(input) {
                        self.ingest(&frame);
                    }
                }
                50..=89 => self.set(input.byte(), input.float()),
                90..=99 => ask(self.own.motor_mut(), input.byte(), input.float()),
                100..=119 => self.arm(),
                kind @ 120..=131 => {
                    match kind % 3 {
                        0 => Devices::disarm(&mut self.own),
                        1 => Devices::trip(&mut self.own),
                        _ => Devices::emergency_stop(&mut self.own),
                    }
                    self.is_granted = false;
                    // What is sent before the next update is rest already.
                    self.send(input.byte());
                    self.judge();
                }
                132..=137 => Devices::clear_emergency_stop(&mut self.own),
                138..=141 => while Devices::next_edge(&mut self.own).is_some() {},
                142..=147 => self.drive.suffer(input.byte()),
                148..=151 => {
                    let shaft = self.drive.shaft_mut();
                    match input.byte() {
                        load @ 0..=191 => shaft.set_load(f32::from(load) * 0.01 - 1.0),
                        angle => shaft.set_angle(f32::from(angle) - 220.0),
                    }
                }
                152..=199 => {
                    let (how, kind, value, length) = (
                        input.byte(),
                        input.byte(),
                        input.float(),
                        u32::from(input.byte()).min(left_ms),
                    );
                    let refused = if how & 4 == 0 { 0 } else { input.byte() };
                    left_ms -= length;
                    for _ in 0..length {
                        self.now = Instant::from_micros(self.clock.go_well());
                        (self.unheard_ms, self.untold_ms) =
                            (self.unheard_ms + 1, self.untold_ms + 1);
                        if how & 1 == 0 {
                            self.hear();
                        }
                        if how & 2 == 0 {
                            self.set(kind, value);
                        }
                        if how & 8 == 0 {
                            self.update(0.001, refused);
                        } else {
                            self.update_unheard();
                        }
                        if how & 0xF0 == 0 {
                            self.arm();
                        }
                    }
                }
                200..=219 => self.hear(),
                _ => {
                    self.pass(input);
                    let refused = input.byte();
                    self.update(input.step_s(), refused);
                }
            }
        }
    }

    fn pass(&mut self, input: &mut Input) {
        self.now = Instant::from_micros(self.clock.pass(input));
        (self.unheard_ms, self.untold_ms) = (0, 0);
    }

    fn arm(&mut self) {
        self.is_granted |= Devices::arm(&mut self.own, self.now).is_ok();
    }

    /// A frame with an id of the motor as a rule, of any content and length.
    fn frame(&self, input: &mut Input) -> Option<CanFrame> {
        let (form, length, place) = (input.byte(), usize::from(input.byte() % 9), input.byte());
        let data: [u8; 8] = input.bytes();
        let data = data.get(..if form < 192 { 8 } else { length })?;
        let claims: Vec<_> = CanDevice::claims(&self.own).collect();
        let claim = claims.get(usize::from(place) % claims.len())?;
        match form % 8 {
            0 => CanFrame::new(StandardId::new(u16::from_be_bytes([place & 7, form]))?, data),
            1 => CanFrame::new(
                ExtendedId::new(u32::from_be_bytes([place & 0x1F, form, 0, place]))?,
                data,
            ),
            2 => CanFrame::new_remote(claim.id(), data.len()),
            // As the drive would have sent it, with other data.
            3 => CanFrame::new(self.answers.last()?.id(), data),
            _ => CanFrame::new(claim.id(), data),
        }
    }

    fn ingest(&mut self, frame: &CanFrame) {
        let before = *self.own.motor();
        if Devices::ingest(&mut self.own, frame, self.now) == Ingest::Taken {
            self.unheard_ms = 0;
        } else {
            let after = self.own.motor();
            assert_eq!(format!("{before:?}"), format!("{after:?}"), "refused: {frame:?}");
        }
    }

    /// The frames of the drive arrive.
    fn hear(&mut self) {
        for frame in std::mem::take(&mut self.answers) {
            self.ingest(&frame);
        }
    }

    fn set(&mut self, kind: u8, value: f32) {
        let angle = Angle::from_radians(value);
        let is_taken = match kind % 4 {
            0 => self.own.set_torque(value).is_ok(),
            1 => self.own.set_velocity((), AngularVelocity::from_rad_per_s(value)).is_ok(),
            2 => self.own.set_angle((), angle).is_ok(),
            _ => {
                let (stiffness, damping) = (f32::from(kind), f32::from(kind) * 0.02);
                let target = Impedance { angle, stiffness, damping, ..Impedance::FREE };
                self.own.set_impedance(target).is_ok()
            }
        };
        assert!(!is_taken || (value.is_finite() && self.own.is_armed()), "{value} was taken");
        if is_taken {
            self.untold_ms = 0;
        }
    }

    /// Tells whether the motor may be driven, by its reports and by the events so far.
    fn may_drive(&self) -> bool {
        let is_young = self.unheard_ms < LATE_MS && self.untold_ms < OLD_MS;
        self.own.is_armed() && self.own.guard().has_target() && self.is_granted && is_young
    }

    /// Runs an update. The driver gives the frames of which `refused` has a bit back.
    fn update(&mut self, dt_s: f32, refused: u8) {
        Devices::update(&mut self.own, Tick::new(self.now, dt_s));
        self.owed = self.owed.saturating_sub(1);
        self.send(refused);
        self.judge();
    }

    /// Runs an update whose frames are lost, and nobody says so.
    fn update_unheard(&mut self) {
        Devices::update(&mut self.own, Tick::new(self.now, 0.001));
        for turn in 0..4 {
            _ = Devices::next_frame(&mut self.own, turn);
        }
        self.owed = 4;
        self.judge();
    }

    fn send(&mut self, refused: u8) {
        if self.drive.sends_back() {
            self.owed = self.owed.max(1);
        }
        for turn in 0..4 {
            let Some(frame) = Devices::next_frame(&mut self.own, turn) else { break };
            assert!(turn < 2, "more than two frames in an update: {frame:?}");
            let is_claimed = CanDevice::claims(&self.own)
                .any(|claim| !claim.is_feedback() && claim.covers(frame.id()));
            assert!(is_claimed || frame.is_remote_frame(), "{frame:?}");
            if refused & 0x10 << turn != 0 {
                assert!(Devices::put_back(&mut self.own, &frame), "{frame:?}");
                assert_eq!(Devices::next_frame(&mut self.own, turn), Some(frame));
            }
            if refused & 1 << turn != 0 {
                assert!(Devices::requeue(&mut self.own, &frame), "{frame:?}");
                self.owed = 1;
                continue;
            }
            self.answers.extend(self.drive.hear(&frame));
        }
    }

    fn judge(&mut self) {
        self.drive.step(1e-5);
        let torque_nm = self.drive.shaft_mut().torque_nm();
        let is_at_rest = torque_nm.abs() <= self.limits.rest_nm;
        assert!(is_at_rest || self.may_drive() || self.owed > 0, "{torque_nm} Nm at rest");
        assert!(torque_nm.abs() <= self.limits.most_nm, "{torque_nm} Nm");
        self.drive.step(0.00099);
        self.answers.extend(core::iter::from_fn(|| self.drive.next_frame()));
    }
}
