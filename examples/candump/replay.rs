//! Gives the frames of a log to a bus, as a robot would, and keeps account of each motor.

use drivetrain::dji::{AnyHandle, AttachError, Bus, State};
use drivetrain::motor::{Ingest, MotorName};
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::candump::Record;
use embedded_can::{Frame, Id};

use super::options::{Motor, Options};

/// What one motor did.
#[derive(Debug)]
pub(crate) struct Account {
    pub(crate) name: MotorName,
    handle: AnyHandle,
    feedback_id: u16,
    pub(crate) frames: u64,
    pub(crate) malformed: u64,
    pub(crate) first: Option<(Instant, State)>,
    pub(crate) latest: Option<(Instant, State)>,
    pub(crate) gaps: u64,
    pub(crate) longest_silence: Duration,
}

impl Account {
    /// Returns how far the output shaft turned since the first frame.
    pub(crate) fn turns(&self) -> Option<f64> {
        Some(exact_turns(&self.latest?.1) - exact_turns(&self.first?.1))
    }

    /// Returns frames per second, when the log has times.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let span_us = self.latest?.0.since(self.first?.0).as_micros();
        let intervals = self.frames.checked_sub(1).filter(|count| *count > 0)?;
        (span_us > 0).then(|| intervals as f64 * 1e6 / span_us as f64)
    }
}

fn exact_turns(state: &State) -> f64 {
    state.position.turns() as f64 + f64::from(state.position.angle().as_turns())
}

/// The motors of one bus, and everything else that was seen.
#[derive(Debug)]
pub(crate) struct Replay {
    bus: Bus,
    gap: Duration,
    pub(crate) interface: Option<String>,
    pub(crate) accounts: Vec<Account>,
    pub(crate) unrelated: u64,
    pub(crate) other_interfaces: u64,
    pub(crate) has_times: bool,
}

impl Replay {
    pub(crate) fn new(options: &Options) -> Result<Self, AttachError> {
        let mut bus = Bus::new();
        let accounts: Result<_, _> =
            options.motors.iter().map(|motor| Account::new(motor, &mut bus)).collect();
        Ok(Self {
            bus,
            gap: options.gap,
            interface: options.interface.clone(),
            accounts: accounts?,
            unrelated: 0,
            other_interfaces: 0,
            has_times: false,
        })
    }

    /// Takes a frame; returns the motor that it came from, when it is feedback.
    pub(crate) fn take(&mut self, record: &Record<'_>) -> Option<(Instant, State)> {
        let interface = self.interface.get_or_insert_with(|| record.interface.to_owned());
        if interface != record.interface {
            self.other_interfaces += 1;
            return None;
        }
        let account = self.accounts.iter_mut().find(|account| account.owns(&record.frame));
        let Some(account) = account else {
            self.unrelated += 1;
            return None;
        };
        self.has_times |= record.time.is_some();
        // Without times, the motors are taken to send at their usual 1 kHz.
        let now = record.time.unwrap_or(Instant::from_micros(1_000 * account.frames));
        match self.bus.ingest(&record.frame, now) {
            Ingest::Taken => {}
            Ingest::Malformed(_) => {
                account.malformed += 1;
                return None;
            }
            _ => {
                self.unrelated += 1;
                return None;
            }
        }
        let state = self.bus.state(account.handle)?;
        account.note(now, state, self.gap);
        Some((now, state))
    }
}

impl Account {
    fn new(motor: &Motor, bus: &mut Bus) -> Result<Self, AttachError> {
        Ok(Self {
            name: MotorName::new(motor.facts.name, motor.id),
            handle: motor.attach(bus)?,
            feedback_id: motor.facts.feedback_base + u16::from(motor.id),
            frames: 0,
            malformed: 0,
            first: None,
            latest: None,
            gaps: 0,
            longest_silence: Duration::ZERO,
        })
    }

    fn owns(&self, frame: &impl Frame) -> bool {
        matches!(frame.id(), Id::Standard(id) if id.as_raw() == self.feedback_id)
    }

    fn note(&mut self, now: Instant, state: State, gap: Duration) {
        if let Some((before, _)) = self.latest {
            let silence = now.since(before);
            self.gaps += u64::from(silence > gap);
            self.longest_silence = self.longest_silence.max(silence);
        }
        self.frames += 1;
        self.first.get_or_insert((now, state));
        self.latest = Some((now, state));
    }
}
