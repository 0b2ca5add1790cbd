//! What one end of the queue does while the other does something else.

use super::queue::{FrameQueue, FrameReceiver, FrameSender};
use crate::{turns, Model};
use drivetrain::frame::CanFrame;
use drivetrain::time::Instant;
use loom::thread;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};

/// A frame whose id, data and time belong together.
fn numbered(number: usize) -> (CanFrame, Instant) {
    let byte = u8::try_from(number).unwrap();
    let frame = CanFrame::standard(0x200 + u16::from(byte), [byte; 8]).unwrap();
    (frame, Instant::from_micros(u64::from(byte)))
}

fn number(at: Instant) -> usize {
    usize::try_from(at.as_micros()).unwrap()
}

/// Pushes every number once; returns those that were kept.
fn push_all(mut sender: FrameSender, frames: usize) -> Vec<usize> {
    let mut push = |number: usize| {
        let (frame, at) = numbered(number);
        sender.push(&frame, at)
    };
    (0..frames).filter(|number| push(*number)).collect()
}

/// Both ends of a queue, which is not freed: threads of loom outlive every borrow.
fn ends<const N: usize>() -> (FrameSender<'static>, FrameReceiver<'static>) {
    Box::leak(Box::new(FrameQueue::<N>::new())).split()
}

/// Runs the model in every order; returns what came out of it, and how often.
fn explore<T: Ord + Send + 'static>(
    what: &str,
    model: impl Fn() -> T + Send + Sync + 'static,
) -> BTreeMap<T, u64> {
    let outcomes = Arc::new(Mutex::new(BTreeMap::new()));
    let seen = Arc::clone(&outcomes);
    loom::model(move || {
        let outcome = model();
        *seen.lock().unwrap().entry(outcome).or_insert(0) += 1;
    });
    let outcomes = std::mem::take(&mut *outcomes.lock().unwrap());
    println!("{what}: {} interleavings", outcomes.values().sum::<u64>());
    outcomes
}

/// How many frames wait, as an end says of itself.
fn waiting(end: &impl Debug) -> usize {
    let text = format!("{end:?}");
    let number = text.split(['(', ' ']).nth(1).unwrap();
    number.parse().unwrap()
}

pub fn run<const N: usize>(model: Model) {
    match model {
        Model::Exchange => exchange::<N>(),
        Model::Count => count::<N>(),
        Model::Views => views::<N>(),
    }
}

/// What is popped is what was kept: once, in order and whole. What was refused is counted.
fn exchange<const N: usize>() {
    let outcomes = explore(&format!("exchange, places: {}", N - 1), || {
        let (sender, mut receiver) = ends::<N>();
        let interrupt = thread::spawn(move || push_all(sender, N + 1));
        let meanwhile: Vec<_> = (0..=N).map(|_| receiver.pop()).collect();
        let kept = interrupt.join().unwrap();
        let after = std::iter::from_fn(|| receiver.pop());
        let taken: Vec<_> = meanwhile.iter().flatten().copied().chain(after).collect();
        let pushed: Vec<_> = kept.iter().map(|number| numbered(*number)).collect();
        assert_eq!(taken, pushed, "taken and kept");
        let dropped = usize::try_from(receiver.dropped()).unwrap();
        assert_eq!(kept.len() + dropped, N + 1, "kept and dropped are all");
        let meanwhile = meanwhile.iter().map(|it| it.map(|(_, at)| number(at))).collect();
        (kept, meanwhile)
    });
    // loom leaves orders out that it takes for the same as others; weak memory has outcomes of its own.
    for outcome in turns::outcomes(N - 1, N + 1) {
        assert!(outcomes.contains_key(&outcome), "loom has not tried {outcome:?}");
    }
}

/// The count of dropped frames, read while it grows.
fn count<const N: usize>() {
    let outcomes = explore(&format!("count, places: {}", N - 1), || {
        let (sender, mut receiver) = ends::<N>();
        let interrupt = thread::spawn(move || push_all(sender, N + 1).len());
        let (mut taken, mut noted, mut before) = (0, 0, 0);
        for _ in 0..2 {
            taken += usize::from(receiver.pop().is_some());
            noted += receiver.take_dropped();
            let dropped = receiver.dropped();
            assert!(before <= noted && noted <= dropped, "the count of dropped frames went back");
            before = dropped;
        }
        let kept = interrupt.join().unwrap();
        taken += std::iter::from_fn(|| receiver.pop()).count();
        noted += receiver.take_dropped();
        assert_eq!(noted, receiver.dropped(), "each dropped frame is noted once");
        assert_eq!(taken, kept, "taken and kept");
        assert_eq!(taken + usize::try_from(noted).unwrap(), N + 1, "kept and dropped are all");
        before
    });
    assert!(outcomes.len() >= 3, "the count was hardly seen to grow: {outcomes:?}");
}

/// An end may see the other too late, but never what is not there.
fn views<const N: usize>() {
    explore(&format!("views, places: {}", N - 1), || {
        let (mut sender, mut receiver) = ends::<N>();
        let interrupt = thread::spawn(move || {
            for number in 0..=N {
                let free = N - 1 - waiting(&sender);
                let (frame, at) = numbered(number);
                let kept = sender.push(&frame, at);
                assert!(kept || free == 0, "fewer places than were free");
            }
        });
        for _ in 0..2 {
            let waiting = waiting(&receiver);
            assert!(waiting < N, "more frames than places");
            for _ in 0..waiting {
                assert!(receiver.pop().is_some(), "fewer frames than were waiting");
            }
        }
        interrupt.join().unwrap();
        let waiting = waiting(&receiver);
        assert_eq!(waiting, std::iter::from_fn(|| receiver.pop()).count(), "waiting at the end");
    });
}
