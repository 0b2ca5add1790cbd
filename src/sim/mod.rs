//! A simulated world to test robots in: CAN buses, motors with their ESCs, and their faults.
//!
//! [`Simulation`] stands for everything beyond the CAN driver. The code under test gets the driver's end of a bus,
//! [`Controller`], which implements both [`embedded_can::nb::Can`] and [`embedded_can::blocking::Can`], and a clock,
//! `&Simulation`; the test moves time, and reads the true state rather than the reported state.
//!
//! ```text
//!  code under test                        Simulation
//!  ┌──────────────┐   ┌──────────────────────────────────────────────────┐
//!  │ driver calls ├───┤ Controller: 3 mailboxes, receive queue           │
//!  │              │   │      ║                                           │
//!  │              │   │ ═════╩══ bus ══╦══════════╦══════════╦═══════════│ arbitration, bit-exact times
//!  │              │   │          ESC + motor  ESC + motor  foreign nodes │
//!  │ clock        ├───┤ &Simulation    ╚═ own clock, own phase           │
//!  └──────────────┘   └──────────────────────────────────────────────────┘
//! ```
//!
//! | item | meaning |
//! |---|---|
//! | [`Simulation`] | the three buses, up to 16 motors and 12 joints, and the time |
//! | [`MotorConfig`] | a motor to attach; a joint of a snake robot needs no configuration: [`Simulation::attach_joint`] |
//! | [`MotorKey`], [`MotorState`] | an attached motor or joint, and its true state |
//! | [`Drive`], [`DamiaoDrive`], [`RobStrideDrive`], [`LkDrive`], [`RmdDrive`], [`VescDrive`], [`OdriveDrive`] | a drive of another family, put on a bus by [`Simulation::advance_drives`] |
//! | [`ChassisConfig`], [`Wheel`] | a body on wheels of any layout |
//! | [`SerialLine`] | a serial line that takes its time, and damages bytes |
//! | [`Controller`] | the driver's end of a bus |
//! | [`Fault`] | a fault and its window of time |
//! | [`SimError`] | why something is refused, or a call of the driver failed |
//! | [`Transmission`], [`Sender`], [`Traffic`] | every frame on a [`Line`] with its time, as a line of candump; bus load and counters |
//! | [`contract`] | check of a device, also of the application, against its promises |
//! | [`frame_bits`], [`nominal_bits`], [`worst_case_bits`] | how long a frame is on the wire |
//!
//! ```
//! use drivetrain::frame::CanFrame;
//! use drivetrain::sim::{MotorConfig, Simulation};
//! use drivetrain::time::Duration;
//! use embedded_can::nb::Can;
//!
//! let world = Simulation::new(7);
//! let wheel = world.attach(MotorConfig::m3508(1))?;
//! let mut can = world.controller();
//! let two_amperes = CanFrame::standard(0x200, [0x06, 0x66, 0, 0, 0, 0, 0, 0]).ok_or("id")?;
//! can.transmit(&two_amperes).map_err(|_| "refused")?;
//! world.advance(Duration::from_millis(40));
//!
//! let feedback = can.receive().map_err(|_| "nothing heard")?;
//! assert_eq!(feedback.header(), 0x201);
//! let motor = world.motor(wheel).ok_or("not attached")?;
//! assert!((motor.current.as_amperes() - 2.0).abs() < 0.001);
//! assert!((motor.torque_nm - 0.6).abs() < 0.001);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Accuracy
//! Exact: frame lengths with stuff bits and checksum, arbitration, mailbox rules, slots, scales, rounding; the same
//! seed and the same calls give the same states, bit for bit, on every target. Documented: torque constants, gears and
//! no-load speeds. **Estimates**: inertia, friction, winding, heat, jitter of the ESC, and its reaction when commands
//! stop ([`MotorConfig::with_command_timeout`]).
//!
//! A wheel on the ground holds within its friction (estimate 0.8, so about 2 Nm a wheel under 20 kg): at a larger
//! torque the wheel spins, as on a real floor.
//!
//! 18 runs, from a stalled motor to a sliding chassis, are compared with `MuJoCo`: they agree within 1 % of the largest value, but for
//! the transfer of weight below (`judges/README.md`).
//!
//! Not simulated: error frames and error counters, two senders of one id at the same bit, cogging, the supply's sag, the transfer
//! of weight to other wheels when a chassis accelerates, and the effect of a turning module on the floor, on its wheel's drive
//! and on the body. Motors move in steps of 100 µs; in between, the feedback continues their angle in a line.
//!
//! # A node of your own
//! A test can play any other node of a bus: read each frame in [`Simulation::advance_with`] and answer with
//! [`Simulation::inject`]. Injected frames are shown too. A motor drive of your own implements [`Drive`].

