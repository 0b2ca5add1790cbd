//! One robot in its world: knobs, faults, time.

use crate::delay::Delayed;
use crate::robot::{self, Layout, Pilot, Robot, Watchdogs};
use crate::snapshot::{self, Frames};
use drivetrain::control::PidConfig;
use drivetrain::frame::CanFrame;
use drivetrain::geometry::Twist;
use drivetrain::sim::{Fault, Line, MotorKey, Simulation, Transmission};
use drivetrain::time::{Duration, Instant};
use std::cell::Cell;
use std::error::Error;
use std::fmt::Write;
use std::rc::Rc;

/// A fault that lasts, or a loss of frames, is scheduled for this time again and again.
const WINDOW_MS: u64 = 20;
/// How often the loop of the robot looks for frames and for time.
const POLL: Duration = Duration::from_micros(100);
/// The log keeps this many bytes for the page; lines that the page does not read are dropped, with a note.
const LOG_BYTES: usize = 16_384;

/// Settings that a start fixes.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// Decides phases, clock errors and every chance.
    pub seed: u32,
    /// Where the wheels are.
    pub layout: Layout,
    /// Mass of the robot in kg.
    pub mass_kg: f32,
    /// Proportional gain of each wheel in A per rad/s.
    pub kp: f32,
    /// Integral gain of each wheel in A per rad.
    pub ki: f32,
    /// The watchdog that stops the motors when frames do not come.
    pub watchdogs: Watchdogs,
}

/// Settings that a hand may turn while the robot runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Knob {
    /// The arming switch: on from 0.5.
    Switch,
    /// Velocity ahead in m/s.
    Ahead,
    /// Velocity to the left in m/s.
    Left,
    /// Rate of turn in rad/s, counter-clockwise.
    Turn,
    /// Proportional gain in A per rad/s.
    Kp,
    /// Integral gain in A per rad.
    Ki,
    /// Delay of received frames in ms.
    DelayMs,
    /// Share of the frames that get lost, 0 to 1.
    Loss,
}

impl Knob {
    /// All knobs, with the word of a script for each.
    pub const ALL: [(&'static str, Self); 8] = [
        ("switch", Self::Switch),
        ("ahead", Self::Ahead),
        ("left", Self::Left),
        ("turn", Self::Turn),
        ("kp", Self::Kp),
        ("ki", Self::Ki),
        ("delay", Self::DelayMs),
        ("loss", Self::Loss),
    ];
}

/// A fault, which lasts until it is ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// The CAN plug of the controller is out.
    Plug,
    /// The first wheel sends no feedback.
    Silence,
    /// Another node sends commands of 1 A.
    SecondMaster,
    /// The controller is off the bus.
    BusOff,
    /// Something holds the shaft of the first wheel.
    Block,
}

impl Trouble {
    /// All troubles, with the word of a script for each.
    pub const ALL: [(&'static str, Self); 5] = [
        ("plug", Self::Plug),
        ("silence", Self::Silence),
        ("second-master", Self::SecondMaster),
        ("bus-off", Self::BusOff),
        ("block", Self::Block),
    ];
}

/// A robot that runs.
pub struct Session {
    world: &'static Simulation,
    robot: Box<dyn Robot>,
    keys: Vec<MotorKey>,
    pilot: Pilot,
    gains: (f32, f32),
    delay: Rc<Cell<Duration>>,
    loss: f32,
    troubles: [bool; Trouble::ALL.len()],
    frames: Frames,
    log: String,
    script: String,
    setup: Setup,
}

impl Session {
    /// Puts a robot into a world of its own, which stays in memory until the program, or the page's copy of it, ends.
    ///
    /// # Errors
    /// If a mass or a gain is out of range, with the reason.
    pub fn new(setup: Setup) -> Result<Self, Box<dyn Error>> {
        let world: &'static Simulation = Box::leak(Box::new(Simulation::new(setup.seed.into())));
        let delay = Rc::new(Cell::new(Duration::ZERO));
        let can = Delayed::new(world.controller(), world, Rc::clone(&delay));
        let speed = PidConfig::new(setup.kp, setup.ki, 0.0);
        let (robot, keys) =
            robot::build(setup.layout, world, can, setup.mass_kg, speed, setup.watchdogs)?;
        Ok(Self {
            world,
            robot,
            keys,
            pilot: Pilot { is_switch_on: false, twist: Twist::ZERO },
            gains: (setup.kp, setup.ki),
            delay,
            loss: 0.0,
            troubles: [false; Trouble::ALL.len()],
            frames: Frames::new(),
            log: String::new(),
            script: String::new(),
            setup,
        })
    }

