//! A driver that answers anything at any time: the runner's counts add up, it ends, and the bus keeps its promises.
#![no_main]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, CanDevice, Devices};
use drivetrain::runner::{EmergencyStop, Nb, Runner};
use drivetrain::time::{Instant, Tick};
use drivetrain_fuzz::{Clock, Gesture, Input, Watched};
use embedded_can::ErrorKind;
use libfuzzer_sys::fuzz_target;
use std::cell::Cell;

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
    /// But for the frames that a poll offers in vain, which are not counted.
    offered: u32,
    is_polled: bool,
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
                (self.offered, self.full) = match self.is_polled {
                    true => (self.offered - 1, self.full),
                    false => (self.offered, self.full + 1),
                };
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

/// From the documentation: no fewer readings without a later time are a clock that stands, and so many always. Of received
/// frames 1600 are as good as the limit: 125 readings each at most.
const MAY_STAND_AFTER: u64 = 1_000;
const STANDS_AFTER: u64 = 200_000;
const READINGS_OF_A_FRAME: u64 = 125;

/// What is known of the clock and the bus apart from the runner.
#[derive(Debug, Default)]
struct Known {
    furthest: Option<u64>,
    /// Readings since then, no fewer than there were.
    readings: u64,
    /// The last step that was due.
    stepped: Option<u64>,
    /// Who may arm after the bus was lost, and how often it was.
    gesture: Gesture,
    updated: Option<u64>,
    losses: u32,
}

impl Known {
    fn show(&mut self, now: u64, readings: u64) {
        if self.furthest < Some(now) {
            (self.furthest, self.readings) = (Some(now), 0);
        }
        self.readings += readings;
    }

    /// A received frame says that time passes, whatever the clock shows.
    fn hear(&mut self, frames: u64) {
        self.readings += frames * READINGS_OF_A_FRAME;
    }

    /// A step is due at once when the clock lies before the last one. It has no length only then and when the clock stands, and
    /// does not lie after the last one.
    fn check(&mut self, now: u64, tick: Option<Tick>) {
        self.show(now, 1);
        let is_back = self.stepped.is_some_and(|stepped| now < stepped);
        let Some(tick) = tick else {
            return assert!(!is_back, "I4: back at {now}, and nothing is due: {self:?}");
        };
        let at = tick.now().as_micros();
        // That of a clock that stands does not lie after the last step that was run, nor after the last one that was due.
        let last =
            self.updated.map_or(self.stepped, |updated| self.stepped.map(|at| at.min(updated)));
        if tick.dt_s() == 0.0 && Some(at) == last && !(is_back && at == now) {
            return assert!(self.readings >= MAY_STAND_AFTER, "no step at {now}: {self:?}");
        }
        assert!(at == now && is_back == (tick.dt_s() == 0.0), "I4: {tick:?} at {now}: {self:?}");
        (self.stepped, self.furthest, self.readings) = (Some(now), Some(now), 0);
    }
}

