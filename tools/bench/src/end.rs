//! Signals that ask for an end with zeros.

use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1,
    SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What is usually sent to a program and would end it or halt it, and the last current would stand. SIGHUP is that of a
/// terminal which is closed (`nohup` does not help against it), SIGTSTP is Ctrl-Z, SIGTTOU of a terminal that takes nothing
/// from the background.
const SIGNALS: [i32; 14] = [
    SIGINT, SIGTERM, SIGQUIT, SIGHUP, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGALRM,
    SIGVTALRM, SIGPROF, SIGIO, SIGXCPU,
];

/// A signal asks for an end with zeros; where nothing may move, it does what it does to any program.
#[derive(Debug, Clone)]
pub(crate) struct End {
    is_asked_for: Arc<AtomicBool>,
    is_safe: Arc<AtomicBool>,
}

impl End {
    /// # Errors
    /// That of the system, if a signal cannot be taken.
    pub(crate) fn new() -> io::Result<Self> {
        let end = Self { is_asked_for: Arc::default(), is_safe: Arc::new(true.into()) };
        for signal in SIGNALS {
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&end.is_safe))?;
            signal_hook::flag::register(signal, Arc::clone(&end.is_asked_for))?;
        }
        // A file that may grow no more is an error of its writer's then.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        Ok(end)
    }

    /// Nothing ends it but the program.
    #[cfg(test)]
    pub(crate) fn none() -> Self {
        Self { is_asked_for: Arc::default(), is_safe: Arc::default() }
    }

    pub(crate) fn is_asked_for(&self) -> bool {
        self.is_asked_for.load(Ordering::Relaxed)
    }

    pub(crate) fn ask(&self) {
        self.is_asked_for.store(true, Ordering::Relaxed);
    }

    /// Says whether a signal may end the program at once.
    pub(crate) fn is_safe(&self, is_safe: bool) {
        self.is_safe.store(is_safe, Ordering::Relaxed);
    }
}
