//! Gives the frames of a log to the motors, as a robot would, and keeps account of each.

use drivetrain::motor::Ingest;
use drivetrain::time::{Duration, Instant};
use drivetrain::wire::candump::Record;

use super::motor::{Listener, Reading};
use super::options::Options;

/// What one motor did.
#[derive(Debug)]
pub(crate) struct Account {
    pub(crate) motor: Box<dyn Listener>,
    pub(crate) frames: u64,
    pub(crate) malformed: u64,
    pub(crate) first: Option<(Instant, Reading)>,
    pub(crate) latest: Option<(Instant, Reading)>,
    /// The first turns that were told.
    start: Option<f64>,
    pub(crate) gaps: u64,
    pub(crate) longest_silence: Duration,
}

impl Account {
    /// Returns how far the output shaft turned since the first frame that tells its turns.
    pub(crate) fn turns(&self) -> Option<f64> {
        Some(self.latest.as_ref()?.1.turns? - self.start?)
    }

    /// Returns frames per second, when the log has times.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let span_us = self.latest.as_ref()?.0.since(self.first.as_ref()?.0).as_micros();
        let intervals = self.frames.checked_sub(1).filter(|count| *count > 0)?;
        (span_us > 0).then(|| intervals as f64 * 1e6 / span_us as f64)
    }
}

/// The motors of one bus, and everything else that was seen.
#[derive(Debug)]
pub(crate) struct Replay {
    gap: Duration,
    pub(crate) interface: Option<String>,
    pub(crate) accounts: Vec<Account>,
    pub(crate) unrelated: u64,
    pub(crate) other_interfaces: u64,
    pub(crate) has_times: bool,
}

impl Replay {
    pub(crate) fn new(options: Options) -> Self {
        Self {
            gap: options.gap,
            interface: options.interface,
            accounts: options.motors.into_iter().map(Account::new).collect(),
            unrelated: 0,
            other_interfaces: 0,
            has_times: false,
        }
    }

    /// Takes a frame; returns the account of the motor that sent it, when it is feedback.
    pub(crate) fn take(&mut self, record: &Record<'_>) -> Option<&Account> {
        let interface = self.interface.get_or_insert_with(|| record.interface.to_owned());
        if interface != record.interface {
            self.other_interfaces += 1;
            return None;
        }
        let gap = self.gap;
        let mut accounts = self.accounts.iter_mut();
        let taken = accounts.find_map(|account| Some((account.take(record, gap)?, &*account)));
        let Some((is_feedback, account)) = taken else {
            self.unrelated += 1;
            return None;
        };
        self.has_times |= record.time.is_some();
        is_feedback.then_some(account)
    }
}

impl Account {
    fn new(motor: Box<dyn Listener>) -> Self {
        Self {
            motor,
            frames: 0,
            malformed: 0,
            first: None,
            latest: None,
            start: None,
            gaps: 0,
            longest_silence: Duration::ZERO,
        }
    }

    /// Takes a frame; returns whether it is feedback, `None` if it is not this motor's.
    fn take(&mut self, record: &Record<'_>, gap: Duration) -> Option<bool> {
        // Without times, the motors are taken to send at their usual 1 kHz.
        let now = record.time.unwrap_or(Instant::from_micros(1_000 * self.frames));
        match self.motor.take(&record.frame, now) {
            Ingest::Taken => {
                self.note(now, gap);
                Some(true)
            }
            Ingest::WrongLength(_) | Ingest::WrongField => {
                self.malformed += 1;
                Some(false)
            }
            Ingest::Unrelated => None,
        }
    }

    fn note(&mut self, now: Instant, gap: Duration) {
        if let Some((before, _)) = &self.latest {
            let silence = now.since(*before);
            self.gaps += u64::from(silence > gap);
            self.longest_silence = self.longest_silence.max(silence);
        }
        self.frames += 1;
        self.latest = self.motor.reading().map(|reading| (now, reading));
        if self.first.is_none() {
            self.first.clone_from(&self.latest);
        }
        self.start = self.start.or(self.latest.as_ref().and_then(|(_, reading)| reading.turns));
    }
}