fuzz_target!(|data: &[u8]| {
    STOP.clear();
    let mut input = Input(data);
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut time, mut known, mut has_stood) = (Clock::new(1_000), Known::default(), false);
    let runner = Runner::new(Nb(Scripted::default()), &clock, Watched::new(input.good_frames()));
    let mut runner = runner.with_emergency_stop(&STOP);
    let (mut direct, mut left_ms) = (0, 1_000);
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
                hear_all(&mut runner, &mut known, clock.get().as_micros());
                direct += 5;
            }
            64..=89 => {
                let budget = usize::from(input.byte() % 20);
                let asked = runner.port_mut().0.asked;
                runner.port_mut().0.is_polled = true;
                let came = runner.poll(budget);
                runner.port_mut().0.is_polled = false;
                let asked = runner.port_mut().0.asked - asked;
                known.show(clock.get().as_micros(), 1 + u64::from(asked));
                known.hear(asked.into());
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
            150..=159 => arm(&mut runner, &mut known, clock.get().as_micros()),
            160..=161 => STOP.set(),
            162 if !has_stood => {
                has_stood = true;
                let now = clock.get().as_micros();
                direct += stand(&mut runner, &mut known, now, input.coin());
            }
            162..=167 => runner.clear_emergency_stop(),
            168 => runner.device_mut().plug(input.byte().into()),
            // All is well for a fraction of a second, but for what the driver still has to answer.
            172..=175 => {
                let (how, target) = (input.byte(), input.target());
                for _ in 0..u16::from(input.byte()).min(left_ms) {
                    left_ms -= 1;
                    let now = time.go_well();
                    clock.set(Instant::from_micros(now));
                    hear_all(&mut runner, &mut known, now);
                    direct += 5;
                    if how & 0x40 != 0 {
                        arm(&mut runner, &mut known, now);
                    }
                    runner.device_mut().set((how & 0x1F).into(), target);
                    let tick = runner.due();
                    known.check(now, tick);
                    if let Some(tick) = tick {
                        step(&mut runner, &mut known, tick);
                    }
                }
            }
            169..=171 => {
                while Devices::next_edge(runner.device_mut()).is_some() {}
                assert!(runner.edges().count() <= 32, "an edge is told again and again");
            }
            kind => {
                let now = time.pass(&mut input);
                clock.set(Instant::from_micros(now));
                let tick = if kind < 180 {
                    Some(Tick::new(clock.get(), input.step_s()))
                } else {
                    let tick = runner.due();
                    known.check(now, tick);
                    tick
                };
                let Some(tick) = tick else { continue };
                step(&mut runner, &mut known, tick);
            }
        }
    }
    let (s, superseded) = (runner.statistics(), CanDevice::superseded(runner.device()));
    let left = runner.device().left_for_good();
    let can = &runner.port_mut().0;
    assert_eq!(s.received, can.delivered + direct, "I6");
    assert_eq!(s.received, s.taken + s.unrelated + s.malformed, "I6");
    assert_eq!(s.receive_errors(), can.receive_errors, "I6");
    assert_eq!(s.offered, can.offered, "I6");
    assert_eq!((s.sent, s.refused, s.send_errors()), (can.accepted, can.full, can.failed));
    assert_eq!(s.offered, s.sent + s.refused + s.send_errors(), "I6");
    assert_eq!(s.evicted + s.evicted_unrelated, can.evicted, "I6");
    assert_eq!(left, can.accepted - can.evicted_own, "I6: what came back is offered again");
    assert_eq!(s.superseded, superseded);
});

type Shell<'a> = Runner<Nb<Scripted>, &'a Cell<Instant>, Watched>;

fn step(runner: &mut Shell, known: &mut Known, tick: Tick) {
    let offered = runner.port_mut().0.offered;
    runner.tick(tick);
    let (now, before) = (tick.now().as_micros(), known.updated.replace(tick.now().as_micros()));
    known.gesture.update(now.checked_sub(before.unwrap_or(now)));
    assert!(runner.port_mut().0.offered - offered <= 5, "I1");
    assert!(!STOP.is_set() || CanDevice::is_stopped(runner.device()));
    assert!(!runner.is_bus_down() || !runner.is_armed());
    let losses = runner.statistics().bus_losses;
    if core::mem::replace(&mut known.losses, losses) != losses {
        known.gesture.trip();
    }
}

fn hear_all(runner: &mut Shell, known: &mut Known, now: u64) {
    for id in [0x201, 0x202, 0x203, 0x209, 0x20B] {
        if let Some(frame) = CanFrame::standard(id, [0, 0, 0, 9, 0, 0, 25, 0]) {
            known.hear(1);
            _ = runner.ingest(&frame, Instant::from_micros(now));
        }
    }
}

fn arm(runner: &mut Shell, known: &mut Known, now: u64) {
    let (down, granted) = (runner.is_bus_down(), known.gesture.ask());
    let armed = runner.arm(Tick::new(Instant::from_micros(now), 0.001));
    assert!(armed.is_err() || !STOP.is_set() && !down);
    if armed.is_ok() {
        assert!(granted, "armed without a new request since the bus was lost: {known:?}");
        known.gesture.grant(false);
    }
    assert!(!STOP.is_set() || armed == Err(ArmError::Stopped));
}

/// The clock stands, and is read on, or frames go on: the first step without a length is one that holds, the second is none.
/// Returns how many frames came.
fn stand(runner: &mut Shell, known: &mut Known, now: u64, hears: bool) -> u32 {
    let (mut frames, mut steps) = (0, 0);
    for _ in 0..2 * STANDS_AFTER + 3 {
        if let (true, Some(frame)) = (hears, CanFrame::standard(0x300, [0; 8])) {
            frames += 1;
            known.hear(1);
            _ = runner.ingest(&frame, Instant::from_micros(now));
        }
        let tick = runner.due();
        known.check(now, tick);
        let Some(tick) = tick else { continue };
        step(runner, known, tick);
        steps += u32::from(tick.dt_s() == 0.0);
        if steps == 3 {
            break;
        }
    }
    assert!(steps > 0 && !runner.is_armed(), "I4: the clock stands at {now}, {steps} steps");
    frames
}
