//! The session: the motors as a device, the link, and the recorders of both. The window and every command use a session.
//!
//! ```text
//! link ──> tap (count, record, ledger) ──> runner ──> robot ──> programs set targets
//! link <── tap <────────────────────────── runner <── robot
//! ```

mod counts;
mod measure;
mod rest;

use crate::end::End;
use crate::ledger::Ledger;
use crate::link::Link;
use crate::outcome::Outcome;
use crate::pace::Pace;
use crate::program::{Asks, Program};
use crate::record::Recorder;
use crate::robot::{Robot, Target};
use crate::tap::Tap;
use crate::time::Time;
use crate::traffic::Traffic;
use drivetrain::motor::{ArmError, Condition, Devices};
use drivetrain::runner::{BusCondition, Nb, Runner};
use drivetrain::time::{Duration, Instant, Tick, Ticker};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// After a trip, a request counts only when nobody asked for 100 ms.
const BETWEEN_REQUESTS: Duration = Duration::from_millis(150);

/// How far a session is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Stage {
    /// Nothing is sent.
    Listening,
    /// Rest is sent, and drives are asked for their settings.
    Talking,
    /// Rest is sent, drives are asked for their settings, and the motors are to be armed.
    Asking {
        since: Instant,
        asked: Option<Instant>,
        limit: Option<Duration>,
    },
    Armed,
    /// Zeros are sent until they are seen.
    Resting {
        good: u32,
        bad: u32,
        begun: std::time::Instant,
    },
}

/// The session.
#[derive(Debug)]
pub(crate) struct Session {
    runner: Runner<Nb<Tap>, Time, Robot>,
    pace: Pace,
    stage: Stage,
    /// The steps in which nothing is sent.
    listening: Ticker,
    programs: Vec<Program>,
    targets: Vec<Option<Target>>,
    start: Instant,
    armed_once: bool,
    has_sent: bool,
    /// Nothing was sent for a while: the steps in that time are not missing.
    has_paused: bool,
    has_tripped: bool,
    has_failed: bool,
    /// Why it is not armed yet.
    refusal: Option<ArmError>,
    edges: Vec<(Instant, String)>,
    messages: Vec<String>,
    outcomes: Vec<Result<Outcome, String>>,
}

/// Who leads a session.
pub(crate) trait Pilot {
    /// Looked at before each cycle: `false` ends the session.
    fn goes_on(&mut self, session: &mut Session) -> bool;

    /// After each tick: `false` ends the session.
    fn ticked(&mut self, session: &mut Session) -> bool;

    /// Passes on the messages of the session: in [`ticked`](Self::ticked), and while the motors are brought to rest at the end.
    fn take_messages(&mut self, session: &mut Session);
}

impl Session {
    pub(crate) fn new(mut robot: Robot, link: Link, pace: Pace, recorders: Vec<Recorder>) -> Self {
        let ledger = Ledger::new(robot.claims(), link.echoes());
        let traffic = Traffic::new(robot.claims());
        let (time, count) = (pace.time(), robot.len());
        let start = time.read();
        let (is_driving, confirmed) = (false, 0);
        let tap =
            Tap { link, ledger, traffic, recorders, time: time.clone(), is_driving, confirmed };
        Self {
            runner: Runner::new(Nb(tap), time, robot),
            pace,
            stage: Stage::Listening,
            listening: Ticker::new(Duration::from_millis(1)),
            programs: (0..count).map(|_| Program::Still).collect(),
            targets: vec![None; count],
            start,
            armed_once: false,
            has_sent: false,
            has_paused: false,
            has_tripped: false,
            has_failed: false,
            refusal: None,
            edges: Vec::new(),
            messages: Vec::new(),
            outcomes: Vec::new(),
        }
    }

    pub(crate) fn robot(&self) -> &Robot {
        self.runner.device()
    }

    pub(crate) fn robot_mut(&mut self) -> &mut Robot {
        self.runner.device_mut()
    }

    pub(crate) fn tap(&mut self) -> &mut Tap {
        &mut self.runner.port_mut().0
    }

    pub(crate) fn pace(&mut self) -> &mut Pace {
        &mut self.pace
    }

    pub(crate) fn stage(&self) -> Stage {
        self.stage
    }

    pub(crate) fn refusal(&self) -> Option<ArmError> {
        self.refusal
    }

    pub(crate) fn has_failed(&self) -> bool {
        self.has_failed
    }

    /// The time since the session began.
    pub(crate) fn elapsed(&self) -> Duration {
        self.pace.time().read().since(self.start)
    }

    pub(crate) fn program(&self, motor: usize) -> Option<&Program> {
        self.programs.get(motor)
    }

