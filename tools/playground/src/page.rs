//! The functions that JavaScript calls. One robot lives in each copy of the module; the page makes a new copy to start anew.
//!
//! Text and numbers are left in memory: the function returns their place, `length` their length.

#![expect(
    unsafe_code,
    reason = "`unsafe(no_mangle)` gives a function the name that JavaScript calls"
)]

use crate::{Knob, Layout, Session, Setup, Trouble, Watchdogs, tour};
use std::cell::RefCell;

thread_local! {
    static SESSION: RefCell<Option<Session>> = const { RefCell::new(None) };
    static TEXT: RefCell<String> = const { RefCell::new(String::new()) };
    static NUMBERS: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

fn with<T: Default>(work: impl FnOnce(&mut Session) -> T) -> T {
    SESSION.with_borrow_mut(|session| session.as_mut().map(work)).unwrap_or_default()
}

fn leave(text: String) -> *const u8 {
    TEXT.with_borrow_mut(|place| {
        *place = text;
        place.as_ptr()
    })
}

/// Starts a robot; 0, or the reason why it does not start, as a text.
#[unsafe(no_mangle)]
extern "C" fn start(
    seed: u32,
    layout: usize,
    mass_kg: f32,
    kp: f32,
    ki: f32,
    watchdogs: usize,
) -> *const u8 {
    let layout = Layout::ALL.get(layout).map_or(Layout::Mecanum, |(_, layout)| *layout);
    let watchdogs = Watchdogs::ALL.get(watchdogs).map_or(Watchdogs::Program, |(_, one)| *one);
    match Session::new(Setup { seed, layout, mass_kg, kp, ki, watchdogs }) {
        Ok(session) => {
            SESSION.set(Some(session));
            std::ptr::null()
        }
        Err(why) => leave(why.to_string()),
    }
}

/// Runs the tour in the place of a robot.
#[unsafe(no_mangle)]
extern "C" fn run_tour() {
    SESSION.set(tour::run(tour::TOUR).ok());
}

#[unsafe(no_mangle)]
extern "C" fn set(knob: usize, value: f32) {
    if let Some((_, knob)) = Knob::ALL.get(knob) {
        with(|session| session.set(*knob, value));
    }
}

#[unsafe(no_mangle)]
extern "C" fn trouble(which: usize, begins: u32) {
    if let Some((_, trouble)) = Trouble::ALL.get(which) {
        with(|session| session.trouble(*trouble, begins != 0));
    }
}

#[unsafe(no_mangle)]
extern "C" fn advance(ms: u32) {
    with(|session| session.advance(ms));
}

/// The hash of all frames.
#[unsafe(no_mangle)]
extern "C" fn hash() -> u64 {
    with(|session| session.hash())
}

/// The numbers of a picture.
#[unsafe(no_mangle)]
extern "C" fn numbers() -> *const f32 {
    let numbers = with(|session| session.numbers());
    NUMBERS.with_borrow_mut(|place| {
        *place = numbers;
        place.as_ptr()
    })
}

#[unsafe(no_mangle)]
extern "C" fn numbers_length() -> usize {
    NUMBERS.with_borrow(Vec::len)
}

/// The last frames, decoded.
#[unsafe(no_mangle)]
extern "C" fn frames() -> *const u8 {
    leave(with(|session| session.frames()))
}

/// The lines of the log since the last call.
#[unsafe(no_mangle)]
extern "C" fn take_log() -> *const u8 {
    leave(with(Session::take_log))
}

/// The actions so far, as a script.
#[unsafe(no_mangle)]
extern "C" fn script() -> *const u8 {
    leave(with(|session| session.script()))
}

#[unsafe(no_mangle)]
extern "C" fn text_length() -> usize {
    TEXT.with_borrow(String::len)
}
