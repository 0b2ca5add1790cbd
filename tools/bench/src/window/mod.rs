//! The window: keys become actions, and a view of the session becomes a picture.
//!
//! Three threads: the session drives the motors, the window draws and reads keys, and the program's own thread watches the
//! terminal. A terminal that takes nothing, or is gone, therefore holds up neither the motors nor the end of the program. The
//! session ends with zeros when the window is closed or breaks or the terminal is gone, and stops when the window does not answer.

mod draw;
mod keys;
mod remote;
mod tty;
mod view;

use crate::commands;
use crate::end::End;
use crate::options::Options;
use crate::pace::Pace;
use keys::Ui;
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::event::{
    self, DisableBracketedPaste, EnableBracketedPaste, Event, KeyCode, KeyEventKind,
};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{LeaveAlternateScreen, disable_raw_mode};
use remote::{Action, Remote};
use std::io;
use std::mem::ManuallyDrop;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tty::Tty;
use view::View;

/// How often keys are looked for.
const GLANCE: Duration = Duration::from_millis(40);

/// Keys within this time of each other are no key of a person's own.
const TOGETHER: Duration = Duration::from_millis(150);

/// A window gets this long to give the terminal back.
const FAREWELL: Duration = Duration::from_secs(1);

/// Texts for the user after the window is gone.
#[derive(Debug, Default)]
struct Ending {
    /// Gains that were found.
    results: Vec<String>,
    /// Motors that may not rest, and recordings that have no end.
    failures: Vec<String>,
}

/// The last view, from the thread of the session to the window.
type Shared = Arc<Mutex<Option<View>>>;

/// Messages of panics, printed once the screen is the user's again.
type Defects = Arc<Mutex<Vec<String>>>;

/// Shows the session until it ends.
///
/// # Errors
/// Names the option that cannot be met, or the error of the terminal.
pub(crate) fn run(options: &Options, end: &End) -> Result<ExitCode, String> {
    let tty = Tty::open().map_err(|error| format!("the terminal: {error}"))?;
    let (actions, received) = channel();
    let (begun, begins) = sync_channel(1);
    let (shared, defects) = (Shared::default(), Defects::default());
    let session = std::thread::spawn({
        let (options, end, shared) = (options.clone(), end.clone(), Arc::clone(&shared));
        move || lead(&options, &end, received, shared, &begun)
    });
    begins.recv().map_err(|_| "the session did not begin")??;
    let window = std::thread::spawn({
        let (end, defects) = (end.clone(), Arc::clone(&defects));
        move || {
            let shown = catch_unwind(AssertUnwindSafe(|| show(&shared, &actions, &end, defects)));
            restore();
            shown.unwrap_or_else(|_| Err(io::Error::other("a defect of the window; all stop")))
        }
    });
    while !session.is_finished() && !window.is_finished() && !tty.is_gone(GLANCE) {}
    // However the window ended, the motors are brought to rest first.
    end.ask();
    let ending = session.join();
    let shown = farewell(window, &tty);
    let Ending { results, mut failures } = ending.map_err(|_| "a defect of the session")?;
    failures.extend(shown.err());
    results.iter().for_each(|result| commands::println(result));
    failures
        .extend(defects.lock().into_iter().flat_map(|mut defects| std::mem::take(&mut *defects)));
    if failures.is_empty() { Ok(ExitCode::SUCCESS) } else { Err(failures.join("\nbench: ")) }
}

/// Waits until the window has given the terminal back, unless the terminal is gone or takes nothing: the thread then ends with
/// the program.
fn farewell(window: JoinHandle<io::Result<()>>, tty: &Tty) -> Result<(), String> {
    let begun = Instant::now();
    while !window.is_finished() {
        if tty.is_gone(Duration::from_millis(5)) {
            break;
        }
        if begun.elapsed() > FAREWELL {
            _ = disable_raw_mode();
            return Err("the terminal takes nothing".into());
        }
    }
    if tty.is_gone(Duration::ZERO) {
        return Err("the terminal is gone; all stop".into());
    }
    let shown = window.join().map_err(|_| "a defect of the window")?;
    shown.map_err(|error| format!("the terminal: {error}"))
}

/// Gives the terminal back. `ratatui::restore` panics where standard error is gone too, and the zeros come after this.
fn restore() {
    _ = disable_raw_mode();
    _ = execute!(io::stdout(), DisableBracketedPaste, Show, LeaveAlternateScreen);
}

/// The session's thread.
fn lead(
    options: &Options,
    end: &End,
    actions: Receiver<Action>,
    shared: Shared,
    begun: &SyncSender<Result<(), String>>,
) -> Ending {
    let pace = if options.held { Pace::held } else { Pace::simulated };
    let mut session = match commands::session(options, pace) {
        Ok(session) => session,
        Err(error) => {
            _ = begun.send(Err(error));
            return Ending::default();
        }
    };
    _ = begun.send(Ok(()));
    let mut remote = Remote::new(&session, actions, shared, options);
    session.run(end, &mut remote);
    let mut failures = session.messages();
    // A second SIGHUP of the same terminal does not cut the recordings short; a disk that hangs may be left by a signal.
    failures.extend(session.finish(|_| end.is_safe(true)));
    end.is_safe(true);
    let (results, said) = remote.results();
    let failures = said.into_iter().chain(failures).collect();
    Ending { results, failures }
}

/// Draws what the session leaves, and sends what the keys ask for, until the session is over.
fn show(shared: &Shared, actions: &Sender<Action>, end: &End, defects: Defects) -> io::Result<()> {
    // Not dropped: a drop shows the cursor, and panics if terminal and standard error are gone.
    let mut terminal = ManuallyDrop::new(ratatui::try_init()?);
    // The hook of ratatui writes to the terminal from the thread that panics, so that the terminal could hold up the zeros.
    std::panic::set_hook(Box::new(move |panic| {
        if let Ok(mut defects) = defects.try_lock() {
            defects.push(panic.to_string());
        }
    }));
    // A pasted text is no key then.
    _ = execute!(io::stdout(), EnableBracketedPaste);
    let (mut ui, mut view) = (Ui::default(), None);
    let mut alone_from = Instant::now();
    // The session stops everything if it hears nothing of the window.
    while actions.send(Action::Alive).is_ok() {
        let fresh = shared.lock().ok().and_then(|mut shared| shared.take());
        let is_fresh = fresh.is_some();
        view = fresh.or(view);
        if let Some(view) = view.as_ref().filter(|_| is_fresh || ui.has_changed()) {
            terminal.draw(|frame| draw::draw(frame, view, &ui))?;
        }
        if !event::poll(GLANCE)? {
            continue;
        }
        let key = match event::read()? {
            Event::Key(key) if key.kind != KeyEventKind::Release => key,
            _ => {
                ui.change();
                continue;
            }
        };
        let arms = key.code == KeyCode::Char('A');
        let is_followed = event::poll(if arms { TOGETHER } else { Duration::ZERO })?;
        let is_alone = !is_followed && Instant::now() >= alone_from;
        // A key that waits behind this one is not alone, however long the picture between them takes.
        alone_from = Instant::now() + if is_followed { Duration::from_secs(1) } else { TOGETHER };
        match ui.press(key, is_alone, view.as_ref()) {
            Some(Action::Quit) => end.ask(),
            Some(action) => _ = actions.send(action),
            None => {}
        }
    }
    Ok(())
}
