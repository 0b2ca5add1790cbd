//! The commands without a window.

mod drive;
pub(crate) use drive::{limits, plan};
mod look;
mod setup;

use crate::end::End;
use crate::link::{Link, Replay, Simulated, Slcan};
use crate::options::{Command, Options, Source};
use crate::outlet::Outlet;
use crate::pace::Pace;
use crate::record::{self, Recorder};
use crate::robot::Robot;
use crate::session::{Pilot, Session};
use crate::time::Time;
use std::io::{self, BufRead, Write};
use std::process::ExitCode;

/// Texts that wait for a reader.
const ROOM: usize = 64;

/// A command, tick by tick: `false` ends it.
pub(crate) trait Task {
    /// Requests before the first tick.
    fn begin(&mut self, session: &mut Session) {
        _ = session;
    }

    fn ticked(&mut self, session: &mut Session, ticks: u64, out: &mut Out) -> bool;

    /// The last text.
    fn report(&mut self, session: &mut Session, out: &mut Out) -> String;

    /// Whether the end of the time is a failure.
    fn is_missed(&self) -> bool {
        false
    }

    /// What failed, for standard error.
    fn failures(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Standard output.
#[derive(Debug)]
pub(crate) struct Out {
    outlet: Outlet,
    is_open: bool,
    pub(crate) is_json: bool,
}

impl Out {
    pub(crate) fn say(&mut self, text: String) {
        self.is_open &= self.outlet.offer(text);
    }

    pub(crate) fn lost(&self) -> u32 {
        self.outlet.lost()
    }
}

/// Leads a session by a task.
struct Lead<'a, T> {
    task: T,
    seconds: Option<f32>,
    is_lock_step: bool,
    out: Out,
    errors: &'a mut Outlet,
    ticks: u64,
    is_late: bool,
}

impl<T: Task> Pilot for Lead<'_, T> {
    fn goes_on(&mut self, session: &mut Session) -> bool {
        if self.is_lock_step {
            return matches!(io::stdin().lock().skip_until(b'\n'), Ok(1..));
        }
        let is_over = matches!(&session.tap().link, Link::Replay(replay) if replay.is_over());
        self.is_late =
            self.seconds.is_some_and(|seconds| session.elapsed().as_secs_f32() >= seconds);
        !is_over && !self.is_late
    }

    fn ticked(&mut self, session: &mut Session) -> bool {
        self.ticks += 1;
        self.take_messages(session);
        let goes_on = !session.has_failed() && self.task.ticked(session, self.ticks, &mut self.out);
        if self.is_lock_step {
            self.out.say(".\n".into());
        }
        goes_on && self.out.is_open
    }

    fn take_messages(&mut self, session: &mut Session) {
        session.messages().into_iter().for_each(|text| say(self.errors, &text));
    }
}

fn say(errors: &mut Outlet, text: &str) {
    _ = errors.offer(format!("bench: {text}\n"));
}

/// Makes the session that the options ask for.
///
/// # Errors
/// Says which option cannot be met.
pub(crate) fn session(options: &Options, simulator: fn() -> Pace) -> Result<Session, String> {
    let robot = Robot::new(&options.motors, options.twist.is_some())?;
    let recorders = options.logs.iter().map(|(option, path)| Recorder::create(option, path));
    let recorders = recorders.collect::<Result<_, _>>()?;
    let real = || {
        if options.lock_step { Pace::LockStep(Time::manual()) } else { Pace::Real(Time::real()) }
    };
    let (link, pace) = match &options.source {
        Source::Simulator => {
            (Link::Simulated(Simulated::new(&options.motors, options.seed)?), simulator())
        }
        #[cfg(target_os = "linux")]
        Source::Interface(name) => (Link::Socket(crate::link::Socket::open(name)?), real()),
        #[cfg(not(target_os = "linux"))]
        Source::Interface(_) => return Err("SocketCAN is a part of Linux: try --serial".into()),
        Source::Serial(path) => (Link::Slcan(Slcan::open(path)?), real()),
        Source::Recording(path) => {
            let pace = simulator();
            (Link::Replay(Replay::open(path, pace.time())?), pace)
        }
    };
    Ok(Session::new(robot, link, pace, recorders))
}

