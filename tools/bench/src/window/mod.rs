//! The window: keys become actions, and a view of the session becomes a picture.
//!
//! The session runs in a thread of its own, so that a terminal which takes nothing holds up no motor. It ends with zeros when the
//! window is closed, breaks, or does not answer.

mod draw;
mod keys;
mod remote;
mod view;

use crate::commands;
use crate::end::End;
use crate::options::Options;
use crate::pace::Pace;
use keys::Ui;
use ratatui::crossterm::event::{self, Event, KeyEventKind};
use remote::{Action, Remote};
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use view::View;

/// How often keys are looked for.
const GLANCE: Duration = Duration::from_millis(40);

/// What the user is told when the window is gone.
#[derive(Debug, Default)]
struct Ending {
    /// Gains that were found.
    results: Vec<String>,
    /// Motors that may not rest, and recordings that have no end.
    failures: Vec<String>,
}

/// What the session's thread leaves for the window.
type Shared = Arc<Mutex<Option<View>>>;

/// Shows the session until it ends.
///
/// # Errors
/// Says which option cannot be met, or what is wrong with the terminal.
pub(crate) fn run(options: &Options, end: &End) -> Result<ExitCode, String> {
    let (actions, received) = channel();
    let (begun, begins) = sync_channel(1);
    let shared = Shared::default();
    let session = std::thread::spawn({
        let (options, end, shared) = (options.clone(), end.clone(), Arc::clone(&shared));
        move || lead(&options, &end, received, shared, &begun)
    });
    let outcome = match begins.recv() {
        Ok(Ok(())) => {
            let shown = catch_unwind(AssertUnwindSafe(|| show(&shared, &actions, end, &session)));
            ratatui::restore();
            match shown {
                Ok(shown) => shown.map_err(|error| format!("the terminal: {error}")),
                Err(_) => Err("a defect of the window; all stop".into()),
            }
        }
        Ok(Err(error)) => Err(error),
        Err(_) => Err("the session did not begin".into()),
    };
    // However the window ended, the motors are brought to rest first.
    end.ask();
    drop(actions);
    let Ending { results, failures } = session.join().map_err(|_| "a defect of the session")?;
    outcome?;
    results.iter().for_each(|result| commands::println(result));
    if failures.is_empty() { Ok(ExitCode::SUCCESS) } else { Err(failures.join("\nbench: ")) }
}

/// The session's thread.
fn lead(
    options: &Options,
    end: &End,
    actions: Receiver<Action>,
    shared: Shared,
    begun: &std::sync::mpsc::SyncSender<Result<(), String>>,
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
    let mut remote = Remote::new(&session, actions, shared, options.held);
    session.run(end, &mut remote);
    let mut failures = session.messages();
    failures.extend(session.finish(|_| {}));
    Ending { results: remote.results(), failures }
}

/// Draws what the session leaves, and sends what the keys ask for.
fn show(
    shared: &Shared,
    actions: &Sender<Action>,
    end: &End,
    session: &std::thread::JoinHandle<Ending>,
) -> io::Result<()> {
    let mut terminal = ratatui::try_init()?;
    let (mut ui, mut view) = (Ui::default(), None);
    while !session.is_finished() {
        let fresh = shared.lock().ok().and_then(|mut shared| shared.take());
        let is_fresh = fresh.is_some();
        view = fresh.or(view);
        if let Some(view) = view.as_ref().filter(|_| is_fresh || ui.has_changed()) {
            terminal.draw(|frame| draw::draw(frame, view, &ui))?;
        }
        // The session stops everything if it hears nothing of the window.
        _ = actions.send(Action::Alive);
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
        match ui.press(key, view.as_ref()) {
            Some(Action::Quit) => end.ask(),
            Some(action) => _ = actions.send(action),
            None => {}
        }
    }
    Ok(())
}
