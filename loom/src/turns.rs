//! What comes out of the queue when both ends take turns, told without atomics.

use std::collections::BTreeSet;

/// What was kept, and what each pop took.
pub type Outcome = (Vec<usize>, Vec<Option<usize>>);

#[derive(Clone, Default)]
struct State {
    pushed: usize,
    saw_room: bool,
    saw_frame: bool,
    outcome: Outcome,
}

/// Every outcome of as many pushes as pops.
pub fn outcomes(places: usize, frames: usize) -> BTreeSet<Outcome> {
    let mut found = BTreeSet::new();
    go_on(places, frames, &State::default(), &mut found);
    found
}

/// An end first sees whether it can, then does it.
fn go_on(places: usize, frames: usize, state: &State, found: &mut BTreeSet<Outcome>) {
    let (kept, taken) = &state.outcome;
    let oldest = taken.iter().flatten().count();
    if state.pushed < frames {
        let mut next = state.clone();
        if state.saw_room {
            next.outcome.0.push(state.pushed);
        }
        let full = kept.len() - oldest == places;
        next.saw_room = !state.saw_room && !full;
        next.pushed += usize::from(!next.saw_room);
        go_on(places, frames, &next, found);
    }
    if taken.len() < frames {
        let mut next = state.clone();
        next.saw_frame = !state.saw_frame && oldest < kept.len();
        if !next.saw_frame {
            next.outcome.1.push(state.saw_frame.then(|| kept[oldest]));
        }
        go_on(places, frames, &next, found);
    }
    if state.pushed == frames && taken.len() == frames {
        found.insert(state.outcome.clone());
    }
}
