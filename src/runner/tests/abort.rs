//! Frames that a controller still holds when the bus is lost.

use super::super::*;
use super::{Answer, frame};
use crate::dji::{Bus, Config, M3508};
use crate::time::Instant;
use crate::units::Current;
use core::cell::Cell;
use embedded_can::ErrorKind;
use std::vec::Vec;

/// Holds three frames and sends none, until its plug is back.
#[derive(Default)]
struct Mailboxes {
    waiting: Vec<CanFrame>,
    left: Vec<CanFrame>,
    feedback: Option<CanFrame>,
    is_plugged: bool,
}

impl Mailboxes {
    /// A millisecond of the bus.
    fn run(&mut self) {
        if self.is_plugged {
            self.left.append(&mut self.waiting);
            self.feedback = Some(frame(0x201, [0; 8]));
        }
    }
}

impl embedded_can::nb::Can for Mailboxes {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> Answer {
        if self.waiting.len() == 3 {
            return Err(nb::Error::WouldBlock);
        }
        self.waiting.push(*frame);
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.feedback.take().ok_or(nb::Error::WouldBlock)
    }
}

impl AbortPending for Mailboxes {
    fn abort_pending(&mut self, back: impl FnMut(CanFrame)) {
        self.waiting.drain(..).for_each(back);
    }
}

/// Drives with a current that counts up each millisecond; the plug is out from 20 ms on, for a while. Returns the words that left
/// when the plug was back, the number of ticks when the bus was down first, and the runner.
fn pulled<P: Port>(
    port: impl Fn(Mailboxes) -> P,
    mailboxes: impl Fn(&mut P) -> &mut Mailboxes,
    out_ms: u64,
) -> (Vec<i16>, Option<u64>) {
    let clock = Cell::new(Instant::START);
    let mut bus = Bus::new();
    let wheel = bus.attach(Config::<M3508>::at_once(1)).unwrap();
    let mut runner =
        Runner::new(port(Mailboxes { is_plugged: true, ..Mailboxes::default() }), &clock, bus);
    let mut down = None;
    for ms in 1..=20 + out_ms {
        clock.set(clock.get() + Duration::from_millis(1));
        mailboxes(runner.port_mut()).is_plugged = ms < 20;
        mailboxes(runner.port_mut()).run();
        runner.poll(8);
        let tick = runner.due().unwrap();
        if ms == 10 {
            runner.arm(tick).unwrap();
        }
        let amperes = ms as f32 * 0.1;
        _ = runner.device_mut().set_current(wheel, Current::from_amperes(amperes));
        runner.tick(tick);
        if runner.is_bus_down() {
            down = down.or(Some(ms - 20));
        }
    }
    let can = mailboxes(runner.port_mut());
    can.left.clear();
    can.is_plugged = true;
    can.run();
    let word = |frame: &CanFrame| i16::from_be_bytes([frame.bytes()[0], frame.bytes()[1]]);
    (can.left.iter().map(word).collect(), down)
}

#[test]
fn without_an_abort_a_pulled_plug_leaves_a_stale_frame_a_mailbox() {
    let (left, down) = pulled(Nb, |port| &mut port.0, 150);
    assert_eq!(left.len(), 3);
    assert!(left.iter().all(|word| *word != 0), "of 2.0, 2.1 and 2.2 A");
    assert!(down.is_some());
}

#[test]
fn with_an_abort_frames_after_a_pulled_plug_are_of_the_last_tick() {
    let (left, down) = pulled(|can| NbAbort(Nb(can)), |port| &mut port.0.0, 150);
    assert_eq!(left, [0], "zeros, once");
    assert!(
        down.is_some_and(|ms| (100..=102).contains(&ms)),
        "a bus that sends nothing is down: {down:?}"
    );
    // Shorter than the time until feedback is lost: the current of the last tick, 2.5 A, of 20 A in
    // 16384.
    assert_eq!(pulled(|can| NbAbort(Nb(can)), |port| &mut port.0.0, 5), (std::vec![2048], None));
}

#[test]
fn frames_of_others_that_are_called_back_are_handed_over() {
    let clock = Cell::new(Instant::START);
    let mut runner = Runner::new(NbAbort(Nb(Mailboxes::default())), &clock, Bus::new());
    embedded_can::nb::Can::transmit(&mut runner.port_mut().0.0, &frame(0x123, [7; 8])).unwrap();
    let mut others = Vec::new();
    runner.tick_with(Tick::new(Instant::from_micros(1_000), 0.001), |frame| others.push(*frame));
    assert_eq!(others, [frame(0x123, [7; 8])]);
    assert_eq!(runner.statistics().evicted_unrelated, 1);
}
