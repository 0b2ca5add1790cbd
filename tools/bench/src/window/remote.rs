//! The window as the pilot of the session.

use super::Shared;
use super::view::{LINES, Strip, View};
use crate::commands::{limits, plan};
use crate::link::Link;
use crate::options::Options;
use crate::program::Program;
use crate::record::Recorder;
use crate::session::{Pilot, Session, Stage};
use crate::snapshot;
use drivetrain::time::{Duration, Instant};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread::JoinHandle;

/// A window that says nothing for so long, of the machine's time, is taken for lost.
const SILENCE: std::time::Duration = std::time::Duration::from_secs(2);

/// The time between two points of a strip, and between two pictures.
const PICTURE: Duration = Duration::from_millis(50);

/// Motors that are not armed by then are not there.
const ARMING: Duration = Duration::from_secs(3);

/// What a key asks for. Speeds in rad/s.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Action {
    Alive,
    Arm,
    Stop,
    Quit,
    /// A change of the speed.
    Jog(usize, f32),
    Still(usize),
    Sine(usize, f32),
    Steps(usize, f32),
    Gains(usize, (f32, f32, f32)),
    Tune(usize),
    Identify(usize),
    Record,
    /// A recording begins again.
    Rewind,
    /// A fault of the simulator: a motor falls silent.
    Silence(usize),
    /// A simulator that stands moves on, in ms.
    Advance(u64),
}

/// Leads the session by what the window sends.
#[derive(Debug)]
pub(crate) struct Remote {
    actions: Receiver<Action>,
    shared: Shared,
    heard: std::time::Instant,
    strips: Vec<Strip>,
    log: VecDeque<String>,
    results: Vec<String>,
    last_messages: Vec<String>,
    /// Recordings that are being ended, and what goes wrong with them.
    endings: Vec<JoinHandle<Vec<String>>>,
    pictured: Option<Instant>,
    options: Options,
    was_held: bool,
    was_over: bool,
}

impl Remote {
    pub(crate) fn new(
        session: &Session,
        actions: Receiver<Action>,
        shared: Shared,
        options: &Options,
    ) -> Self {
        Self {
            actions,
            shared,
            heard: std::time::Instant::now(),
            strips: vec![Strip::default(); session.robot().len()],
            log: VecDeque::new(),
            results: Vec::new(),
            last_messages: Vec::new(),
            endings: Vec::new(),
            pictured: None,
            options: options.clone(),
            was_held: false,
            was_over: false,
        }
    }

    /// The texts for the user when the window is gone: results of tuning, and failures, the messages since the end began included.
    /// Waits for the disk.
    pub(crate) fn results(self) -> (Vec<String>, Vec<String>) {
        let Self { results, mut last_messages, endings, .. } = self;
        last_messages.extend(endings.into_iter().filter_map(|ending| ending.join().ok()).flatten());
        (results, last_messages)
    }

    fn act(&mut self, session: &mut Session, action: Action) {
        match action {
            Action::Alive | Action::Quit => {}
            Action::Arm => session.arm(Some(ARMING)),
            Action::Stop => session.stop(),
            // A program that waits for the arming would move the motor with it.
            Action::Jog(..)
            | Action::Sine(..)
            | Action::Steps(..)
            | Action::Tune(_)
            | Action::Identify(_)
                if session.stage() != Stage::Armed =>
            {
                self.say(session, "arm first: Shift-A".into());
            }
            Action::Jog(motor, by) => {
                let top = session.robot().top_speed(motor);
                let program =
                    session.program(motor).map_or(Program::Still, |now| now.jogged(by, top));
                session.start_program(motor, program);
            }
            Action::Still(motor) => session.start_program(motor, Program::Still),
            Action::Sine(motor, amplitude) => {
                session.start_program(
                    motor,
                    Program::Sine { amplitude, period_s: 2.0, passed_s: 0.0 },
                );
            }
            Action::Steps(motor, height) => {
                session.start_program(motor, Program::Steps { height, half_s: 1.0, passed_s: 0.0 });
            }
            Action::Gains(motor, gains) => {
                let set = session.robot_mut().set_gains(motor, gains);
                let (kp, ki, kd) = gains;
                self.say(
                    session,
                    set.map_or_else(|error| error, |()| format!("gains: kp {kp} ki {ki} kd {kd}")),
                );
            }
            Action::Tune(motor) => {
                let plan = plan(session, motor, &self.options);
                let begun = session.start_tuning(motor, plan);
                self.say_refusal(session, begun);
            }
            Action::Identify(motor) => {
                let limits = limits(session, motor, &self.options);
                let begun = session.start_identifying(motor, limits);
                self.say_refusal(session, begun);
            }
            Action::Record => self.record(session),
            Action::Rewind => match &mut session.tap().link {
                Link::Replay(replay) => replay.rewind(),
                _ => self.say(session, "only a recording plays again: --replay FILE".into()),
            },
            Action::Silence(motor) => match &mut session.tap().link {
                Link::Simulated(simulated) => simulated.silence(motor, Duration::from_secs(1)),
                _ => self
                    .say(session, "only the simulator has faults by a key: pull the plug".into()),
            },
            Action::Advance(ms) => session.pace().allow(Duration::from_millis(ms)),
        }
    }

