//! F51 to F56 and F70: what the driver does with frames.

use crate::case::{Case, cases, safe_after, saw};
use crate::rig::{Rig, armed, at_ms, at_once, feedback, words};
use drivetrain::dji::{Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{ArmError, Link};
use drivetrain::runner::{BusCondition, Nb, Runner};
use drivetrain::sim::{Fault, Line, Simulation};
use drivetrain::time::{Duration, Tick};
use embedded_can::ErrorKind;
use std::cell::Cell;
use std::collections::VecDeque;

/// The cases of this file.
pub(crate) const CASES: &[Case] = cases![
    f51_would_block_keeps_the_newest_value_and_starves_nobody,
    f52_an_evicted_frame_is_offered_again_with_its_newest_value,
    f53_driver_errors_are_counted_by_kind_and_the_loop_goes_on,
    f54_after_bus_off_only_stale_mailboxes_and_then_zeros_until_rearmed,
    f55_a_flood_of_foreign_frames_is_handed_back_in_order_and_hurts_nobody,
    f56_two_buses_share_nothing,
    f70_a_driver_that_gives_each_frame_back_is_a_bus_that_is_down,
];

/// Answers as scripted, then takes everything.
#[derive(Default)]
struct Scripted {
    answers: VecDeque<Result<Option<CanFrame>, nb::Error<ErrorKind>>>,
    always: Option<nb::Error<ErrorKind>>,
    taken: Vec<CanFrame>,
}

impl embedded_can::nb::Can for Scripted {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        let answer = self.always.map_or_else(|| self.answers.pop_front().unwrap_or(Ok(None)), Err);
        if answer.is_ok() {
            self.taken.push(*frame);
        }
        answer
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

/// Runs two motors of two frames, at values that count up, over a driver that `script` prepares for each tick.
fn run(
    ticks: u64,
    mut script: impl FnMut(&mut Scripted, u64),
) -> (Vec<CanFrame>, drivetrain::runner::Statistics) {
    let clock = Cell::new(at_ms(1));
    let (bus, wheels) = armed([1, 5].map(Config::new));
    let mut runner = Runner::new(Nb(Scripted::default()), &clock, bus);
    for round in 1..=ticks {
        clock.set(clock.get() + Duration::from_millis(1));
        for id in [0x201, 0x205] {
            _ = runner.ingest(&feedback(id, 0, 0), clock.get());
        }
        for wheel in wheels {
            _ = runner.device_mut().set_raw(wheel, i16::try_from(round % 10_000).unwrap());
        }
        script(&mut runner.port_mut().0, round);
        runner.tick(Tick::new(clock.get(), 0.001));
    }
    (core::mem::take(&mut runner.port_mut().0.taken), runner.statistics())
}

fn of(frames: &[CanFrame], id: u32) -> Vec<i16> {
    frames.iter().filter(|frame| frame.header() == id).map(|frame| words(frame)[0]).collect()
}

#[cfg_attr(test, test)]
fn f51_would_block_keeps_the_newest_value_and_starves_nobody() {
    // Once, in the middle: the frame comes with the next tick, with its value.
    let (taken, _) = run(3, |can, round| {
        if round == 2 {
            can.answers.extend([Ok(None), Err(nb::Error::WouldBlock)]);
        }
    });
    assert_eq!((of(&taken, 0x200), of(&taken, 0x1FF)), (vec![1, 2, 3], vec![1, 3]));
    // Between two frames, in every tick: both get through.
    let (taken, statistics) =
        run(1_000, |can, _| can.answers.extend([Ok(None), Err(nb::Error::WouldBlock)]));
    let (one, other) = (of(&taken, 0x200), of(&taken, 0x1FF));
    assert!(one.len() >= 450 && other.len() >= 450, "{} {}", one.len(), other.len());
    assert!(one.is_sorted() && other.is_sorted(), "never an older value after a newer one");
    assert_eq!(statistics.offered, statistics.sent + statistics.refused);
    // For ever: the loop ends, and afterwards the newest goes out.
    let (taken, statistics) = run(90, |can, round| {
        can.always = (round < 90).then_some(nb::Error::WouldBlock);
    });
    assert_eq!((of(&taken, 0x200), of(&taken, 0x1FF)), (vec![90], vec![90]));
    assert_eq!((statistics.refused, statistics.bus_losses), (89, 0));
    saw(format!(
        "blocked in each tick: {} and {} of 1000 frames; for ever: the newest",
        one.len(),
        other.len()
    ));
}

#[cfg_attr(test, test)]
fn f52_an_evicted_frame_is_offered_again_with_its_newest_value() {
    let (taken, statistics) = run(3, |can, round| {
        if round == 2 {
            // 0x1FF takes the place of 0x200.
            let mut evicted = [0; 8];
            evicted[1] = 2;
            can.answers.extend([Ok(None), Ok(CanFrame::standard(0x200, evicted))]);
        }
    });
    assert_eq!(statistics.evicted, 1);
    assert_eq!(taken[4].header(), 0x200, "first in the next tick");
    assert_eq!(of(&taken, 0x200), [1, 2, 3]);
    saw("first in the next tick, with its value");
}

#[cfg_attr(test, test)]
fn f53_driver_errors_are_counted_by_kind_and_the_loop_goes_on() {
    let kinds = [ErrorKind::Acknowledge, ErrorKind::Stuff, ErrorKind::Other];
    let (taken, statistics) = run(900, |can, round| {
        let kind = kinds[usize::try_from(round % 3).unwrap()];
        let error = Err(nb::Error::Other(kind));
        can.answers.extend(if round % 2 == 0 { [error, Ok(None)] } else { [Ok(None), error] });
    });
    let errors_by_kind = statistics.send_errors();
    let errors = kinds.map(|kind| statistics.send_errors_of(kind));
    assert_eq!((errors, errors_by_kind), ([300, 300, 300], 900));
    assert!(of(&taken, 0x200).len() >= 400 && of(&taken, 0x1FF).len() >= 400);

    let world = Simulation::new(1);
    let mut rig = Rig::new(&world, Line::Can1, 1);
    let errors = Fault::DriverErrors { line: Line::Can1, probability: 0.5 };
    world.fault(errors, at_ms(600)..at_ms(1_100)).unwrap();
    rig.drive(1_200);
    let statistics = rig.runner.statistics();
    assert!(statistics.receive_errors() > 100 && statistics.send_errors() > 100);
    assert_eq!(rig.link(0), Link::Online);
    assert!(rig.words(0, 600, 1_200).iter().all(|word| *word > 0));
    saw(format!("{} by kind; {} more on the simulator", errors_by_kind, statistics.send_errors()));
}

#[cfg_attr(test, test)]
fn f54_after_bus_off_only_stale_mailboxes_and_then_zeros_until_rearmed() {
    for (fault, stale_at_most) in
        [(Fault::BusOff(Line::Can1), 3), (Fault::Unplugged(Line::Can1), 3)]
    {
        let world = Simulation::new(6);
        let mut rig = Rig::new(&world, Line::Can1, 1);
        rig.trust_mailboxes = false;
        world.fault(fault, at_ms(300)..at_ms(600)).unwrap();
        rig.drive(550);
        assert!(rig.runner.is_bus_down() && !rig.runner.is_armed(), "{fault:?}");
        let tick = Tick::new(world.now(), 0.001);
        assert_eq!(rig.runner.arm(tick), Err(ArmError::BusDown));
        rig.drive(400);
        let after = rig.words(0, 600, 950);
        let stale = after.iter().filter(|word| **word != 0).count();
        assert!(stale <= stale_at_most, "{fault:?}: {stale}");
        assert!(after[stale..].iter().all(|word| *word == 0), "old ones first, then zeros");
        assert_eq!(rig.runner.statistics().bus_losses, 1);
        let down: Vec<_> =
            rig.runner.edges().filter(|edge| edge.condition == BusCondition::Down).collect();
        assert_eq!(down.len(), 2, "{fault:?}: {down:?}");
        let (began, ended) = (down[0], down[1]);
        assert!(began.began && (at_ms(399)..at_ms(405)).contains(&began.at), "{began}");
        assert!(!ended.began && (at_ms(599)..at_ms(605)).contains(&ended.at), "{ended}");
        assert!(!rig.runner.is_bus_down() && !rig.runner.is_armed());
        rig.runner.arm(Tick::new(world.now(), 0.001)).unwrap();
        rig.drive(50);
        assert!(rig.words(0, 960, 1_000).iter().all(|word| *word > 0));
        safe_after(stale as u64 + 1);
        saw(format!("{fault:?}: {stale} stale, then zeros until armed"));
    }
    // With the driver's abort there is no stale frame at all.
    let world = Simulation::new(6);
    let mut rig = Rig::new(&world, Line::Can1, 1);
    rig.trust_mailboxes = false;
    world.fault(Fault::Unplugged(Line::Can1), at_ms(300)..at_ms(600)).unwrap();
    rig.drive(550);
    rig.runner.port_mut().0.abort_pending();
    rig.drive(100);
    let stale = rig.words(0, 600, 650).into_iter().filter(|word| *word != 0).count();
    assert!(stale <= 1, "{stale}: only the one in transmission");
    saw(format!("with abort: {stale}"));
}

#[cfg_attr(test, test)]
fn f55_a_flood_of_foreign_frames_is_handed_back_in_order_and_hurts_nobody() {
    let world = Simulation::new(7);
    let mut rig = Rig::new(&world, Line::Can1, 2);
    let foreign = CanFrame::standard(0x7A5, [0x55; 8]).unwrap();
    let flood =
        Fault::Flood { line: Line::Can1, frame: foreign, period: Duration::from_micros(100) };
    world.fault(flood, at_ms(600)..at_ms(1_600)).unwrap();
    rig.drive(600);
    let before = world.traffic(Line::Can1);
    rig.drive(1_000);
    assert!(world.traffic(Line::Can1).since(&before).load() > 0.9);
    rig.drive(100);
    assert!(rig.unrelated.len() > 5_000, "{}: the bus is full", rig.unrelated.len());
    assert!(rig.unrelated.iter().all(|frame| *frame == foreign));
    assert_eq!(rig.runner.statistics().receive_errors(), 0);
    assert!((0..2).all(|wheel| rig.link(wheel) == Link::Online));
    assert!(rig.words(0, 600, 1_700).iter().all(|word| *word > 0));
    saw(format!("{} handed back, none lost, driven all the time", rig.unrelated.len()));
}

#[cfg_attr(test, test)]
fn f56_two_buses_share_nothing() {
    let run = |trouble: bool| {
        let world = Simulation::new(8);
        let mut left = Rig::new(&world, Line::Can1, 2);
        let mut right = Rig::new(&world, Line::Can2, 2);
        if trouble {
            world.fault(Fault::BusOff(Line::Can1), at_ms(300)..at_ms(800)).unwrap();
        }
        let mut commands = Vec::new();
        let spins = |rig: &mut Rig<'_>| {
            let wheels = rig.wheels.clone();
            rig.poll_and_tick(|bus, _| {
                for wheel in &wheels {
                    _ = bus.set_velocity(*wheel, crate::rig::rpm(200.0));
                }
            });
        };
        for _ in 0..10_000 {
            world.advance_with(Duration::from_micros(100), |record| {
                if record.line == Line::Can2 {
                    commands.push((record.at, record.frame));
                }
            });
            spins(&mut left);
            spins(&mut right);
        }
        assert_eq!(left.runner.statistics().bus_losses, u32::from(trouble));
        assert!(right.runner.is_armed() && right.runner.statistics().bus_losses == 0);
        commands
    };
    let (troubled, healthy) = (run(true), run(false));
    assert_eq!(troubled, healthy, "one bus fails, the other's frames are the same to the bit");
    saw(format!("{} frames of the other bus, the same to the bit", healthy.len()));
}

/// Mailboxes on a bus that takes nothing: a new frame takes the place of the one that has waited longest, which is given back.
struct Mailboxes {
    waiting: VecDeque<CanFrame>,
    places: usize,
    /// The bus takes what waits, before each frame that is offered.
    sends: bool,
    /// What it took.
    sent: Vec<CanFrame>,
}

impl embedded_can::nb::Can for Mailboxes {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        if self.sends {
            self.sent.extend(self.waiting.drain(..));
        }
        self.waiting.push_back(*frame);
        Ok((self.waiting.len() > self.places).then(|| self.waiting.pop_front().unwrap()))
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

/// With no place at all each frame comes back at once. At 330c201: 100 000 sent, 100 000 evicted, `is_bus_down` false.
#[cfg_attr(test, test)]
fn f70_a_driver_that_gives_each_frame_back_is_a_bus_that_is_down() {
    let mut down_after = Vec::new();
    for (ids, places) in
        [(&[1_u8][..], 0), (&[1], 1), (&[1], 3), (&[1, 5], 0), (&[1, 5], 1), (&[1, 5], 3)]
    {
        let clock = Cell::new(at_ms(1));
        let mut bus = drivetrain::dji::Bus::new();
        let wheels: Vec<_> =
            ids.iter().map(|id| bus.attach(at_once::<M3508>(*id)).unwrap()).collect();
        let port = Mailboxes { waiting: VecDeque::new(), places, sends: true, sent: Vec::new() };
        let mut runner = Runner::new(Nb(port), &clock, bus);
        let turn = |runner: &mut Runner<Nb<Mailboxes>, _, drivetrain::dji::Bus>| {
            clock.set(clock.get() + Duration::from_millis(1));
            for id in [0x201, 0x205] {
                _ = runner.ingest(&feedback(id, 0, 0), clock.get());
            }
            for wheel in &wheels {
                _ = runner.device_mut().set_raw(*wheel, 700);
            }
            let tick = runner.due().unwrap();
            runner.tick(tick);
            tick
        };
        let what = format!("{} motors, {places} mailboxes", ids.len());
        let tick = turn(&mut runner);
        assert_eq!(runner.arm(tick), Ok(()));
        // As long as the bus takes what waits, a frame may be given back for another, and nothing is wrong.
        let is_well = places >= ids.len();
        for _ in 0..if is_well { 500 } else { 0 } {
            turn(&mut runner);
            assert!(!runner.is_bus_down() && runner.is_armed(), "{what}");
        }
        let sent = runner.port_mut().0.sent.len();
        assert_eq!(sent > 400, is_well, "{what}: {sent}");
        // Then it takes nothing any more.
        runner.port_mut().0.sends = false;
        let begin = clock.get();
        while !runner.is_bus_down() {
            turn(&mut runner);
            assert!(clock.get() < begin + Duration::from_millis(200), "{what}: never down");
        }
        down_after.push(clock.get().since(begin).as_micros() / 1_000);
        assert!(!runner.is_armed(), "{what}");
        assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Err(ArmError::BusDown), "{what}");
        let down = runner.edges().find(|edge| edge.condition == BusCondition::Down).unwrap();
        assert!(down.began && down.at == clock.get(), "{what}");
        for _ in 0..1_000 {
            turn(&mut runner);
            assert!(runner.is_bus_down(), "{what}: as long as nothing leaves");
        }
        // What waits now is zero: the frames of the tick after it was found to be down.
        let waiting = &runner.port_mut().0.waiting;
        assert!(waiting.iter().all(|frame| *frame.bytes() == [0; 8]), "{what}");
        let statistics = runner.statistics();
        assert_eq!(statistics.bus_losses, 1, "{what}: {statistics:?}");
        if is_well {
            // It is up again with the frames that stay, and waits to be armed.
            runner.port_mut().0.sends = true;
            for _ in 0..100 {
                turn(&mut runner);
            }
            assert!(!runner.is_bus_down() && !runner.is_armed(), "{what}");
            assert_eq!(runner.arm(Tick::new(clock.get(), 0.001)), Ok(()), "{what}");
        }
    }
    let (first, last) = (down_after.iter().min().unwrap(), down_after.iter().max().unwrap());
    assert!(*first >= 99 && *last <= 115, "{down_after:?}");
    safe_after(*last);
    saw(format!("down after {first} to {last} ms, disarmed, arming refused"));
}
