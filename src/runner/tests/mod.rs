//! The runner against a scripted driver: any answer at any time.

mod places;

use super::*;
use crate::dji::{Bus, Config, Handle, M3508};
use crate::motor::{ArmError, Ingest};
use crate::time::Instant;
use core::cell::Cell;
use embedded_can::{ErrorKind, Frame, StandardId};
use std::collections::VecDeque;
use std::vec::Vec;

type Answer = Result<Option<CanFrame>, nb::Error<ErrorKind>>;

/// Answers as scripted, then takes everything; records the offered frames.
#[derive(Default)]
struct Scripted {
    transmit: VecDeque<Answer>,
    receive: VecDeque<Result<CanFrame, nb::Error<ErrorKind>>>,
    offered: Vec<CanFrame>,
    always: Option<nb::Error<ErrorKind>>,
    /// The frame that never leaves.
    stuck: Option<u32>,
}

impl embedded_can::nb::Can for Scripted {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> Answer {
        self.offered.push(*frame);
        match &self.always {
            Some(error) => Err(*error),
            None if self.stuck == Some(frame.header()) => Err(nb::Error::Other(ErrorKind::Other)),
            None => self.transmit.pop_front().unwrap_or(Ok(None)),
        }
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.receive.pop_front().unwrap_or(Err(nb::Error::WouldBlock))
    }
}

fn frame(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::standard(id, data).unwrap()
}

type TestRunner<'c> = Runner<Nb<Scripted>, &'c Cell<Instant>, Bus>;

/// Two M3508 in two command frames, armed, with a non-zero target for each.
fn driving(clock: &Cell<Instant>) -> (TestRunner<'_>, [Handle<M3508>; 2]) {
    let mut bus = Bus::new();
    let wheels = bus.attach_all([1, 5].map(Config::<M3508>::at_once)).unwrap();
    let mut can = Scripted::default();
    can.receive.extend([0x201, 0x205].map(|id| Ok(frame(id, [0; 8]))));
    let mut runner = Runner::new(Nb(can), clock, bus);
    runner.poll(8);
    let tick = Tick::new(clock.get(), 0.001);
    runner.arm(tick).unwrap();
    set(&mut runner, wheels, 1);
    runner.tick(tick);
    runner.port_mut().0.offered.clear();
    (runner, wheels)
}

fn set(runner: &mut TestRunner<'_>, wheels: [Handle<M3508>; 2], raw: i16) {
    for wheel in wheels {
        runner.device_mut().set_raw(wheel, raw).unwrap();
    }
}

fn hear(runner: &mut TestRunner<'_>, clock: &Cell<Instant>) {
    for id in [0x201, 0x205] {
        assert_eq!(runner.ingest(&frame(id, [0; 8]), clock.get()), Ingest::Taken);
    }
}

fn offered(runner: &mut TestRunner<'_>) -> Vec<(u32, u8)> {
    runner.port_mut().0.offered.drain(..).map(|frame| (frame.header(), frame.bytes()[1])).collect()
}

#[test]
fn a_driver_that_would_block_for_ever_does_not_hold_the_loop() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    runner.port_mut().0.always = Some(nb::Error::WouldBlock);
    for raw in 2..50 {
        clock.set(clock.get() + Duration::from_millis(1));
        hear(&mut runner, &clock);
        set(&mut runner, wheels, raw);
        runner.tick(Tick::new(clock.get(), 0.001));
    }
    assert_eq!(offered(&mut runner).len(), 48, "one try a tick");
    runner.port_mut().0.always = None;
    clock.set(clock.get() + Duration::from_millis(1));
    set(&mut runner, wheels, 77);
    runner.tick(Tick::new(clock.get(), 0.001));
    let mut sent = offered(&mut runner);
    assert_eq!(runner.statistics().superseded, 96, "two frames in each of 48 ticks");
    sent.sort_unstable();
    assert_eq!(sent, [(0x1FF, 77), (0x200, 77)], "the newest values, both frames");
}

