//! What the boards share: the robots without their boards. Here a DBUS remote control and a HiPNUC IMU drive a mecanum chassis of
//! four M3508; [`sentry`] and [`snake`] are whole machines.
//!
//! Arm: both sticks at rest, the left switch in its middle, turn the right switch from its middle or its bottom to the top. Stop: turn it
//! away. When the remote control is lost, the robot brakes for a second, and is disarmed.
//! The right stick moves the chassis, the left one turns it. With an IMU that is heard, forward is where its yaw is zero;
//! without one, forward is where the chassis looks. Which of them holds is chosen while both sticks are at rest; when the IMU
//! falls silent while one is held, the robot stops until both are let go. When a wheel is lost for 100 ms, the others brake until the
//! robot is armed again.
//!
//! A PC may set the gains of the wheels while the robot runs, and a turn that adds to the stick's for 500 ms: lines such as
//! `wheel_kp=2.5` and `turn=0.5` on a serial port, see [`Pilot::hear_debug_port`]. No line arms the robot. Curves for VOFA+ go back:
//! [`Pilot::curves`]; a request for the table of parameters (`?`) is not answered, because the port carries frames.
#![cfg_attr(not(test), no_std)]

pub mod gesture;
pub mod loader;
pub mod sentry;
pub mod snake;

use drivetrain::chassis::{Chassis, ChassisLimits, Mecanum, MecanumWheels};
use drivetrain::control::{PidConfig, WheelTuning};
use drivetrain::dji::{Bus, Config, Handle, M3508, Model};
use drivetrain::geometry::{Heading, Twist, Vec2};
use drivetrain::motor::{Devices, SwitchOrder};
use drivetrain::time::{Duration, Edge, Instant, Tick};
use drivetrain::units::{AngularVelocity, Current};
use drivetrain::wire::dbus::{Dbus, Remote};
use drivetrain::wire::hipnuc::{Imu, MAX_FRAME};
use drivetrain::wire::parameters::{Parameter, Parameters};
use drivetrain::wire::vofa::justfloat;
use drivetrain::wire::{Counts, Receiver};
use gesture::{Gesture, at_rest};

/// The robot that is driven: its mass, wheels and motors, from which the gains follow. The example `tune` measures better ones.
const WHEEL: WheelTuning = WheelTuning {
    mass_kg: 20.0,
    wheel_radius_m: 0.076,
    driven_wheels: 4.0,
    torque_constant_nm_per_a: M3508::FACTS.torque_constant_nm_per_a,
    current_limit_a: CURRENT_LIMIT.as_amperes(),
};
/// 1.9 A per rad/s and 2.4 A per rad at the output shaft.
const SPEED: PidConfig = match WHEEL.speed_loop() {
    Ok(speed) => speed,
    Err(_) => panic!("a value of the wheel is not above zero"),
};
const CURRENT_LIMIT: Current = Current::from_amperes(10.0);
const FASTEST_WHEEL: AngularVelocity = AngularVelocity::from_rpm(400.0);
const FASTEST_M_S: f32 = 1.5;
const FASTEST_RAD_S: f32 = 4.0;
const IMU_DEADLINE: Duration = Duration::from_millis(50);

/// The parameters of a PC, by their place in the table: the gains of the wheels, with each of which a lifted wheel keeps still, and
/// a turn that expires.
const KP: usize = 0;
const KI: usize = 1;
const TURN: usize = 2;
const PARAMETERS: [Parameter; 3] = [
    Parameter::setting("wheel_kp", "A per rad/s", 0.2, 4.0),
    Parameter::setting("wheel_ki", "A per rad", 0.0, 10.0),
    Parameter::target("turn", "rad/s", -1.0, 1.0),
];

/// Five curves and the tail of a `JustFloat` frame.
pub const CURVES_BYTES: usize = 24;

/// Where a stick that is pushed ahead points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Forward {
    /// Where the chassis looks.
    Chassis,
    /// Where the yaw of the IMU is zero.
    Room,
    /// Nowhere: with another one, a stick that is held would turn the robot's way around.
    Lost,
}