    pub(crate) fn target(&self, motor: usize) -> Option<Target> {
        self.targets.get(motor).copied().flatten()
    }

    pub(crate) fn start_program(&mut self, motor: usize, program: Program) {
        if let Some(place) = self.programs.get_mut(motor) {
            *place = program;
        }
    }

    /// Takes what was said since the last call.
    pub(crate) fn messages(&mut self) -> Vec<String> {
        std::mem::take(&mut self.messages)
    }

    /// Takes the edges since the last call.
    pub(crate) fn edges(&mut self) -> Vec<(Instant, String)> {
        std::mem::take(&mut self.edges)
    }

    /// Takes the results of tuning and identification.
    pub(crate) fn outcomes(&mut self) -> Vec<Result<Outcome, String>> {
        std::mem::take(&mut self.outcomes)
    }

    /// Asks that the motors are armed, for so long if there is a limit. From now on frames are sent.
    pub(crate) fn arm(&mut self, limit: Option<Duration>) {
        if !self.tap().link.sends() {
            self.messages.push("a recording has no motors to arm".into());
        } else if self.stage == Stage::Listening {
            self.has_paused = self.has_sent;
            self.stage = Stage::Asking { since: self.pace.time().read(), asked: None, limit };
        }
    }

    /// Sends rest and questions, and arms nothing.
    pub(crate) fn talk(&mut self) {
        if self.tap().link.sends() && self.stage == Stage::Listening {
            self.stage = Stage::Talking;
        }
    }

    /// Stops everything: zeros at once, and until they are seen.
    pub(crate) fn stop(&mut self) {
        self.programs.fill_with(Program::default);
        self.targets.fill(None);
        match self.stage {
            Stage::Listening | Stage::Resting { .. } => {}
            Stage::Talking | Stage::Asking { .. } | Stage::Armed => {
                self.runner.device_mut().disarm();
                self.tap().is_driving = false;
                let begun = std::time::Instant::now();
                self.stage = Stage::Resting { good: 0, bad: 0, begun };
            }
        }
    }

    /// Runs until a signal or the pilot ends it, or a motor is lost, and ends with zeros: also if the pilot panics. A signal
    /// cannot end the program until the caller says so, when the recordings are whole.
    pub(crate) fn run(&mut self, end: &End, pilot: &mut impl Pilot) {
        end.is_safe(false);
        let flight = catch_unwind(AssertUnwindSafe(|| {
            // A pilot that waited for its step may find that a signal came meanwhile.
            while !end.is_asked_for() && pilot.goes_on(self) && !end.is_asked_for() {
                if self.cycle(end) && !pilot.ticked(self) {
                    break;
                }
            }
        }));
        if flight.is_err() {
            self.fail("a defect of this program; all stop".into());
        }
        self.stop();
        self.pace.release();
        while matches!(self.stage, Stage::Resting { .. }) {
            if self.cycle(end) {
                // Said at once, for somebody may have to cut the battery; a defect of the pilot holds up no zeros.
                _ = catch_unwind(AssertUnwindSafe(|| pilot.take_messages(self)));
            }
        }
    }

    /// Waits a little, takes what came, and runs a tick if one is due.
    fn cycle(&mut self, end: &End) -> bool {
        let link = &mut self.runner.port_mut().0.link;
        if !self.pace.pause(link) {
            return false;
        }
        self.has_sent |= self.stage != Stage::Listening;
        while self.runner.poll(64) == 64 {}
        // A step of the runner stays due until it was run, and where nothing is sent none is.
        let due = match self.stage {
            Stage::Listening => self.listening.due(self.pace.time().read()),
            _ => self.runner.due(),
        };
        let Some(tick) = due else { return false };
        match self.stage {
            Stage::Listening => self.listen(tick),
            Stage::Talking => {
                self.runner.tick(tick);
                self.take_edges(tick.now());
            }
            Stage::Asking { since, asked, limit } => self.ask(tick, since, asked, limit),
            Stage::Armed => self.drive(tick),
            Stage::Resting { good, bad, begun } => self.rest(tick, end, good, bad, begun),
        }
        self.runner.port_mut().0.traffic.turn(tick.now());
        true
    }

    /// Keeps the state up to date and sends nothing.
    fn listen(&mut self, tick: Tick) {
        self.runner.device_mut().update(tick);
        let mut unsent = Vec::new();
        while let Some(frame) = self.runner.device_mut().next_frame(0) {
            unsent.push(frame);
        }
        for frame in unsent {
            self.runner.device_mut().requeue(&frame);
        }
        self.take_edges(tick.now());
    }