#[test]
fn a_refused_frame_goes_first_next_time() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    for raw in 2..1000 {
        clock.set(clock.get() + Duration::from_millis(1));
        hear(&mut runner, &clock);
        set(&mut runner, wheels, raw % 100 + 1);
        // One place a tick: with a fixed order the second frame would never get a place.
        runner.port_mut().0.transmit.extend([Ok(None), Err(nb::Error::WouldBlock)]);
        runner.tick(Tick::new(clock.get(), 0.001));
    }
    let sent: Vec<u32> = offered(&mut runner).chunks(2).map(|pair| pair[0].0).collect();
    let first = sent.iter().filter(|id| **id == 0x200).count();
    assert!((450..550).contains(&first), "{first} of {}", sent.len());
}

#[test]
fn an_evicted_frame_is_sent_later_and_a_foreign_one_handed_back() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    let foreign = frame(0x7FF, [9; 8]);
    clock.set(clock.get() + Duration::from_millis(1));
    set(&mut runner, wheels, 2);
    runner.port_mut().0.transmit.extend([Ok(Some(foreign)), Ok(Some(frame(0x200, [0; 8])))]);
    let mut handed_back = Vec::new();
    runner.tick_with(Tick::new(clock.get(), 0.001), |frame| handed_back.push(*frame));
    assert_eq!(handed_back, [foreign]);
    let statistics = runner.statistics();
    assert_eq!((statistics.evicted, statistics.evicted_unrelated), (1, 1));
    _ = offered(&mut runner);
    clock.set(clock.get() + Duration::from_millis(1));
    runner.tick(Tick::new(clock.get(), 0.001));
    assert_eq!(offered(&mut runner)[0].0, 0x200);
}

#[test]
fn driver_errors_are_counted_by_kind_and_the_loop_goes_on() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    let error = |kind| nb::Error::Other(kind);
    let can = &mut runner.port_mut().0;
    can.receive.extend([
        Err(error(ErrorKind::Overrun)),
        Ok(frame(0x201, [0; 8])),
        Err(error(ErrorKind::Crc)),
    ]);
    can.transmit.extend([Err(error(ErrorKind::Acknowledge)), Ok(None)]);
    assert_eq!(runner.poll(16), 1);
    set(&mut runner, wheels, 2);
    runner.tick(Tick::new(clock.get(), 0.001));
    let statistics = runner.statistics();
    let heard = [ErrorKind::Overrun, ErrorKind::Crc].map(|kind| statistics.receive_errors_of(kind));
    assert_eq!((heard, statistics.receive_errors()), ([1, 1], 2));
    let unacknowledged = statistics.send_errors_of(ErrorKind::Acknowledge);
    assert_eq!((unacknowledged, statistics.send_errors()), (1, 1));
    assert_eq!(offered(&mut runner).len(), 2);
}

#[test]
fn a_driver_that_only_errs_ends_every_poll() {
    let clock = Cell::new(Instant::START);
    let mut can = Scripted::default();
    can.receive.extend((0..1000).map(|_| Err(nb::Error::Other(ErrorKind::Other))));
    let mut runner = Runner::new(Nb(can), &clock, Bus::new());
    assert_eq!(runner.poll(16), 0);
    assert_eq!(runner.statistics().receive_errors_of(ErrorKind::Other), 16);
}

#[test]
fn a_flood_of_foreign_frames_is_bounded_and_handed_back_in_order() {
    let clock = Cell::new(Instant::START);
    let mut can = Scripted::default();
    let flood: Vec<CanFrame> = (0..100)
        .map(|id| CanFrame::new(StandardId::new(0x300 + id).unwrap(), &[1]).unwrap())
        .collect();
    can.receive.extend(flood.iter().map(|frame| Ok(*frame)));
    let mut runner = Runner::new(Nb(can), &clock, Bus::new());
    let mut seen = Vec::new();
    assert_eq!(runner.poll_with(30, |frame| seen.push(*frame)), 30);
    assert_eq!(seen, flood[..30]);
    assert_eq!(runner.statistics().unrelated, 30);
}