    /// Begins a recording in both forms under the next free name, or ends it.
    fn record(&mut self, session: &mut Session) {
        if !session.tap().recorders.is_empty() {
            self.end_recording(session);
            return self.say(session, "recording ended".into());
        }
        let free = (1..)
            .find(|number| !Path::new(&format!("session-{number}.mcap")).exists())
            .unwrap_or(1);
        for kind in ["mcap", "log"] {
            let path = format!("session-{free}.{kind}");
            match Recorder::create("record", &path) {
                Ok(recorder) => {
                    session.tap().recorders.push(recorder);
                    self.say(session, format!("records to {path}"));
                }
                Err(error) => self.say(session, error),
            }
        }
    }

    fn end_recording(&mut self, session: &mut Session) {
        let recorders = std::mem::take(&mut session.tap().recorders);
        // A disk that hangs holds up no motor.
        self.endings.push(std::thread::spawn(move || {
            let ends = recorders.into_iter().map(|recorder| recorder.finish(|_| {}));
            ends.filter_map(Result::err).collect()
        }));
    }

    /// Ends a recording that has no room, and says which recordings are not whole.
    fn watch_recording(&mut self, session: &mut Session) {
        if session.tap().recorders.iter().any(Recorder::is_broken) {
            self.end_recording(session);
        }
        let endings = std::mem::take(&mut self.endings).into_iter();
        let (ended, endings): (Vec<_>, Vec<_>) = endings.partition(JoinHandle::is_finished);
        self.endings = endings;
        for failure in ended.into_iter().filter_map(|ending| ending.join().ok()).flatten() {
            self.say(session, format!("the recording is cut: {failure}"));
            self.last_messages.push(failure);
        }
    }

    fn say(&mut self, session: &Session, text: String) {
        let seconds = session.elapsed().as_secs_f32();
        for line in text.lines() {
            self.log.push_back(format!("{seconds:8.2} s  {line}"));
        }
        while self.log.len() > LINES {
            self.log.pop_front();
        }
    }

    fn say_refusal(&mut self, session: &Session, outcome: Result<(), String>) {
        if let Err(error) = outcome {
            self.say(session, error);
        }
    }

    /// Takes what the session said.
    fn listen(&mut self, session: &mut Session) {
        for (_, edge) in session.edges() {
            self.say(session, edge);
        }
        for message in session.messages() {
            self.say(session, message);
        }
        for outcome in session.outcomes() {
            match outcome {
                Ok(outcome) => {
                    outcome.lines().into_iter().for_each(|line| self.say(session, line));
                    self.say(session, outcome.rust());
                    self.results.push(format!("{}\n{}", outcome.rust(), outcome.toml()));
                }
                Err(error) => self.say(session, format!("not measured: {error}")),
            }
        }
    }

    fn picture(&mut self, session: &mut Session) {
        let snapshot = snapshot::of(session);
        let seconds = f64::from(snapshot.seconds);
        let now = session.pace().time().read();
        for (motor, strip) in snapshot.motors.iter().zip(&mut self.strips) {
            strip.push(seconds, motor.rpm.into(), motor.target_rpm.map(f64::from));
            let topic = format!("/motor/{}", motor.name);
            for recorder in &mut session.tap().recorders {
                recorder.values(now, &topic, &motor.json());
            }
        }
        let (strips, log) = (self.strips.clone(), self.log.clone());
        let view = View { snapshot, strips, log, is_held: self.options.held };
        if let Ok(mut shared) = self.shared.lock() {
            *shared = Some(view);
        }
    }
}