    fn ask(&mut self, tick: Tick, since: Instant, asked: Option<Instant>, limit: Option<Duration>) {
        let now = tick.now();
        let is_time = asked.is_none_or(|at| now.since(at) >= BETWEEN_REQUESTS);
        if is_time || !self.has_tripped {
            self.refusal = self.runner.arm(tick).err();
            let asked = Some(now);
            self.stage = match self.refusal {
                None => Stage::Armed,
                Some(_) => Stage::Asking { since, asked, limit },
            };
        }
        if self.stage == Stage::Armed {
            self.armed_once = true;
            return self.drive(tick);
        }
        self.runner.tick(tick);
        self.take_edges(now);
        if limit.is_some_and(|limit| now.since(since) >= limit) {
            let why = self.refusal.map(|refusal| refusal.to_string()).unwrap_or_default();
            self.messages.push(format!("not armed: {why}"));
            self.stop();
        }
    }

    /// A lost motor stays relaxed, and stops all motors.
    fn drive(&mut self, tick: Tick) {
        self.run_programs(tick.dt_s());
        self.tap().is_driving = true;
        self.runner.tick(tick);
        let changes = self.take_edges(tick.now());
        if !self.runner.is_armed() {
            self.has_tripped = true;
            self.fail(format!("all stop: {}", changes.join(", ")));
            self.stop();
        }
    }

    fn run_programs(&mut self, dt_s: f32) {
        for (motor, program) in self.programs.iter_mut().enumerate() {
            let robot = self.runner.device_mut();
            let speed = robot.reading(motor).map_or(0.0, |reading| reading.rad_per_s);
            let effort = robot.holding_effort(motor);
            match program.step(speed, effort, dt_s) {
                Asks::Target(target) => {
                    _ = robot.set(motor, target, dt_s);
                    if let Some(place) = self.targets.get_mut(motor) {
                        *place = Some(target);
                    }
                }
                Asks::Gains(gains) => {
                    if let Err(error) = robot.set_gains(motor, gains) {
                        self.outcomes.push(Err(error));
                        *program = Program::Still;
                    }
                }
                Asks::Done(outcome) => self.outcomes.push(outcome),
            }
        }
    }

    /// Takes the edges of motors and runner, and returns their texts.
    fn take_edges(&mut self, now: Instant) -> Vec<String> {
        let mut changes = Vec::new();
        while let Some(edge) = self.runner.device_mut().next_edge() {
            let motor = self.robot().names().position(|name| name == edge.source);
            if is_silence(edge.condition) && motor.is_some_and(|motor| self.is_unasked(motor)) {
                continue;
            }
            let text = without_time(&edge);
            if edge.began && edge.condition == Condition::SecondMaster {
                self.messages.push(format!("{text}: another program or board commands it too"));
            }
            changes.push(text);
        }
        while let Some(edge) = self.runner.next_edge() {
            if self.has_paused && edge.condition == BusCondition::TickOverrun {
                self.has_paused = edge.began;
                continue;
            }
            changes.push(without_time(&edge));
        }
        self.edges.extend(changes.iter().map(|text| (now, text.clone())));
        changes
    }

    /// Tells whether a motor reports when it is asked only, and is not armed: its silence means nothing.
    fn is_unasked(&self, motor: usize) -> bool {
        !matches!(self.stage, Stage::Armed | Stage::Resting { .. })
            && self.robot().answers_only(motor)
    }

    /// Tells whether a motor is silent because nobody asks it.
    pub(crate) fn is_idle(&self, motor: usize) -> bool {
        let is_heard = self.robot().reading(motor).is_some_and(|reading| reading.is_heard());
        self.stage == Stage::Listening && self.robot().answers_only(motor) && !is_heard
    }

    fn fail(&mut self, text: String) {
        self.messages.push(text);
        self.has_failed = true;
    }

    /// Ends the recordings; returns what went wrong with them.
    pub(crate) fn finish(self, mut say: impl FnMut(String)) -> Vec<String> {
        let (Nb(tap), ..) = self.runner.into_parts();
        let ends = tap.recorders.into_iter().map(|recorder| recorder.finish(&mut say));
        ends.filter_map(Result::err).collect()
    }
}

/// Tells whether a condition says that a motor does not report.
pub(crate) fn is_silence(condition: Condition) -> bool {
    matches!(condition, Condition::Late | Condition::Offline)
}

/// An edge without the time on the clock of the device, beside which the session's time stands.
fn without_time(edge: &impl ToString) -> String {
    let text = edge.to_string();
    text.rsplit_once(" at ").map_or(text.clone(), |(text, _)| text.to_owned())
}

#[cfg(test)]
mod tests;