/// The robot without its board.
#[derive(Debug)]
pub struct Pilot {
    wheels: MecanumWheels<Handle<M3508>>,
    chassis: Chassis<Mecanum>,
    dbus: Dbus,
    imu: Receiver<Imu, MAX_FRAME>,
    parameters: Parameters<3>,
    gesture: Gesture,
    /// The remote control is lost, and the robot is armed for a while.
    brakes: bool,
    forward: Forward,
}

impl Pilot {
    /// Attaches the four wheels: ids 1 to 4 are front right, front left, rear left, rear right.
    pub fn new(bus: &mut Bus) -> Result<Self, &'static str> {
        let (wheels, chassis) = (wheels_of(bus)?, chassis_of()?);
        let imu = Receiver::new(IMU_DEADLINE);
        let (gesture, forward) = (Gesture::default(), Forward::Chassis);
        let parameters = Parameters::new(PARAMETERS).map_err(|_| "a parameter that cannot work")?;
        let (dbus, brakes) = (Dbus::new(), false);
        Ok(Self { wheels, chassis, dbus, imu, parameters, gesture, brakes, forward })
    }

    /// Takes bytes of the remote control that arrived at `now`.
    pub fn hear_remote(&mut self, mut bytes: &[u8], now: Instant) {
        while self.dbus.read(&mut bytes, now).is_some() {}
    }

    /// Takes bytes of the IMU that arrived at `now`.
    pub fn hear_imu(&mut self, mut bytes: &[u8], now: Instant) {
        while self.imu.read(&mut bytes, now).is_some() {}
    }

    /// Takes bytes of a PC that arrived at `now`, and gives the wheels the gains that they set, without a jump of the output.
    ///
    /// To be called between two ticks.
    pub fn hear_debug_port(&mut self, bus: &mut Bus, mut bytes: &[u8], now: Instant) -> Counts {
        while self.parameters.read(&mut bytes, now).is_some() {
            let (kp, ki, kd) = self.gains(now);
            for wheel in self.wheels.into_array() {
                // Refused for a wheel that was detached only, which never happens here.
                _ = bus.set_speed_loop(wheel, SPEED.with_gains(kp, ki, kd));
            }
        }
        self.parameters.counts()
    }

    /// Returns a `JustFloat` frame for VOFA+: speed of the front left wheel in rpm (0 before it is heard), `wheel_kp`, `wheel_ki`,
    /// lines of the PC that were taken, and lines that were refused.
    pub fn curves(&self, bus: &Bus, now: Instant) -> [u8; CURVES_BYTES] {
        let speed = bus.state(self.wheels.front_left).map_or(0.0, |state| state.velocity.as_rpm());
        let (kp, ki, _) = self.gains(now);
        let counts = self.parameters.counts();
        let refused = [counts.content_errors, counts.foreign_frames, counts.length_errors];
        let refused = refused.iter().sum::<u32>() as f32;
        let mut frame = [0; CURVES_BYTES];
        // Refused for a buffer that is too small only, and this one is not.
        _ = justfloat(&[speed, kp, ki, counts.frames as f32, refused], &mut frame);
        frame
    }

    /// Returns the gains of the wheels: set by a PC, or by the mass of the robot.
    fn gains(&self, now: Instant) -> (f32, f32, f32) {
        let (kp, ki, kd) = SPEED.gains();
        let set = |index| self.parameters.value(index, now);
        (set(KP).unwrap_or(kp), set(KI).unwrap_or(ki), kd)
    }

    /// Hands over who was heard and lost since, for the log.
    pub fn edges(&mut self, now: Instant, mut log: impl FnMut(&'static str, Edge<&'static str>)) {
        while let Some(edge) = self.dbus.edge(now) {
            log("remote control", edge);
        }
        while let Some(edge) = self.imu.edge(now) {
            log("IMU", edge);
        }
    }

    /// Returns what the remote control asks for; to be called once a tick.
    pub fn order(&mut self, tick: Tick) -> SwitchOrder {
        let now = tick.now();
        // A turn of the PC is a stick that is held: arming moves nothing.
        let is_at_rest = self.turn_of_pc(now) == 0.0;
        let order = self.gesture.read(&self.dbus.remote(now), is_at_rest, tick);
        self.brakes = order == SwitchOrder::Brake;
        if order == SwitchOrder::Arm {
            self.chassis.restart();
        }
        order
    }

    /// Sets the targets of the wheels: zero unless all are armed, so when one is lost for 100 ms, the others brake.
    pub fn drive(&mut self, bus: &mut Bus, tick: Tick) {
        self.steer(&self.dbus.remote(tick.now()), tick.now());
        if !bus.is_armed() || self.brakes {
            self.chassis.set_body(Twist::ZERO);
        }
        self.chassis.drive(bus, self.wheels, tick);
    }

    /// Returns the turn that a PC asked for within the last 500 ms, in rad/s.
    fn turn_of_pc(&self, now: Instant) -> f32 {
        self.parameters.value(TURN, now).unwrap_or(0.0)
    }

    fn steer(&mut self, remote: &Remote, now: Instant) {
        let turn = self.turn_of_pc(now) - remote.left_x * FASTEST_RAD_S;
        let turn = turn.clamp(-FASTEST_RAD_S, FASTEST_RAD_S);
        let (vx, vy) = (remote.right_y * FASTEST_M_S, -remote.right_x * FASTEST_M_S);
        let yaw = self.imu.latest(now).map(|imu| {
            let (_, _, yaw) = imu.euler_roll_x();
            Heading::new(yaw)
        });
        self.forward = match (self.forward, yaw) {
            (_, Some(_)) if at_rest(remote) => Forward::Room,
            (_, None) if at_rest(remote) => Forward::Chassis,
            (Forward::Room, None) => Forward::Lost,
            (as_before, _) => as_before,
        };
        match (self.forward, yaw) {
            (Forward::Chassis, _) => self.chassis.set_body(Twist::new(vx, vy, turn)),
            (Forward::Room, Some(yaw)) => self.chassis.set_world(Twist::new(vx, vy, turn), yaw),
            (Forward::Room, None) | (Forward::Lost, _) => self.chassis.set_body(Twist::ZERO),
        }
    }
}