#[test]
fn a_bus_that_takes_nothing_for_100_ms_disarms_and_offers_zeros_afterwards() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    runner.port_mut().0.always = Some(nb::Error::Other(ErrorKind::Other));
    for ms in 0..150 {
        clock.set(clock.get() + Duration::from_millis(1));
        hear(&mut runner, &clock);
        _ = runner.device_mut().set_raw(wheels[0], 900);
        runner.tick(Tick::new(clock.get(), 0.001));
        assert_eq!(runner.is_armed(), ms < 100, "{ms}");
    }
    assert_eq!((runner.is_bus_down(), runner.statistics().bus_losses), (true, 1));
    let tick = Tick::new(clock.get(), 0.001);
    assert_eq!(runner.arm(tick), Err(ArmError::BusDown));
    runner.port_mut().0.always = None;
    _ = offered(&mut runner);
    clock.set(clock.get() + Duration::from_millis(1));
    runner.tick(Tick::new(clock.get(), 0.001));
    assert_eq!(offered(&mut runner), [(0x200, 0), (0x1FF, 0)]);
    assert!(!runner.is_bus_down() && !runner.is_armed());
    assert_eq!(runner.arm(tick), Err(ArmError::NotReleased), "asked for while the bus was down");
    pause(&mut runner, &clock);
    assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Ok(()));
}

/// 100 ms without a request to arm.
fn pause(runner: &mut TestRunner<'_>, clock: &Cell<Instant>) {
    for _ in 0..100 {
        clock.set(clock.get() + Duration::from_millis(1));
        hear(runner, clock);
        runner.tick(Tick::new(clock.get(), 0.001));
    }
}

#[test]
fn one_frame_that_never_leaves_is_a_lost_bus_though_its_neighbour_does() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    let step = |runner: &mut TestRunner<'_>, raw| {
        clock.set(clock.get() + Duration::from_millis(1));
        hear(runner, &clock);
        for wheel in wheels {
            _ = runner.device_mut().set_raw(wheel, raw);
        }
        runner.tick(Tick::new(clock.get(), 0.001));
    };
    runner.port_mut().0.stuck = Some(0x1FF);
    for ms in 1..=150 {
        step(&mut runner, 900);
        assert_eq!(runner.is_armed(), ms <= 100, "{ms}");
    }
    assert!(runner.is_bus_down() && runner.statistics().bus_losses == 1);
    assert_eq!(runner.next_edge().map(|edge| edge.condition), Some(BusCondition::Down));
    let newest = offered(&mut runner).into_iter().rfind(|(id, _)| *id == 0x200);
    assert_eq!(newest, Some((0x200, 0)), "the healthy one stops its motors");
    assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Err(ArmError::BusDown));
    runner.port_mut().0.stuck = None;
    step(&mut runner, 900);
    assert!(!runner.is_bus_down() && runner.next_edge().is_some_and(|edge| !edge.began));
}

#[test]
fn a_frame_no_longer_offered_does_not_count_as_unsent() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, _) = driving(&clock);
    runner.port_mut().0.stuck = Some(0x1FF);
    let run = |runner: &mut TestRunner<'_>, ticks| {
        for _ in 0..ticks {
            clock.set(clock.get() + Duration::from_millis(1));
            runner.tick(Tick::new(clock.get(), 0.001));
        }
        runner.is_bus_down()
    };
    assert!(run(&mut runner, 200));
    let mut other = Bus::new();
    other.attach(Config::<M3508>::at_once(1)).unwrap();
    *runner.device_mut() = other;
    assert!(run(&mut runner, 30) && !run(&mut runner, 3));
}

/// Runs three frames over a driver that fails one call in each tick; returns how often each frame left.
fn sent_beside_a_failure(place: usize) -> [usize; 3] {
    let clock = Cell::new(Instant::from_micros(1_000));
    let mut bus = Bus::new();
    bus.attach_all([1, 5].map(Config::<M3508>::at_once)).unwrap();
    bus.attach(Config::<crate::dji::Gm6020Voltage>::new(5)).unwrap();
    let bus = bus.with_keep_alive(Duration::ZERO);
    let mut runner = Runner::new(Nb(Scripted::default()), &clock, bus);
    let mut sent = [0; 3];
    for _ in 0..400 {
        clock.set(clock.get() + Duration::from_millis(1));
        let mut answers = [Ok(None); 3];
        answers[place] = Err(nb::Error::Other(ErrorKind::Bit));
        runner.port_mut().0.transmit = answers.into();
        runner.tick(Tick::new(clock.get(), 0.001));
        let tried = offered(&mut runner);
        assert_eq!(tried.len(), 3);
        let taken = tried.into_iter().enumerate().filter(|(index, _)| *index != place);
        for (_, (id, _)) in taken {
            let frame = [0x200, 0x1FF, 0x2FF].iter().position(|known| *known == id);
            sent[frame.unwrap()] += 1;
        }
    }
    assert!(!runner.is_bus_down() && runner.statistics().bus_losses == 0);
    sent
}