pub mod contract;

mod body;
mod can;
mod chassis;
mod drive;
mod engine;
mod esc;
mod fault;
mod joint;
mod line;
mod motor;
mod port;
mod rotor;

use crate::frame::CanFrame;
use crate::geometry::{Body, Pose2, Twist, World};
use crate::time::{Clock, Duration, Instant};
use chassis::Chassis;
use core::cell::RefCell;
use core::ops::RangeBounds;
use engine::Engine;
use joint::JointConfig;
use motor::{JOINTS, MOTORS};

pub use can::{INTERMISSION_BITS, Line, frame_bits, nominal_bits, worst_case_bits};
pub use chassis::{ChassisConfig, Wheel};
pub use drive::{
    DamiaoDrive, Drive, DriveShaft, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive,
};
pub use fault::{Fault, SimError};
pub use line::{Sender, Traffic, Transmission};
pub use motor::{MotorConfig, MotorKey, MotorState};
pub use port::{Controller, SerialLine};

/// Three CAN buses with motors on them, and the time.
///
/// The simulation is shared by reference, so the code under test can own the driver's end of a bus while the test moves
/// time: events happen only in [`advance`](Self::advance) and its siblings, and in blocking calls. A reference is a
/// [`Clock`] with the simulated time.
///
/// # Examples
/// ```
/// use drivetrain::sim::{Line, MotorConfig, Simulation};
/// use drivetrain::time::{Duration, Instant};
///
/// let world = Simulation::new(7);
/// world.attach(MotorConfig::gm6020_voltage(1))?;
/// world.advance(Duration::from_millis(10));
/// assert_eq!(world.now(), Instant::from_micros(10_000));
/// assert_eq!(world.traffic(Line::Can1).frames, 10);
/// # Ok::<(), drivetrain::sim::SimError>(())
/// ```
#[derive(Debug)]
pub struct Simulation(RefCell<Engine>);

impl Simulation {
    /// The largest number of motors with ESCs.
    pub const MAX_MOTORS: usize = MOTORS;
    /// The largest number of joints.
    pub const MAX_JOINTS: usize = JOINTS;