impl Pilot for Remote {
    fn goes_on(&mut self, session: &mut Session) -> bool {
        loop {
            match self.actions.try_recv() {
                Ok(action) => {
                    self.heard = std::time::Instant::now();
                    let is_alive = action == Action::Alive;
                    self.act(session, action);
                    self.was_held &= is_alive;
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
        if self.heard.elapsed() > SILENCE && session.stage() != Stage::Listening {
            self.heard = std::time::Instant::now();
            self.say(session, "the window does not answer: all stop".into());
            session.stop();
        }
        // A simulator that stands is pictured once more where it stands, with all that was said.
        let is_held = session.pace().is_held();
        if is_held && !std::mem::replace(&mut self.was_held, true) {
            self.listen(session);
            self.picture(session);
        }
        self.was_held &= is_held;
        true
    }

    fn ticked(&mut self, session: &mut Session) -> bool {
        self.listen(session);
        let now = session.pace().time().read();
        if self.pictured.is_none_or(|at| now.since(at) >= PICTURE) {
            self.pictured = Some(now);
            self.watch_recording(session);
            let is_over = matches!(&session.tap().link, Link::Replay(replay) if replay.is_over());
            if is_over && !self.was_over {
                let text =
                    "the recording is over: p plays it again, b lists the ids of all that is in it";
                self.say(session, text.into());
            }
            self.was_over = is_over;
            self.picture(session);
        }
        true
    }

    fn take_messages(&mut self, session: &mut Session) {
        let messages = session.messages();
        self.last_messages.extend_from_slice(&messages);
        for message in messages {
            self.say(session, message);
        }
        self.picture(session);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::end::End;
    use crate::link::Simulated;
    use crate::motors;
    use crate::options::usual;
    use crate::pace::Pace;
    use crate::robot::{Robot, Target};
    use crate::time::Time;
    use std::sync::mpsc;

    /// Leads by actions that stand at their ticks; keeps the target of the first motor.
    struct Script(Remote, u64, Vec<(u64, Action)>, Vec<Option<Target>>);

    impl Pilot for Script {
        fn goes_on(&mut self, session: &mut Session) -> bool {
            self.0.goes_on(session)
        }

        fn ticked(&mut self, session: &mut Session) -> bool {
            self.1 += 1;
            for (_, action) in self.2.iter().filter(|(at, _)| *at == self.1) {
                self.0.act(session, action.clone());
            }
            self.3.push(session.target(0));
            self.0.ticked(session) && self.1 < 2_000
        }

        fn take_messages(&mut self, session: &mut Session) {
            self.0.take_messages(session);
        }
    }

    /// The targets in rad/s at each tick, and the log.
    fn run(script: Vec<(u64, Action)>) -> (Vec<Option<f32>>, String) {
        let (mut session, remote, _sender) = begun(Vec::new());
        let mut script = Script(remote, 0, script, Vec::new());
        session.run(&End::none(), &mut script);
        let targets = script.3.into_iter().map(|target| match target? {
            Target::Velocity(rad_per_s) => Some(rad_per_s),
            Target::Effort(_) => None,
        });
        (targets.collect(), Vec::from(script.0.log).join("\n"))
    }

    fn begun(recorders: Vec<Recorder>) -> (Session, Remote, mpsc::Sender<Action>) {
        let specs = motors::parse("m3508:1").unwrap();
        let link = Link::Simulated(Simulated::new(&specs, 1).unwrap());
        let robot = Robot::new(&specs, false).unwrap();
        let session = Session::new(robot, link, Pace::Fast(Time::manual()), recorders);
        let (sender, actions) = mpsc::channel();
        let remote = Remote::new(&session, actions, Shared::default(), &usual());
        (session, remote, sender)
    }

    // "recording ended" was said, and the files were cut.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_recording_on_a_full_disk_is_said_and_is_a_failure_at_the_end() {
        for is_ended_by_hand in [false, true] {
            let recorder = Recorder::create("record", "/dev/full").unwrap();
            let (mut session, mut remote, _sender) = begun(vec![recorder]);
            while !is_ended_by_hand && !session.tap().recorders[0].is_broken() {
                session.tap().recorders[0].frame(Instant::START, "can0", "201#", false);
            }
            session.tap().recorders[0].frame(Instant::START, "can0", "201#", false);
            if is_ended_by_hand {
                remote.act(&mut session, Action::Record);
            }
            while remote.last_messages.is_empty() {
                remote.watch_recording(&mut session);
            }
            assert!(session.tap().recorders.is_empty());
            let (log, (_, failures)) = (Vec::from(remote.log.clone()).join("\n"), remote.results());
            assert_eq!(failures.len(), 1, "{failures:?}");
            assert!(failures[0].starts_with("record /dev/full: "), "{failures:?}");
            assert!(log.contains(&format!("the recording is cut: {}", failures[0])), "{log}");
        }
    }

    // Each press added to the target of the last picture: of two within 50 ms one was lost.
    #[test]
    fn two_presses_between_two_pictures_both_count() {
        let jogs = [1_000, 1_001, 1_002].map(|at| (at, Action::Jog(0, 1.0)));
        let (targets, log) = run([(1, Action::Arm)].into_iter().chain(jogs).collect());
        assert_eq!(targets[998], Some(0.0), "{log}");
        assert_eq!(targets[1_010], Some(3.0), "{log}");
    }

    // Two seconds of a held key were 6000 rpm, and it took as many to come back from there.
    #[test]
    fn a_jog_ends_at_the_speed_without_load() {
        let up = (1_000..1_060).map(|at| (at, Action::Jog(0, 10.0)));
        let script =
            [(1, Action::Arm)].into_iter().chain(up).chain([(1_100, Action::Jog(0, -10.0))]);
        let (targets, log) = run(script.collect());
        // 482 rpm, as the data sheet has it.
        let top = 482.0 * std::f32::consts::TAU / 60.0;
        for (at, expected) in [(1_080, top), (1_110, top - 10.0)] {
            assert!(
                targets[at].is_some_and(|target| (target - expected).abs() < 1e-3),
                "{at}: {log}"
            );
        }
    }

    #[test]
    fn a_recording_plays_again_by_a_key() {
        let path = std::env::temp_dir().join(format!("bench-again-{}.log", std::process::id()));
        std::fs::write(&path, "(1.0) can0 201#0E160000FFFD2100\n(1.1) can0 201#0E160000FFFD2100\n")
            .unwrap();
        let (specs, time) = (motors::parse("m3508:1").unwrap(), Time::manual());
        let replay = crate::link::Replay::open(path.to_str().unwrap(), time.clone()).unwrap();
        let robot = Robot::new(&specs, false).unwrap();
        let mut session = Session::new(robot, Link::Replay(replay), Pace::Fast(time), Vec::new());
        let (_sender, actions) = mpsc::channel();
        let remote = Remote::new(&session, actions, Shared::default(), &usual());
        let mut script = Script(remote, 0, vec![(1_000, Action::Rewind)], Vec::new());
        session.run(&End::none(), &mut script);
        std::fs::remove_file(path).unwrap();
        assert!(session.counts().contains(&("taken", 4)), "{:?}", session.counts());
        let log = Vec::from(script.0.log).join("\n");
        assert_eq!(log.matches("the recording is over").count(), 2, "{log}");
    }

    #[test]
    fn a_jog_after_a_sine_begins_from_a_standstill_and_zero_stops_it() {
        let (targets, log) = run(vec![
            (1, Action::Arm),
            (500, Action::Sine(0, 6.0)),
            (1_000, Action::Jog(0, 1.0)),
            (1_500, Action::Still(0)),
        ]);
        assert!(targets[900].is_some_and(|target| target > 5.0), "{log}");
        assert_eq!((targets[1_010], targets[1_510]), (Some(1.0), Some(0.0)), "{log}");
    }

    #[test]
    fn nothing_that_is_pressed_before_the_arming_moves_the_motor_with_it() {
        let (targets, log) = run(vec![
            (1, Action::Jog(0, 1.0)),
            (2, Action::Sine(0, 1.0)),
            (3, Action::Steps(0, 1.0)),
            (100, Action::Arm),
        ]);
        assert!(targets.iter().all(|target| matches!(target, None | Some(0.0))), "{targets:?}");
        assert_eq!(log.matches("arm first: Shift-A").count(), 3, "{log}");
    }
}