/// Attaches the four wheels: ids 1 to 4 are front right, front left, rear left, rear right.
fn wheels_of(bus: &mut Bus) -> Result<MecanumWheels<Handle<M3508>>, &'static str> {
    let wheel = |id| Config::<M3508>::new(id).speed_loop(SPEED).with_current_limit(CURRENT_LIMIT);
    let mut attach = |config| bus.attach(config).map_err(|_| "a wheel's id is taken");
    Ok(MecanumWheels {
        front_left: attach(wheel(2))?,
        front_right: attach(wheel(1).reversed())?,
        rear_left: attach(wheel(3))?,
        rear_right: attach(wheel(4).reversed())?,
    })
}

fn chassis_of() -> Result<Chassis<Mecanum>, &'static str> {
    let mecanum = Mecanum::new(WHEEL.wheel_radius_m, Vec2::new(0.20, 0.18));
    let mut chassis = Chassis::new(mecanum.map_err(|_| "no such chassis")?);
    let limits = ChassisLimits::new().with_acceleration(4.0, 12.0).with_wheel_speed(FASTEST_WHEEL);
    chassis.set_limits(limits).map_err(|_| "a limit is not above zero")?;
    Ok(chassis)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::frame::CanFrame;
    use drivetrain::geometry::Body;
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::sim::{ChassisConfig, Fault, MotorConfig, MotorKey, Simulation, Wheel};

    const UP: u64 = 1;
    const MIDDLE: u64 = 3;
    const REST: u64 = 1024;
    const HALF: u64 = 1354;

    /// A frame with all channels at rest but the first, and the right switch at `switch`.
    fn frame(channel: u64, switch: u64) -> [u8; 18] {
        shown(channel, REST, switch)
    }

    /// The right stick across and ahead, and the right switch.
    fn shown(across: u64, ahead: u64, switch: u64) -> [u8; 18] {
        let bits = across | ahead << 11 | REST << 22 | REST << 33 | switch << 44 | MIDDLE << 46;
        let mut frame = [0; 18];
        frame[..6].copy_from_slice(&bits.to_le_bytes()[..6]);
        frame
    }

    fn orders(frames: &[[u8; 18]]) -> SwitchOrder {
        orders_after(b"", frames)
    }

    /// The last order, after lines of a PC at 1 ms.
    fn orders_after(lines: &[u8], frames: &[[u8; 18]]) -> SwitchOrder {
        let mut bus = Bus::new();
        let mut pilot = Pilot::new(&mut bus).unwrap();
        pilot.hear_debug_port(&mut bus, lines, Instant::START + Duration::from_millis(1));
        let mut order = SwitchOrder::Disarm;
        for (frame, ms) in frames.iter().zip((14..).step_by(14)) {
            let now = Instant::START + Duration::from_millis(ms);
            pilot.hear_remote(frame, now);
            order = pilot.order(Tick::new(now, 0.001));
        }
        order
    }

    /// As the README has them.
    #[test]
    fn the_gains_are_those_that_the_comment_says() {
        let (kp, ki, kd) = SPEED.gains();
        assert_eq!([(10.0 * kp).round(), (10.0 * ki).round(), kd], [19.0, 24.0, 0.0]);
    }

    #[test]
    fn only_turning_the_switch_to_the_top_with_both_sticks_at_rest_arms() {
        assert_eq!(orders(&[frame(1024, MIDDLE), frame(1024, UP)]), SwitchOrder::Arm);
        assert_eq!(
            orders(&[frame(1024, MIDDLE), frame(1024, UP), frame(1684, UP)]),
            SwitchOrder::Keep
        );
        assert_eq!(
            orders(&[frame(1024, MIDDLE), frame(1684, UP)]),
            SwitchOrder::Keep,
            "disarmed as before"
        );
        assert_eq!(orders(&[frame(1024, UP)]), SwitchOrder::Keep, "at power-on");
        assert_eq!(orders(&[frame(1024, UP), frame(1024, MIDDLE)]), SwitchOrder::Disarm);
    }

    #[test]
    fn a_turn_of_the_pc_prevents_arming_as_a_stick_that_is_held_does() {
        let turned_up = [frame(1024, 3), frame(1024, 1)];
        assert_eq!(orders_after(b"turn=0.5\n", &turned_up), SwitchOrder::Keep);
        assert_eq!(orders_after(b"turn=0\nwheel_kp=1\n", &turned_up), SwitchOrder::Arm);
    }

    /// The first word that a wheel at rest is sent for a target of 1 rad/s.
    fn word(lines: &[u8]) -> i16 {
        let now = Instant::START + Duration::from_secs(1);
        let mut bus = Bus::new();
        let mut pilot = Pilot::new(&mut bus).unwrap();
        for id in 0x201..=0x204 {
            let frame = CanFrame::standard(id, [0, 0, 0, 0, 0, 0, 25, 0]).unwrap();
            _ = bus.ingest(&frame, now);
        }
        bus.update(Tick::new(now, 0.001));
        bus.arm(now).unwrap();
        pilot.hear_debug_port(&mut bus, lines, now);
        let mut word = 0;
        // The range opens within 0.2 s.
        for ms in 1..=300 {
            let now = now + Duration::from_millis(ms);
            for id in 0x201..=0x204 {
                let frame = CanFrame::standard(id, [0, 0, 0, 0, 0, 0, 25, 0]).unwrap();
                _ = bus.ingest(&frame, now);
            }
            let wheel = pilot.wheels.front_left;
            let target = if ms < 300 { 0.0 } else { 1.0 };
            bus.set_velocity(wheel, AngularVelocity::from_rad_per_s(target)).unwrap();
            bus.update(Tick::new(now, 0.001));
            while let Some(frame) = bus.next_frame() {
                word = i16::from_be_bytes([frame.bytes()[2], frame.bytes()[3]]);
            }
        }
        word
    }

    #[test]
    fn a_gain_over_the_debug_port_acts_and_a_bad_one_does_not() {
        let usual = word(b"");
        assert!((1_570..1_590).contains(&usual), "1.9 A: {usual}");
        let half = word(b"wheel_kp=0.9625\nwheel_ki=0\n");
        assert!((786..=790).contains(&half), "{half}");
        for bad in [&b"wheel_kp=400\n"[..], b"wheel_kp=nan\n", b"wheel_kq=1\n", b"wheel_kp=0.5"] {
            assert_eq!(word(bad), usual);
        }
    }

    #[test]
    fn curves_show_the_gains_and_what_became_of_the_lines() {
        let now = Instant::START + Duration::from_secs(1);
        let mut bus = Bus::new();
        let mut pilot = Pilot::new(&mut bus).unwrap();
        _ = bus.ingest(&CanFrame::standard(0x202, [0, 0, 0x07, 0x80, 0, 0, 25, 0]).unwrap(), now);
        pilot.hear_debug_port(&mut bus, b"wheel_kp=2.5\nwheel_ki=nan\nwheel\n", now);
        let frame = pilot.curves(&bus, now);
        let curve = |at: usize| f32::from_le_bytes(frame[4 * at..4 * at + 4].try_into().unwrap());
        // 1920 rpm of the rotor behind a gear of 3591 to 187.
        assert!((curve(0) - 99.98).abs() < 0.01, "{}", curve(0));
        assert!((curve(2) - 2.4).abs() < 0.1, "{}", curve(2));
        assert_eq!([curve(1), curve(3), curve(4)], [2.5, 1.0, 2.0]);
        assert_eq!(frame[20..], [0, 0, 0x80, 0x7F]);
    }

    /// The robot on its wheels, and its front left motor.
    fn on_wheels() -> (Simulation, MotorKey) {
        let world = Simulation::new(1);
        let wheel = |id, x, y| {
            let motor = world.attach(MotorConfig::m3508(id)).unwrap();
            (motor, Wheel::mecanum(motor, WHEEL.wheel_radius_m, Vec2::new(x, y)))
        };
        let left = [wheel(2, 0.2, 0.18), wheel(3, -0.2, 0.18)];
        let right =
            [wheel(1, 0.2, -0.18), wheel(4, -0.2, -0.18)].map(|(_, wheel)| wheel.reversed());
        let floor = [left[0].1, left[1].1, right[0], right[1]];
        world.attach_chassis(ChassisConfig::new(&floor).with_mass_kg(WHEEL.mass_kg)).unwrap();
        (world, left[0].0)
    }

    /// The motion of the robot at half a stick ahead, and 0.6 s after its front left wheel fell silent.
    fn motions_with_a_wheel_that_falls_silent() -> [Twist<Body>; 2] {
        const SILENT_AT_MS: u64 = 2_000;
        let (world, front_left) = on_wheels();
        let at = |ms| Instant::START + Duration::from_millis(ms);
        world.fault(Fault::Silent(front_left), at(SILENT_AT_MS)..at(9_000)).unwrap();
        let mut bus = Bus::new();
        let mut pilot = Pilot::new(&mut bus).unwrap();
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        let mut motions = [Twist::ZERO; 2];
        for ms in 1..SILENT_AT_MS + 600 {
            world.advance(Duration::from_millis(1));
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            let (ahead, switch) = match ms {
                0..200 => (REST, MIDDLE),
                200..500 => (REST, UP),
                _ => (HALF, UP),
            };
            pilot.hear_remote(&shown(REST, ahead, switch), tick.now());
            match pilot.order(tick) {
                SwitchOrder::Arm => runner.arm(tick).unwrap(),
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => runner.device_mut().disarm(),
            }
            pilot.drive(runner.device_mut(), tick);
            runner.tick(tick);
            let (_, motion) = world.chassis().unwrap();
            motions = [if ms < SILENT_AT_MS { motion } else { motions[0] }, motion];
        }
        motions
    }

    #[test]
    fn three_wheels_stop_the_robot_when_the_fourth_is_lost_while_a_stick_is_held() {
        let [before, after] = motions_with_a_wheel_that_falls_silent();
        assert!((before.vx_m_s - 0.75).abs() < 0.05, "{before:?}");
        assert!(after.linear().norm() < 0.02 && after.wz_rad_s.abs() < 0.02, "{after:?}");
    }

    #[test]
    fn a_robot_whose_remote_control_is_lost_brakes_for_a_second_and_is_disarmed() {
        let (world, _) = on_wheels();
        let mut bus = Bus::new();
        let mut pilot = Pilot::new(&mut bus).unwrap();
        let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
        let mut way = [0.0; 2];
        for ms in 1..4_000 {
            world.advance(Duration::from_millis(1));
            runner.poll(16);
            let Some(tick) = runner.due() else { continue };
            // Heard again with the switch at the top and the stick held, 0.5 s after the loss.
            if !(2_000..2_500).contains(&ms) {
                let (ahead, switch) = if ms < 200 {
                    (REST, MIDDLE)
                } else {
                    (if ms < 500 { REST } else { HALF }, UP)
                };
                pilot.hear_remote(&shown(REST, ahead, switch), tick.now());
            }
            let order = pilot.order(tick);
            match order {
                SwitchOrder::Arm => runner.arm(tick).unwrap(),
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => runner.device_mut().disarm(),
            }
            assert_eq!(
                order == SwitchOrder::Brake,
                (2_100..3_100).contains(&ms),
                "{ms} ms: {order:?}"
            );
            pilot.drive(runner.device_mut(), tick);
            runner.tick(tick);
            let (pose, motion) = world.chassis().unwrap();
            match ms {
                2_100 => way[0] = pose.x_m,
                2_600 => assert!(motion.linear().norm() < 0.02, "{motion:?}"),
                3_999 => way[1] = pose.x_m,
                _ => {}
            }
        }
        assert!((0.05..0.3).contains(&(way[1] - way[0])), "{way:?} m");
        assert!(!runner.is_armed());
    }

    /// A frame of the IMU at a yaw of 180°; its time goes on, otherwise it would count as frozen.
    fn turned_around(now: Instant) -> [u8; 82] {
        let mut frame = [0; 82];
        frame[..4].copy_from_slice(&[0x5A, 0xA5, 76, 0]);
        frame[6] = 0x91;
        frame[14..18].copy_from_slice(&now.as_micros().to_le_bytes()[..4]);
        frame[78..].copy_from_slice(&1.0_f32.to_le_bytes());
        // CRC-16/XMODEM of all but itself.
        let covered = frame[..4].iter().chain(&frame[6..]);
        let crc = covered.fold(0_u16, |crc, byte| {
            (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
                if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
            })
        });
        frame[4..6].copy_from_slice(&crc.to_le_bytes());
        frame
    }

    /// At a yaw of 180°, right in the room is left of the chassis.
    #[test]
    fn a_stick_that_is_held_never_turns_the_way_around_when_the_imu_comes_and_goes() {
        const RIGHT: u64 = 1684;
        const UNHEARD: MecanumWheels<Option<AngularVelocity>> = MecanumWheels {
            front_left: None,
            front_right: None,
            rear_left: None,
            rear_right: None,
        };
        let mut pilot = Pilot::new(&mut Bus::new()).unwrap();
        let mut now = Instant::START;
        // The sideways speed after a second in which the stick is there and the IMU is heard, or not.
        let mut after = |stick: u64, is_heard: bool| {
            for _ in 0..100 {
                now = now + Duration::from_millis(10);
                pilot.hear_remote(&frame(stick, 1), now);
                if is_heard {
                    pilot.hear_imu(&turned_around(now), now);
                }
                pilot.steer(&pilot.dbus.remote(now), now);
                pilot.chassis.update(UNHEARD, Tick::new(now, 0.01));
            }
            (pilot.chassis.reference().vy_m_s * 100.0).round() / 100.0
        };
        assert_eq!([after(REST, true), after(RIGHT, true)], [0.0, FASTEST_M_S]);
        assert_eq!([after(RIGHT, false), after(RIGHT, true)], [0.0, 0.0], "until it is let go");
        assert_eq!([after(REST, true), after(RIGHT, true)], [0.0, FASTEST_M_S]);
        // Begun without an IMU, it stays without one.
        assert_eq!([after(REST, false), after(RIGHT, false)], [0.0, -FASTEST_M_S]);
        assert_eq!([after(RIGHT, true), after(REST, true)], [-FASTEST_M_S, 0.0]);
        assert_eq!(after(RIGHT, true), FASTEST_M_S);
        let (mut remote, mut imu) = (false, false);
        pilot.edges(now, |who, _| match who {
            "remote control" => remote = true,
            _ => imu = who == "IMU",
        });
        assert!(remote && imu, "who was heard, for the log");
    }
}