    /// Turns a knob. A value that is not finite, or a gain that the motors refuse, changes nothing and is said in the log.
    pub fn set(&mut self, knob: Knob, value: f32) {
        if !value.is_finite() {
            return self.note(format_args!("refused: not a number"));
        }
        self.write_down(
            Knob::ALL.iter().find(|(_, one)| *one == knob).map(|(word, _)| *word),
            value,
        );
        let twist = &mut self.pilot.twist;
        match knob {
            Knob::Switch => self.pilot.is_switch_on = value >= 0.5,
            Knob::Ahead => twist.vx_m_s = value,
            Knob::Left => twist.vy_m_s = value,
            Knob::Turn => twist.wz_rad_s = value,
            Knob::Kp => self.set_gains((value, self.gains.1)),
            Knob::Ki => self.set_gains((self.gains.0, value)),
            Knob::DelayMs => {
                self.delay.set(Duration::from_secs_f32(value / 1e3).unwrap_or(Duration::ZERO))
            }
            Knob::Loss => self.loss = value.clamp(0.0, 1.0),
        }
    }

    fn set_gains(&mut self, (kp, ki): (f32, f32)) {
        match self.robot.set_gains(PidConfig::new(kp, ki, 0.0)) {
            Ok(()) => self.gains = (kp, ki),
            Err(why) => self.note(format_args!("gains refused: {why}")),
        }
    }

    /// Begins a trouble, or ends it: within 20 ms.
    pub fn trouble(&mut self, trouble: Trouble, begins: bool) {
        let Some(place) = Trouble::ALL.iter().position(|(_, one)| *one == trouble) else { return };
        self.write_down(
            Trouble::ALL.get(place).map(|(word, _)| *word),
            f32::from(u8::from(begins)),
        );
        if let Some(active) = self.troubles.get_mut(place) {
            *active = begins;
        }
    }

    /// Lets so many milliseconds pass.
    pub fn advance(&mut self, ms: u32) {
        for _ in 0..ms {
            if self.millis().is_multiple_of(WINDOW_MS) {
                self.schedule();
            }
            self.millisecond();
        }
    }

    fn millisecond(&mut self) {
        let end = self.world.now() + Duration::from_millis(1);
        while self.world.now() < end {
            let frames = &mut self.frames;
            self.world.advance_with(POLL, |passed: &Transmission| frames.take(passed));
            let Some(tick) = self.robot.due() else { continue };
            if let Err(why) = self.robot.cycle(tick, self.pilot) {
                self.note(format_args!("not armed: {why}"));
            }
            while let Some(edge) = self.robot.next_edge() {
                self.note_at(
                    edge.at,
                    format_args!("{}: {} {}", edge.source, edge.condition, phase(edge.began)),
                );
            }
            while let Some((at, text)) = self.robot.next_bus_edge() {
                self.note_at(at, format_args!("{text}"));
            }
        }
    }

    /// Schedules what goes wrong within the next window.
    fn schedule(&mut self) {
        let now = self.world.now();
        let window = now..now + Duration::from_millis(WINDOW_MS);
        let line = Line::Can1;
        let active = self.troubles;
        let begun = Trouble::ALL.iter().zip(active).filter(|(_, is_active)| *is_active);
        let mut faults: Vec<Fault> =
            begun.filter_map(|((_, trouble), _)| self.fault(*trouble, line)).collect();
        if self.loss > 0.0 {
            faults.push(Fault::LostFrames { line, id: None, probability: self.loss });
        }
        for fault in faults {
            // Sixteen at a time have room, and these are six that last as long as their window.
            if let Err(why) = self.world.fault(fault, window.clone()) {
                self.note(format_args!("no fault: {why}"));
            }
        }
    }

    fn fault(&self, trouble: Trouble, line: Line) -> Option<Fault> {
        let first = self.keys.first().copied()?;
        Some(match trouble {
            Trouble::Plug => Fault::Unplugged(line),
            Trouble::Silence => Fault::Silent(first),
            Trouble::BusOff => Fault::BusOff(line),
            Trouble::Block => Fault::BlockedShaft(first),
            Trouble::SecondMaster => {
                // 819 of 16384 is 1 A of 20 A.
                let frame = CanFrame::standard(0x200, [3, 0x33, 3, 0x33, 3, 0x33, 3, 0x33])?;
                Fault::Flood { line, frame, period: Duration::from_millis(1) }
            }
        })
    }