#[test]
fn a_driver_that_fails_one_call_a_tick_keeps_no_frame_from_the_bus() {
    for place in 0..3 {
        let sent = sent_beside_a_failure(place);
        assert!(sent.iter().all(|times| *times >= 100), "{place}: {sent:?}");
        assert_eq!(sent.iter().sum::<usize>(), 800);
    }
}

#[test]
fn the_emergency_stop_acts_on_the_next_tick_and_stays() {
    static STOP: EmergencyStop = EmergencyStop::new();
    let clock = Cell::new(Instant::from_micros(1_000));
    let (runner, wheels) = driving(&clock);
    let mut runner = runner.with_emergency_stop(&STOP);
    set(&mut runner, wheels, 50);
    STOP.set();
    clock.set(clock.get() + Duration::from_millis(1));
    runner.tick(Tick::new(clock.get(), 0.001));
    assert!(offered(&mut runner).iter().all(|(_, raw)| *raw == 0));
    assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Err(ArmError::Stopped));
    runner.clear_emergency_stop();
    assert!(!runner.is_armed());
    clock.set(clock.get() + Duration::from_millis(99));
    hear(&mut runner, &clock);
    assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Err(ArmError::NotReleased));
    pause(&mut runner, &clock);
    assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Ok(()));
}

#[test]
fn frames_add_up() {
    let clock = Cell::new(Instant::from_micros(1_000));
    let (mut runner, wheels) = driving(&clock);
    let answers = [Ok(None), Err(nb::Error::WouldBlock), Err(nb::Error::Other(ErrorKind::Bit))];
    for round in 0..3_000_usize {
        clock.set(clock.get() + Duration::from_millis(1));
        let id = 0x1FE + u16::try_from(round % 16).unwrap();
        let length = round % 9;
        let received = CanFrame::new(StandardId::new(id).unwrap(), &[0; 8][..length]).unwrap();
        _ = runner.ingest(&received, clock.get());
        hear(&mut runner, &clock);
        set(&mut runner, wheels, 3);
        runner.port_mut().0.transmit.push_back(answers[round % 3]);
        runner.tick(Tick::new(clock.get(), 0.001));
    }
    let (s, bus) = (runner.statistics(), runner.device().counters());
    assert_eq!(s.received, s.taken + s.unrelated + s.malformed);
    assert_eq!(s.offered, s.sent + s.refused + s.send_errors());
    assert_eq!(s.malformed, bus.bad_length + bus.bad_field);
    assert!(bus.packed >= s.sent && s.bus_losses == 0);
}

/// A driver that only sends, and counts requests for a frame, which would be blocking.
#[derive(Default)]
struct Blocking {
    sent: Vec<CanFrame>,
    asked: u32,
}

impl embedded_can::blocking::Can for Blocking {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> Result<(), ErrorKind> {
        self.sent.push(*frame);
        if self.sent.len().is_multiple_of(2) { Err(ErrorKind::Stuff) } else { Ok(()) }
    }

    fn receive(&mut self) -> Result<CanFrame, ErrorKind> {
        self.asked += 1;
        Err(ErrorKind::Other)
    }
}

#[test]
fn a_blocking_driver_sends_and_is_never_asked_for_a_frame() {
    let clock = Cell::new(Instant::START);
    let mut bus = Bus::new();
    bus.attach(Config::<M3508>::at_once(1)).unwrap();
    let mut runner = Runner::new(BlockingTx(Blocking::default()), &clock, bus);
    assert_eq!(runner.poll(100), 0);
    for _ in 0..30 {
        clock.set(clock.get() + Duration::from_millis(1));
        let tick = runner.due().unwrap();
        runner.tick(tick);
    }
    let s = runner.statistics();
    assert!(s.sent >= 2 && s.send_errors_of(ErrorKind::Stuff) >= 1);
    assert_eq!(s.offered, s.sent + s.send_errors_of(ErrorKind::Stuff));
    assert_eq!(runner.port_mut().0.asked, 0);
}
