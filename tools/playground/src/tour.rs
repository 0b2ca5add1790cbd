//! A written run: the actions of a hand with their times.
//!
//! ```text
//! start SEED LAYOUT MASS_KG KP KI WATCHDOGS
//! MS WORD VALUE        a knob or a trouble, in the order of time
//! MS end
//! ```

use crate::robot::{Layout, Watchdogs};
use crate::session::{Knob, Session, Setup, Trouble};

/// The run whose hash page and native program compare: drives, turns gains, and goes through every trouble.
pub const TOUR: &str = include_str!("../tour.txt");

/// Runs a script from its first line to its last.
///
/// # Errors
/// Names the line that cannot be read, or says why the robot cannot start.
pub fn run(script: &str) -> Result<Session, String> {
    let mut lines =
        (1..).zip(script.lines()).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let unreadable =
        |(number, line): (usize, &str)| format!("line {number} cannot be read: {line}");
    let first = lines.next().ok_or("there is no line")?;
    let setup = setup(first.1).ok_or_else(|| unreadable(first))?;
    let mut session = Session::new(setup).map_err(|why| why.to_string())?;
    for line in lines {
        act(&mut session, line.1).ok_or_else(|| unreadable(line))?;
    }
    Ok(session)
}

fn setup(line: &str) -> Option<Setup> {
    let mut words = line.split_whitespace();
    let is_start = words.next() == Some("start");
    let seed = words.next()?.parse().ok()?;
    let layout = Layout::of_word(words.next()?)?;
    let [mass_kg, kp, ki] =
        [words.next()?, words.next()?, words.next()?].map(|word| word.parse().ok());
    let watchdogs = Watchdogs::of_word(words.next()?)?;
    is_start.then_some(Setup { seed, layout, mass_kg: mass_kg?, kp: kp?, ki: ki?, watchdogs })
}

fn act(session: &mut Session, line: &str) -> Option<()> {
    let mut words = line.split_whitespace();
    let millis: u64 = words.next()?.parse().ok()?;
    session.advance(u32::try_from(millis.checked_sub(session.millis())?).ok()?);
    let word = words.next()?;
    if word == "end" {
        return Some(());
    }
    let value: f32 = words.next()?.parse().ok()?;
    if let Some((_, knob)) = Knob::ALL.iter().find(|(one, _)| *one == word) {
        session.set(*knob, value);
    } else {
        let (_, trouble) = Trouble::ALL.iter().find(|(one, _)| *one == word)?;
        session.trouble(*trouble, value >= 0.5);
    }
    Some(())
}