    /// Makes empty buses at 1 Mbit/s. The seed decides phases, clock errors, start angles and every chance.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(RefCell::new(Engine::new(seed)))
    }

    /// Sets the bit rate of one bus; a bit lasts whole nanoseconds, at least one.
    #[must_use]
    pub fn with_bit_rate(self, line: Line, bits_per_s: u32) -> Self {
        self.with(|engine| engine.wire_mut(line).set_bit_rate(bits_per_s));
        self
    }

    /// Sets the number of received frames that the controller of one bus can hold: 1 to 64, by default 64.
    #[must_use]
    pub fn with_receive_depth(self, line: Line, frames: usize) -> Self {
        self.with(|engine| engine.wire_mut(line).set_receive_depth(frames));
        self
    }

    /// Gives the controller of one bus an acceptance filter: a standard data frame passes when `id & mask` is the same
    /// for both, and nothing else passes. A mask of 0 passes everything.
    #[must_use]
    pub fn with_filter(self, line: Line, id: u16, mask: u16) -> Self {
        self.with(|engine| engine.wire_mut(line).set_filter(id, mask));
        self
    }

    /// Puts a motor on a bus. Two with the same id are possible, as in reality.
    ///
    /// # Errors
    /// When the model has no such id, or when there are 16 motors already.
    pub fn attach(&self, config: MotorConfig) -> Result<MotorKey, SimError> {
        self.with(|engine| engine.attach(config))
    }

    /// Puts a joint of a snake robot on a bus, with the counter of its drive at `at` pulses; for `None` the seed chooses within
    /// half a turn. Two with the same id (1 to 12) are possible, as in reality.
    ///
    /// A joint speaks the protocol of [`snake`](crate::snake). **Its behaviour is an estimate**: the joint moves to its target
    /// with the speed, acceleration and deceleration of its registers, its shaft 2 ms behind; it answers 150 to 250 µs after a
    /// request ([`set_latency`](Self::set_latency)); disabled, friction stops the shaft; without a command the joint continues for
    /// ever; without a supply, every register and the zero are lost.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::sim::{Line, Simulation};
    /// use drivetrain::snake::{Command, Register};
    /// use drivetrain::time::Duration;
    /// use embedded_can::nb::Can;
    ///
    /// let world = Simulation::new(7);
    /// let neck = world.attach_joint(Line::Can1, 3, Some(0))?;
    /// let mut can = world.controller();
    /// let motion = [(Register::Acceleration, 1_092_266), (Register::Deceleration, 1_092_266)];
    /// let target = [(Register::Speed, 65_536), (Register::Position, 32_768)]; // a turn a second, half a turn
    /// let setup = [(Register::Mode, 1), (Register::Current, 1), (Register::Enable, 1)];
    /// for (register, value) in motion.into_iter().chain(target).chain(setup) {
    ///     let frame = Command::Write(register, value).frame(3).ok_or("id")?;
    ///     can.transmit(&frame).map_err(|_| "refused")?;
    ///     world.advance(Duration::from_millis(1));
    /// }
    /// world.advance(Duration::from_millis(300)); // 60 ms to speed up, then in uniform motion
    /// let state = world.motor(neck).ok_or("not attached")?;
    /// assert!((state.velocity.as_rpm() - 60.0).abs() < 0.1 && state.is_enabled);
    /// world.advance(Duration::from_millis(400));
    /// assert_eq!(world.motor(neck).ok_or("not attached")?.encoder_counts, 32_768);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When there is no such id, or when there are 12 joints already.
    pub fn attach_joint(&self, line: Line, id: u8, at: Option<i32>) -> Result<MotorKey, SimError> {
        self.with(|engine| engine.attach_joint(JointConfig::new(line, id, at)))
    }

    /// Returns the driver's end of the first bus.
    #[must_use]
    pub const fn controller(&self) -> Controller<'_> {
        self.controller_on(Line::Can1)
    }

    /// Returns the driver's end of a bus. Each call gives the same end.
    #[must_use]
    pub const fn controller_on(&self, line: Line) -> Controller<'_> {
        Controller::new(&self.0, line)
    }

    /// Returns a clock that shows the time of this world: a reference to it.
    #[must_use]
    pub const fn clock(&self) -> &Self {
        self
    }

    /// Returns the time, in whole microseconds.
    #[must_use]
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.with(|engine| engine.now_ns) / 1_000)
    }

    /// Moves time forward.
    pub fn advance(&self, duration: Duration) {
        self.advance_with(duration, |_| {});
    }

    /// Moves time forward to an instant; a past instant changes nothing.
    pub fn advance_to(&self, instant: Instant) {
        self.advance(instant.since(self.now()));
    }

    /// Moves time forward, and shows every frame on any bus, in order.
    ///
    /// While a frame is shown, the time is the end of this frame, and the whole world can be used. Frames that passed
    /// during a blocking call are shown first, the first 64 of them.
    ///
    /// # Examples
    /// A node that answers every remote request for 0x123 with one byte:
    /// ```
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::sim::{Line, Simulation};
    /// use drivetrain::time::Duration;
    /// use embedded_can::{Frame, StandardId, nb::Can};
    ///
    /// let world = Simulation::new(1);
    /// let id = StandardId::new(0x123).ok_or("id")?;
    /// let request = CanFrame::new_remote(id, 1).ok_or("length")?;
    /// let answer = CanFrame::new(id, &[42]).ok_or("length")?;
    /// world.controller().transmit(&request).map_err(|_| "refused")?;
    /// world.advance_with(Duration::from_millis(1), |record| {
    ///     if record.frame == request {
    ///         let _full = world.inject(Line::Can1, answer);
    ///     }
    /// });
    /// assert_eq!(world.controller().receive(), Ok(answer));
    /// # Ok::<(), &str>(())
    /// ```
    pub fn advance_with(&self, duration: Duration, mut show: impl FnMut(&Transmission)) {
        while let Some(record) = self.with(|engine| engine.unseen.pop()) {
            show(&record);
        }
        let span_ns = duration.as_micros().saturating_mul(1_000);
        let limit_ns = self.with(|engine| engine.now_ns).saturating_add(span_ns);
        // The engine is free again while a record is shown.
        while let Some(record) = self.with(|engine| engine.run_until(limit_ns)) {
            show(&record);
        }
    }

    /// Returns the true state of a motor or joint; `None` for a key of another world.
    #[must_use]
    pub fn motor(&self, motor: MotorKey) -> Option<MotorState> {
        self.with(|engine| engine.motor(motor))
    }

    /// Puts a chassis on its motors; their shafts then carry it. The motors may sit on different buses. A second
    /// chassis replaces the first.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn attach_chassis(&self, config: ChassisConfig) -> Result<(), SimError> {
        config.validate().map_err(SimError::Chassis)?;
        let chassis = Chassis::new(&config);
        self.with(|engine| engine.chassis = Some(chassis));
        Ok(())
    }

    /// Returns the true pose and motion of the chassis, its angle not reduced to one turn; `None` without a chassis. A chassis starts at
    /// the origin, facing along x.
    #[must_use]
    pub fn chassis(&self) -> Option<(Pose2<World>, Twist<Body>)> {
        self.with(|engine| engine.chassis.as_ref().map(Chassis::state))
    }

    /// Pushes the chassis from now on: N along the world's x and y axes, and Nm counter-clockwise. A value that is not
    /// finite counts as zero.
    pub fn push_chassis(&self, x_n: f32, y_n: f32, torque_nm: f32) {
        let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
        let push = [x_n, y_n, torque_nm].map(finite);
        self.with(|engine| {
            if let Some(chassis) = &mut engine.chassis {
                chassis.body.push = push;
            }
        });
    }

    /// Puts a torque on the output shaft of a motor, in Nm; positive turns the shaft counter-clockwise. A value that is
    /// not finite counts as zero. A joint is unaffected: its drive is strong enough for every load.
    pub fn set_load_nm(&self, motor: MotorKey, torque_nm: f32) {
        let torque_nm = if torque_nm.is_finite() { torque_nm } else { 0.0 };
        self.with(|engine| {
            if let Some(esc) = engine.esc_mut(motor) {
                esc.rotor.load_nm = torque_nm;
            }
        });
    }

    /// Sets the temperature of a motor in °C, as the start of its further course. A value that is not finite changes nothing,
    /// and a joint has no temperature.
    pub fn set_temperature_c(&self, motor: MotorKey, celsius: f32) {
        self.with(|engine| {
            if let Some(esc) = engine.esc_mut(motor).filter(|_| celsius.is_finite()) {
                esc.rotor.set_temperature(celsius);
            }
        });
    }

    /// Sets the least time until an answer of a joint: 150 µs at first. A motor has none.
    pub fn set_latency(&self, joint: MotorKey, latency: Duration) {
        self.with(|engine| engine.set_latency(joint, latency));
    }

    /// Sends a frame from a foreign node, after its pending frames.
    ///
    /// # Errors
    /// [`SimError::BusFull`] when 64 wait already.
    pub fn inject(&self, line: Line, frame: CanFrame) -> Result<(), SimError> {
        let pushed = self.with(|engine| engine.wire_mut(line).foreign.push(frame));
        pushed.map_err(|_| SimError::BusFull(line))
    }

    /// Lets something go wrong for a while: `from..until`, `from..`, or `..` for ever.
    ///
    /// # Examples
    /// ```
    /// use drivetrain::sim::{Fault, Line, MotorConfig, Simulation};
    /// use drivetrain::time::{Duration, Instant};
    ///
    /// let world = Simulation::new(1);
    /// let wheel = world.attach(MotorConfig::m3508(1))?;
    /// world.fault(Fault::Silent(wheel), Instant::from_micros(20_000)..Instant::from_micros(50_000))?;
    /// world.advance(Duration::from_millis(100));
    /// assert_eq!(world.traffic(Line::Can1).frames, 70); // 30 of 100 are missing
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When there are already 16 faults that are not over, and when the fault excludes a joint.
    pub fn fault(&self, fault: Fault, window: impl RangeBounds<Instant>) -> Result<(), SimError> {
        self.with(|engine| {
            let (seed, now_ns) = (engine.seed, engine.now_ns);
            engine.faults.schedule(fault, window, seed, now_ns)
        })
    }

    /// Returns the traffic of a bus so far.
    #[must_use]
    pub fn traffic(&self, line: Line) -> Traffic {
        self.with(|engine| engine.wire(line).traffic(engine.now_ns))
    }

    /// Works on the state. No caller's code runs in `work`, so the state is never borrowed twice.
    fn with<T>(&self, work: impl FnOnce(&mut Engine) -> T) -> T {
        work(&mut self.0.borrow_mut())
    }
}

impl Clock for &Simulation {
    fn now(&mut self) -> Instant {
        Simulation::now(self)
    }
}

#[cfg(test)]
mod tests;
