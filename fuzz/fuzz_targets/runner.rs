//! A driver that answers anything at any time: the runner's counts add up, it ends, and the bus keeps its promises.
#![no_main]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, CanDevice};
use drivetrain::runner::{EmergencyStop, Nb, Runner};
use drivetrain::time::{Instant, ManualClock, Tick};
use drivetrain_fuzz::{Input, Watched};
use embedded_can::ErrorKind;
use libfuzzer_sys::fuzz_target;

const KINDS: [ErrorKind; 7] = [
    ErrorKind::Overrun,
    ErrorKind::Bit,
    ErrorKind::Stuff,
    ErrorKind::Crc,
    ErrorKind::Form,
    ErrorKind::Acknowledge,
    ErrorKind::Other,
];

/// A driver that does as it is told, and counts.
#[derive(Debug, Default)]
struct Scripted {
    answers: Vec<u8>,
    received: Vec<Result<CanFrame, ErrorKind>>,
    waiting: Vec<CanFrame>,
    asked: u32,
    offered: u32,
    accepted: u32,
    full: u32,
    failed: u32,
    evicted: u32,
    /// Of these, command frames of the bus.
    evicted_own: u32,
    delivered: u32,
    receive_errors: u32,
}

impl embedded_can::nb::Can for Scripted {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        self.offered += 1;
        match self.answers.pop().unwrap_or_default() {
            0..=99 => {
                self.accepted += 1;
                self.waiting.push(*frame);
                if self.waiting.len() > 3 {
                    self.waiting.remove(0);
                }
                Ok(None)
            }
            // One of our own that waited, if any, or the very same one.
            answer @ 100..=149 => {
                self.accepted += 1;
                self.evicted += 1;
                self.evicted_own += 1;
                let index = usize::from(answer) % (self.waiting.len() + 1);
                let waited =
                    if index < self.waiting.len() { self.waiting.remove(index) } else { *frame };
                Ok(Some(waited))
            }
            answer @ 150..=169 => {
                self.accepted += 1;
                self.evicted += 1;
                Ok(CanFrame::standard(0x600 + u16::from(answer), [answer; 8]))
            }
            170..=209 => {
                self.full += 1;
                Err(nb::Error::WouldBlock)
            }
            answer => {
                self.failed += 1;
                Err(nb::Error::Other(KINDS[usize::from(answer) % KINDS.len()]))
            }
        }
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.asked += 1;
        match self.received.pop() {
            Some(Ok(frame)) => {
                self.delivered += 1;
                Ok(frame)
            }
            Some(Err(kind)) => {
                self.receive_errors += 1;
                Err(nb::Error::Other(kind))
            }
            None => Err(nb::Error::WouldBlock),
        }
    }
}

static STOP: EmergencyStop = EmergencyStop::new();

fuzz_target!(|data: &[u8]| {
    STOP.clear();
    let mut input = Input(data);
    let clock = ManualClock::new(Instant::from_micros(1_000));
    let runner = Runner::new(Nb(Scripted::default()), &clock, Watched::new());
    let mut runner = runner.with_emergency_stop(&STOP);
    let mut direct = 0;
    while !input.is_empty() {
        match input.byte() {
            0..=39 => {
                let frame = input.frame();
                let can = &mut runner.port_mut().0;
                can.received.extend(frame.map(Ok));
            }
            40..=47 => {
                let kind = KINDS[usize::from(input.byte()) % KINDS.len()];
                runner.port_mut().0.received.push(Err(kind));
            }
            48..=63 => {
                for id in [0x201, 0x202, 0x203, 0x209, 0x20B] {
                    if let Some(frame) = CanFrame::standard(id, [0, 0, 0, 9, 0, 0, 25, 0]) {
                        direct += 1;
                        _ = runner.ingest(&frame, clock.now());
                    }
                }
            }
            64..=89 => {
                let budget = usize::from(input.byte() % 20);
                let asked = runner.port_mut().0.asked;
                let came = runner.poll(budget);
                let asked = runner.port_mut().0.asked - asked;
                assert!(asked as usize <= budget && came <= budget, "I1");
            }
            90..=119 => {
                let answers = input.bytes::<4>();
                runner.port_mut().0.answers.extend(answers);
            }
            120..=149 => {
                let motor = input.byte();
                runner.device_mut().set(motor.into(), input.target());
            }
            150..=159 => {
                let down = runner.is_bus_down();
                let armed = runner.arm(Tick::new(clock.now(), 0.001));
                assert!(armed.is_err() || !STOP.is_set() && !down);
                assert!(!STOP.is_set() || armed == Err(ArmError::Stopped));
            }
            160..=162 => STOP.set(),
            163..=167 => runner.clear_emergency_stop(),
            168 => runner.device_mut().plug(input.byte().into()),
            169..=171 => {
                while runner.device_mut().next_edge().is_some() {}
                assert!(runner.edges().count() <= 32, "an edge is told again and again");
            }
            kind => {
                clock.set(Instant::from_micros(input.time(clock.now().as_micros())));
                let tick = if kind < 180 {
                    Some(Tick::new(clock.now(), input.step_s()))
                } else {
                    runner.due()
                };
                let Some(tick) = tick else { continue };
                let offered = runner.port_mut().0.offered;
                runner.tick(tick);
                assert!(runner.port_mut().0.offered - offered <= 5, "I1");
                assert!(!STOP.is_set() || runner.device().is_stopped());
                assert!(!runner.is_bus_down() || !runner.is_armed());
            }
        }
    }
    let (s, superseded) = (runner.statistics(), runner.device().superseded());
    let left = runner.device().left_for_good();
    let can = &runner.port_mut().0;
    assert_eq!(s.received, can.delivered + direct, "I6");
    assert_eq!(s.received, s.taken + s.unrelated + s.malformed, "I6");
    assert_eq!(s.receive_errors.total(), can.receive_errors, "I6");
    assert_eq!(s.offered, can.offered, "I6");
    assert_eq!((s.sent, s.refused, s.send_errors.total()), (can.accepted, can.full, can.failed));
    assert_eq!(s.offered, s.sent + s.refused + s.send_errors.total(), "I6");
    assert_eq!(s.evicted + s.evicted_unrelated, can.evicted, "I6");
    assert_eq!(left, can.accepted - can.evicted_own, "I6: what came back is offered again");
    assert_eq!(s.superseded, superseded);
});