/// Looks for arguments that make no sense, before anything is opened.
///
/// # Errors
/// Names the argument.
pub(crate) fn check(options: &Options) -> Result<(), String> {
    let mut robot = Robot::new(&options.motors, options.twist.is_some())?;
    match &options.command {
        Command::Tune | Command::Identify if !options.arm => {
            Err("the motors move: --arm says that they may".into())
        }
        Command::Identify if options.rpm.is_some_and(|rpm| rpm <= 0.0) => {
            Err("--rpm is the limit of identify: not above zero".into())
        }
        Command::Get(_) | Command::Set(..) | Command::SetId(_) => {
            setup::check(&mut robot, &options.command)
        }
        _ => drive::Spin::new(options).map(|_| ()),
    }
}

/// Runs a command to its end.
///
/// # Errors
/// Says which option cannot be met.
pub(crate) fn run(options: &Options, end: &End) -> Result<ExitCode, String> {
    let fast = || Pace::Fast(Time::manual());
    let seconds = options.seconds;
    if let (Command::Replay, Source::Recording(from), Some(to)) =
        (&options.command, &options.source, &options.output)
    {
        let progress = |text: &str| _ = writeln!(io::stderr(), "bench: {text}");
        let count = record::convert(from, to, progress)?;
        println(&format!("{count} frames to {to}"));
        return Ok(ExitCode::SUCCESS);
    }
    let session = session(options, fast)?;
    match &options.command {
        Command::Scan => {
            lead(session, options, end, look::Scan::new(options.asks), Some(seconds.unwrap_or(2.0)))
        }
        Command::Record | Command::Replay => {
            let seconds = if options.command == Command::Replay {
                None
            } else {
                Some(seconds.unwrap_or(5.0))
            };
            lead(session, options, end, look::Watch, seconds)
        }
        Command::Tune | Command::Identify => {
            let task = drive::Tune::new(options);
            lead(session, options, end, task, seconds)
        }
        Command::Get(_) | Command::Set(..) | Command::SetId(_) => {
            let task = setup::Setup::new(options)?;
            lead(session, options, end, task, Some(seconds.unwrap_or(2.0)))
        }
        Command::Watch | Command::Spin | Command::Window => {
            let task = drive::Spin::new(options)?;
            lead(session, options, end, task, Some(seconds.unwrap_or(5.0)))
        }
    }
}

/// Runs a task, and says at the end what it came to.
fn lead(
    mut session: Session,
    options: &Options,
    end: &End,
    task: impl Task,
    seconds: Option<f32>,
) -> Result<ExitCode, String> {
    let outlet = |name, sink| Outlet::new(name, sink, ROOM).map_err(|error| error.to_string());
    let mut errors =
        Outlet::new("standard error", io::stderr(), ROOM).map_err(|error| error.to_string())?;
    let out = Out {
        outlet: outlet("standard output", io::stdout())?,
        is_open: true,
        is_json: options.json,
    };
    let is_lock_step = options.lock_step;
    let mut lead =
        Lead { task, seconds, is_lock_step, out, errors: &mut errors, ticks: 0, is_late: false };
    lead.task.begin(&mut session);
    session.run(end, &mut lead);
    lead.take_messages(&mut session);
    let Lead { mut task, mut out, is_late, .. } = lead;
    let is_missed = task.is_missed() && !end.is_asked_for();
    let mut has_failed = session.has_failed() || is_missed;
    let report = task.report(&mut session, &mut out);
    let mut missed = task.failures();
    if is_missed && missed.is_empty() && is_late {
        missed.push(format!(
            "not done after {:.1} s: see --seconds",
            session.elapsed().as_secs_f32()
        ));
    }
    missed.iter().for_each(|failure| say(&mut errors, failure));
    // Where a reader or a disk holds up the end, a signal may end the program.
    let mut wait = |text: String| {
        end.is_safe(true);
        say(&mut errors, &text);
    };
    let said = out.outlet.finish(report, &mut wait);
    let mut failures = session.finish(&mut wait);
    end.is_safe(true);
    failures.extend(said.err());
    for failure in failures {
        say(&mut errors, &failure);
        has_failed = true;
    }
    errors.finish(String::new(), |_| {})?;
    Ok(if has_failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Writes a line on standard output, for somebody who may have stopped reading.
pub(crate) fn println(text: &str) {
    _ = writeln!(io::stdout(), "{text}");
}