    /// Returns the time since the start in ms.
    pub fn millis(&self) -> u64 {
        self.world.now().as_micros() / 1_000
    }

    /// Tells whether the robot is armed.
    pub fn is_armed(&self) -> bool {
        self.robot.is_armed()
    }

    /// Returns the FNV-1a hash of all frames on the bus so far: time, id, length and data.
    pub const fn hash(&self) -> u64 {
        self.frames.hash()
    }

    /// Returns the numbers of a picture: see `snapshot::numbers`.
    pub fn numbers(&self) -> Vec<f32> {
        snapshot::numbers(self.world, &*self.robot, self.pilot.is_switch_on)
    }

    /// Returns the last frames on the bus, decoded, a line each.
    pub fn frames(&self) -> String {
        self.frames.text()
    }

    /// Takes the lines that were logged since the last call.
    pub fn take_log(&mut self) -> String {
        std::mem::take(&mut self.log)
    }

    /// Returns what was done so far, as a script that [`tour`](crate::tour) reads.
    pub fn script(&self) -> String {
        let Setup { seed, layout, mass_kg, kp, ki, watchdogs } = self.setup;
        format!(
            "start {seed} {} {mass_kg} {kp} {ki} {}\n{}{} end\n",
            layout.word(),
            watchdogs.word(),
            self.script,
            self.millis()
        )
    }

    fn write_down(&mut self, word: Option<&str>, value: f32) {
        let millis = self.millis();
        _ = writeln!(self.script, "{millis} {} {value}", word.unwrap_or_default());
    }

    fn note(&mut self, text: std::fmt::Arguments<'_>) {
        self.note_at(self.world.now(), text);
    }

    fn note_at(&mut self, at: Instant, text: std::fmt::Arguments<'_>) {
        if self.log.len() < LOG_BYTES {
            _ = writeln!(self.log, "{:.3} s  {text}", at.since(Instant::START).as_secs_f32());
        } else if !self.log.ends_with("...\n") {
            self.log.push_str("...\n");
        }
    }
}

const fn phase(began: bool) -> &'static str {
    if began { "began" } else { "ended" }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn driving(watchdogs: Watchdogs) -> Session {
        let setup =
            Setup { seed: 1, layout: Layout::Mecanum, mass_kg: 20.0, kp: 4.0, ki: 24.0, watchdogs };
        let mut session = Session::new(setup).unwrap();
        session.advance(20);
        session.set(Knob::Switch, 1.0);
        session.advance(20);
        session.set(Knob::Ahead, 1.0);
        session.advance(1_500);
        assert!(session.is_armed() && speed(&mut session) > 0.95);
        session
    }

    /// Of the robot, in m/s.
    fn speed(session: &mut Session) -> f32 {
        let x = |session: &Session| session.numbers().get(1).copied().unwrap();
        let before = x(session);
        session.advance(100);
        (x(session) - before) / 0.1
    }

    #[test]
    fn without_a_plug_only_motors_with_a_watchdog_let_the_robot_stop() {
        for (watchdogs, stops) in [(Watchdogs::Both, true), (Watchdogs::Program, false)] {
            let mut session = driving(watchdogs);
            session.trouble(Trouble::Plug, true);
            session.set(Knob::Ahead, 0.0);
            session.advance(5_000);
            let speed = speed(&mut session);
            assert_eq!(speed < 0.01, stops, "{watchdogs:?}: {speed} m/s");
        }
    }

    #[test]
    fn with_its_plug_back_the_robot_stops_and_waits_for_the_switch() {
        for (_, watchdogs) in Watchdogs::ALL {
            let mut session = driving(watchdogs);
            session.trouble(Trouble::Plug, true);
            session.advance(500);
            session.trouble(Trouble::Plug, false);
            session.advance(6_000);
            assert!(!session.is_armed() && speed(&mut session) < 0.01, "{watchdogs:?}");
        }
    }

    #[test]
    fn the_script_of_a_run_gives_its_frames() {
        let mut session = driving(Watchdogs::Both);
        session.trouble(Trouble::Silence, true);
        session.advance(300);
        let again = crate::tour::run(&session.script()).unwrap();
        assert_eq!((again.hash(), again.millis()), (session.hash(), session.millis()));
        assert!(crate::tour::run("start 7 mecanum 20 4 24 some\n").is_err());
    }
}
