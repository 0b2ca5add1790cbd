//! The queue between an interrupt and a task, with a thread for each: nothing is lost, torn, doubled or reordered.
//!
//! `.ci/miri` runs this under many schedules, with weak memory and a search for data races. They are drawn; `.ci/loom`
//! enumerates them, for a few frames. Of our own there is one atomic, the count of dropped frames: only the sender
//! writes it.

#![cfg(test)]

use drivetrain::frame::CanFrame;
use drivetrain::runner::{FrameQueue, FrameReceiver, FrameSender};
use drivetrain::time::Instant;
use std::sync::atomic::{AtomicBool, Ordering};

/// Miri takes a thousand times as long.
const FRAMES: u32 = if cfg!(miri) { 60 } else { 20_000 };

/// A frame that shows when it was torn: its number stands in it twice, and in its stamp.
fn numbered(number: u32) -> (CanFrame, Instant) {
    let [a, b, c, d] = number.to_be_bytes();
    let id = 0x200 + u16::try_from(number % 0x100).unwrap();
    let frame = CanFrame::standard(id, [a, b, c, d, a, b, c, d]).unwrap();
    (frame, Instant::from_micros(number.into()))
}

/// Pushes every number once; returns how many were kept.
fn interrupt(mut sender: FrameSender, done: &AtomicBool) -> u32 {
    let mut kept = 0;
    for number in 0..FRAMES {
        let (frame, at) = numbered(number);
        kept += u32::from(sender.push(&frame, at));
        if number.is_multiple_of(64) {
            std::thread::yield_now();
        }
    }
    done.store(true, Ordering::Release);
    kept
}

/// Takes frames until none can come; returns how many came.
fn task(receiver: &mut FrameReceiver, done: &AtomicBool) -> u32 {
    let (mut taken, mut next, mut dropped) = (0, 0, 0);
    loop {
        // Asked before the queue is looked into: what was pushed before it is seen below.
        let last = done.load(Ordering::Acquire);
        while let Some((frame, at)) = receiver.pop() {
            let number = u32::try_from(at.as_micros()).unwrap();
            assert!(number >= next, "{number} after {next}: doubled or out of order");
            assert_eq!((frame, at), numbered(number), "torn");
            (taken, next) = (taken + 1, number + 1);
        }
        let seen = receiver.dropped();
        assert!(seen >= dropped, "the count of dropped frames went back");
        dropped = seen;
        if last {
            return taken;
        }
        std::thread::yield_now();
    }
}

fn exchange<const N: usize>() -> (u32, u32) {
    let mut queue = FrameQueue::<N>::new();
    let (sender, mut receiver) = queue.split();
    let done = AtomicBool::new(false);
    let (kept, taken) = std::thread::scope(|threads| {
        let kept = threads.spawn(|| interrupt(sender, &done));
        let taken = task(&mut receiver, &done);
        (kept.join().unwrap(), taken)
    });
    assert_eq!(kept, taken, "kept by the interrupt, taken by the task");
    assert_eq!(kept + receiver.dropped(), FRAMES, "kept and dropped are all");
    (kept, receiver.dropped())
}

#[test]
fn between_two_threads_every_frame_is_taken_once_in_order_or_counted_as_dropped() {
    // One place, a few, and enough to wrap seldom.
    for (kept, dropped) in [exchange::<2>(), exchange::<4>(), exchange::<64>()] {
        assert!(kept >= 1, "{kept} kept, {dropped} dropped");
    }
}
