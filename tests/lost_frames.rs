//! Every way in which a command frame can get lost between a device and the bus: refused by the driver, failed, evicted,
//! given back when it is old, never taken. For each kind of device, and for devices made of devices.

#![cfg(test)]

#[expect(dead_code, reason = "shared with the tests of arming")]
#[path = "arming/own.rs"]
mod own;

use drivetrain::dji::{AnyHandle, Bus, Config, Gm6020Voltage, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Devices;
use drivetrain::motor::{Actuator, Ingest, VelocityDrive};
use drivetrain::runner::{BusCondition, Nb, Runner};
use drivetrain::snake::{self, Command, Joint, Joints, Register};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use embedded_can::{ErrorKind, Frame, StandardId};
use own::{Mine, healthy, own};
use std::cell::Cell;
use std::collections::VecDeque;

/// What becomes of a frame that is offered to the driver.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fate {
    Taken,
    Refused,
    Failed,
    /// Taken, in the place of the frame with this id that was taken last.
    Evicts(u32),
}

/// A driver that does as it is told, and then takes everything. What it took and was not evicted goes to the bus when the
/// tick is over.
#[derive(Default)]
struct Driver {
    fates: VecDeque<Fate>,
    always: Option<Fate>,
    /// The frame that fails each time.
    stuck: Option<u32>,
    boxes: Vec<CanFrame>,
}

impl embedded_can::nb::Can for Driver {
    type Frame = CanFrame;
    type Error = ErrorKind;
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        let stuck = (self.stuck == Some(frame.header())).then_some(Fate::Failed);
        let fate = self.fates.pop_front().or(self.always).or(stuck).unwrap_or(Fate::Taken);
        let evicted = match fate {
            Fate::Refused => return Err(nb::Error::WouldBlock),
            Fate::Failed => return Err(nb::Error::Other(ErrorKind::Acknowledge)),
            Fate::Taken => None,
            Fate::Evicts(id) => {
                let place = self.boxes.iter().rposition(|frame| frame.header() == id);
                place.map(|place| self.boxes.remove(place))
            }
        };
        self.boxes.push(*frame);
        Ok(evicted)
    }
    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

/// A device whose motors are heard and told to drive, and what is left on the bus of each tick.
struct Bench<'c, D> {
    runner: Runner<Nb<Driver>, &'c Cell<Instant>, D>,
    clock: &'c Cell<Instant>,
    feedback: Vec<CanFrame>,
    drive: fn(&mut D),
}

impl<'c, D: Devices> Bench<'c, D> {
    /// Armed, and driven for so long that the output may be anything.
    fn new(clock: &'c Cell<Instant>, device: D, feedback: &[CanFrame], drive: fn(&mut D)) -> Self {
        clock.set(clock.get() + Duration::from_secs(1));
        let runner = Runner::new(Nb(Driver::default()), clock, device);
        let mut bench = Self { runner, clock, feedback: feedback.to_vec(), drive };
        bench.tick();
        let tick = bench.now();
        bench.runner.arm(tick).unwrap();
        (0..300).for_each(|_| _ = bench.tick());
        assert!(bench.tick().iter().all(drives), "each frame drives");
        bench
    }

    fn now(&self) -> Tick {
        Tick::new(self.clock.get(), 0.001)
    }

    /// A millisecond; returns what goes to the bus.
    fn tick(&mut self) -> Vec<CanFrame> {
        self.clock.set(self.clock.get() + Duration::from_millis(1));
        let tick = self.now();
        for frame in &self.feedback {
            assert_eq!(self.runner.ingest(frame, tick.now()), Ingest::Taken);
        }
        (self.drive)(self.runner.device_mut());
        self.runner.tick(tick);
        std::mem::take(&mut self.runner.port_mut().0.boxes)
    }

    /// A millisecond with these fates, then with none.
    fn tick_with(&mut self, fates: &[Fate]) -> Vec<CanFrame> {
        self.runner.port_mut().0.fates = fates.iter().copied().collect();
        let sent = self.tick();
        self.runner.port_mut().0.fates.clear();
        sent
    }

    /// The ids of the frames that go out in a tick, in their order.
    fn ids(&mut self) -> Vec<u32> {
        self.tick().iter().map(CanFrame::header).collect()
    }
}

fn drives(frame: &CanFrame) -> bool {
    *frame.bytes() != [0; 8]
}

/// Runs a test on each kind of device: what it is called, its command ids in the order of offering, the device, what its
/// motors send, how they are driven.
macro_rules! on_each_device {
    ($test:ident) => {
        let clock = Cell::new(Instant::START);
        let wheel = |id: u16| CanFrame::standard(id, [0x10, 0, 0, 0, 0, 0, 30, 0]).unwrap();
        let two = [wheel(0x201), wheel(0x205)];
        $test("a bus", &[0x200, 0x1FF], || Bench::new(&clock, bus(), &two, drive_bus));
        $test("&mut", &[0x200, 0x1FF], || {
            Bench::new(&clock, &mut *Box::leak(Box::new(bus())), &two, |bus| drive_bus(bus))
        });
        $test("an actuator", &[0x101], || Bench::new(&clock, own(1), &[healthy(1)], drive_own));
        let three = [1, 2, 3].map(healthy);
        $test("an array", &[0x101, 0x102, 0x103], || {
            Bench::new(&clock, [1, 2, 3].map(own), &three, |motors| {
                motors.iter_mut().for_each(drive_own)
            })
        });
        let mixed = [wheel(0x201), wheel(0x205), healthy(1), healthy(2)];
        $test("a tuple", &[0x200, 0x1FF, 0x101, 0x102], || {
            Bench::new(&clock, (bus(), own(1), [own(2)]), &mixed, |(bus, one, [two])| {
                drive_bus(bus);
                drive_own(one);
                drive_own(two);
            })
        });
    };
}

/// Two motors in two command frames. Zeros are not repeated on their own while a test runs.
fn bus() -> Bus {
    let mut bus = Bus::new().with_keep_alive(Duration::from_secs(10));
    bus.attach_all([1, 5].map(Config::<M3508>::new)).unwrap();
    bus
}

fn drive_bus(bus: &mut Bus) {
    let motors: Vec<AnyHandle> = bus.motors().map(|(motor, _)| motor).collect();
    for motor in motors {
        _ = bus.set_raw(motor, 5_000);
    }
}

fn drive_own(motor: &mut Actuator<Mine>) {
    _ = motor.set_velocity((), AngularVelocity::from_rad_per_s(1.0));
}

/// Every fate of a first tick in which the frames with these ids are offered, that loses at least one of them.
fn losses(ids: &[u32]) -> Vec<Vec<Fate>> {
    let mut losses = vec![vec![Fate::Refused], vec![Fate::Failed; ids.len()]];
    for place in 0..ids.len() {
        let mut one = vec![Fate::Taken; ids.len()];
        one[place] = Fate::Failed;
        losses.push(one.clone());
        one[place] = Fate::Refused;
        losses.push(one);
    }
    // A later frame takes the place of an earlier one, whatever the order in which they are offered.
    for later in 1..ids.len() {
        for victim in ids {
            let mut one = vec![Fate::Taken; ids.len()];
            one[later] = Fate::Evicts(*victim);
            losses.push(one);
        }
    }
    losses
}

/// The zeros of a stop reach the bus in the tick after the one in which they were lost, whatever was lost of them.
fn zeros_come_again<'c, D: Devices + 'c>(name: &str, ids: &[u32], make: impl Fn() -> Bench<'c, D>) {
    let stops: [fn(&mut D); 2] = [D::disarm, D::emergency_stop];
    for stop in stops {
        for fates in losses(ids) {
            let mut bench = make();
            stop(bench.runner.device_mut());
            let mut sent = bench.tick_with(&fates);
            sent.extend(bench.tick());
            for id in ids {
                let zeros = sent.iter().any(|frame| frame.header() == *id);
                assert!(zeros, "{name}, {fates:?}: no zeros on {id:#X}");
            }
            assert!(!sent.iter().any(drives), "{name}, {fates:?}: {sent:?}");
            assert_eq!(bench.runner.statistics().evicted_unrelated, 0, "{name}: its own frames");
        }
    }
}

#[test]
fn the_zeros_of_a_stop_that_are_lost_go_out_in_the_next_tick() {
    on_each_device!(zeros_come_again);
}

/// What waits when the device is stopped, and was not taken yet, is replaced by zeros.
fn waiting_frames_turn_to_zeros<'c, D: Devices + 'c>(
    name: &str,
    ids: &[u32],
    make: impl Fn() -> Bench<'c, D>,
) {
    let stops: [fn(&mut D); 2] = [D::disarm, D::emergency_stop];
    for stop in stops {
        for taken in 0..ids.len() {
            let mut bench = make();
            bench.clock.set(bench.clock.get() + Duration::from_millis(1));
            let tick = bench.now();
            for frame in bench.feedback.clone() {
                assert_eq!(bench.runner.ingest(&frame, tick.now()), Ingest::Taken);
            }
            (bench.drive)(bench.runner.device_mut());
            let device = bench.runner.device_mut();
            device.update(tick);
            for _ in 0..taken {
                assert!(device.next_frame(0).is_some_and(|frame| drives(&frame)), "{name}");
            }
            stop(device);
            let waiting: Vec<CanFrame> = std::iter::from_fn(|| device.next_frame(0)).collect();
            for id in ids {
                assert!(waiting.iter().any(|frame| frame.header() == *id), "{name}: {id:#X}");
            }
            assert!(!waiting.iter().any(drives), "{name}, {taken} taken: {waiting:?}");
        }
    }
}

#[test]
fn a_stop_in_the_middle_of_a_cycle_lets_no_older_command_through() {
    on_each_device!(waiting_frames_turn_to_zeros);
}

/// So do the zeros of a target that grew old, in each tick again until one gets through.
fn zeros_come_until_they_are_taken<'c, D: Devices + 'c>(
    name: &str,
    ids: &[u32],
    make: impl Fn() -> Bench<'c, D>,
) {
    for fate in [Fate::Refused, Fate::Failed] {
        let mut bench = make();
        bench.drive = |_| {};
        // 100 ms after the last target; less than 100 ms are lost, or the bus counts as down.
        (0..90).for_each(|_| assert!(bench.tick().iter().all(drives)));
        bench.runner.port_mut().0.always = Some(fate);
        (0..60).for_each(|_| assert_eq!(bench.tick(), []));
        bench.runner.port_mut().0.always = None;
        let mut sent = bench.ids();
        sent.sort_unstable();
        let mut expected = ids.to_vec();
        expected.sort_unstable();
        assert_eq!(sent, expected, "{name}, {fate:?}");
        assert!(!bench.runner.is_bus_down() && bench.runner.is_armed());
    }
}

#[test]
fn the_zeros_of_an_old_target_are_offered_until_the_driver_takes_them() {
    on_each_device!(zeros_come_until_they_are_taken);
}

/// What comes again has the newest values.
fn newest_values_come<'c, D: Devices + 'c>(
    name: &str,
    ids: &[u32],
    make: impl Fn() -> Bench<'c, D>,
) {
    for fates in losses(ids) {
        let mut bench = make();
        bench.tick_with(&fates);
        bench.runner.device_mut().disarm();
        bench.drive = |_| {};
        let sent = bench.tick();
        assert!(sent.len() >= ids.len() && !sent.iter().any(drives), "{name}, {fates:?}: {sent:?}");
    }
}

#[test]
fn a_frame_that_was_lost_does_not_come_again_with_what_it_said() {
    on_each_device!(newest_values_come);
}

// With evicted frames left out of the watch, every other test passed: the 100 ms began with the next refusal.
fn evicted_is_lost_from_then_on<'c, D: Devices + 'c>(
    name: &str,
    ids: &[u32],
    make: impl Fn() -> Bench<'c, D>,
) {
    for later in 1..ids.len() {
        let mut evicted = 0;
        for victim in ids {
            let mut bench = make();
            let mut fates = vec![Fate::Taken; ids.len()];
            fates[later] = Fate::Evicts(*victim);
            let sent = bench.tick_with(&fates);
            if sent.iter().any(|frame| frame.header() == *victim) {
                continue; // it was not offered before the other one
            }
            evicted += 1;
            // From now on it fails, and it alone.
            bench.runner.port_mut().0.stuck = Some(*victim);
            for ms in 1..=120 {
                let armed = bench.runner.is_armed();
                assert_eq!(armed, ms <= 100, "{name}: {ms} ms after {victim:#X} was evicted");
                bench.tick();
            }
            assert!(bench.runner.has(BusCondition::Down));
        }
        assert_eq!(evicted, later, "{name}: each frame that was offered before");
    }
}

#[test]
fn a_frame_is_missing_on_the_bus_from_the_tick_on_in_which_it_was_evicted() {
    on_each_device!(evicted_is_lost_from_then_on);
}

/// A frame that failed as the first one goes last in the next tick. When there is no place for the others then, it must not
/// be forgotten.
#[test]
fn a_frame_that_was_put_behind_the_others_is_not_lost_when_these_find_no_place() {
    let clock = Cell::new(Instant::START);
    let frame = |id| CanFrame::standard(id, [0x10, 0, 0, 0, 0, 0, 30, 0]).unwrap();
    for failed_ticks in 1..10 {
        let mut bench = Bench::new(&clock, bus(), &[0x201, 0x205].map(frame), drive_bus);
        // The first motor rests: its zeros fail again and again, as the first frame or as the last.
        bench.drive = |bus| {
            let motors: Vec<AnyHandle> = bus.motors().map(|(motor, _)| motor).collect();
            bus.relax(motors[0]);
            _ = bus.set_raw(motors[1], 5_000);
        };
        bench.runner.port_mut().0.stuck = Some(0x200);
        for _ in 0..failed_ticks {
            assert_eq!(bench.ids(), [0x1FF]);
        }
        bench.runner.port_mut().0.stuck = None;
        assert_eq!(bench.tick_with(&[Fate::Refused]), []);
        let sent = [bench.tick(), bench.tick()].concat();
        let zeros = sent.iter().find(|frame| frame.header() == 0x200);
        assert!(zeros.is_some_and(|frame| !drives(frame)), "{failed_ticks}: {sent:?}");
    }
}

/// Each way to lose a frame is counted as what it is, and nothing else.
fn losses_are_counted<'c, D: Devices + 'c>(
    name: &str,
    ids: &[u32],
    make: impl Fn() -> Bench<'c, D>,
) {
    for fates in losses(ids) {
        let mut bench = make();
        let before = bench.runner.statistics();
        let sent = bench.tick_with(&fates);
        let after = bench.runner.statistics();
        let offered = after.offered - before.offered;
        let refused = after.refused - before.refused;
        let failed = after.send_errors_of(ErrorKind::Acknowledge)
            - before.send_errors_of(ErrorKind::Acknowledge);
        let evicted = after.evicted - before.evicted;
        let taken = after.sent - before.sent;
        assert_eq!(offered, taken + refused + failed, "{name}, {fates:?}");
        assert_eq!(taken - evicted, u32::try_from(sent.len()).unwrap(), "{name}, {fates:?}");
        assert_eq!(refused, u32::from(fates.contains(&Fate::Refused)), "{name}, {fates:?}");
        assert_eq!((after.evicted_unrelated, after.bus_losses), (0, 0));
        // What was not taken at all is replaced by what comes next.
        bench.tick();
        let replaced = bench.runner.statistics().superseded - before.superseded;
        let waited = u32::try_from(ids.len()).unwrap() - offered;
        assert!(replaced >= waited, "{name}, {fates:?}: {replaced} of {waited}");
    }
}

#[test]
fn each_loss_is_counted_as_what_it_is() {
    on_each_device!(losses_are_counted);
}

/// A frame that comes back was not on the bus, and is no part of its load.
#[test]
fn the_measured_load_is_that_of_the_frames_that_stayed() {
    let clock = Cell::new(Instant::START);
    let two =
        [0x201, 0x205].map(|id| CanFrame::standard(id, [0x10, 0, 0, 0, 0, 0, 30, 0]).unwrap());
    // Every tenth tick loses frames: less than what makes a bus count as down.
    let load = |fates: &[Fate]| {
        let mut bench = Bench::new(&clock, bus(), &two, drive_bus);
        for ms in 0..2_100 {
            bench.tick_with(if ms % 10 == 0 { fates } else { &[] });
        }
        bench.runner.measured_load().unwrap().frames_per_s()
    };
    assert_eq!(load(&[]), 4_000, "two of feedback and two commands a millisecond");
    assert_eq!(load(&[Fate::Taken, Fate::Evicts(0x200)]), 3_900);
    assert_eq!(load(&[Fate::Taken, Fate::Failed]), 3_900);
    assert_eq!(load(&[Fate::Refused]), 3_800);
}

/// An update whose frames nobody takes is one loss for each frame, in each part.
#[test]
fn what_no_one_takes_is_counted_in_each_part_of_a_device() {
    /// Asks whatever it borrows.
    fn of(mut device: impl Devices) -> u32 {
        let device = &mut device;
        device.superseded()
    }
    let updates = |device: &mut Actuator<Mine>, count: u64| {
        for ms in 0..=count {
            device.update(Tick::new(Instant::from_micros(1_000 * (1 + ms)), 0.001));
        }
    };
    let mut array = [1, 2, 3].map(own);
    for (part, count) in array.iter_mut().zip([1, 10, 100]) {
        updates(part, count);
    }
    assert_eq!(of(&mut array), 111);
    let [one, two, three] = array;
    let mut three_parts = (one, two, three);
    assert_eq!(of(&mut three_parts), 111);
    let (one, two, three) = three_parts;
    let mut four_parts = (one, two, own(4), three);
    assert_eq!(of(&mut four_parts), 111);
    let (one, _, _, four) = four_parts;
    assert_eq!(of((one, four)), 101);
}

/// A combination gives a frame back to the part that it is of, wherever that stands.
#[test]
fn a_frame_goes_back_to_the_part_that_it_is_of() {
    let tick = |ms: u64| Tick::new(Instant::from_micros(1_000 * ms), 0.001);
    let zeros = |id: u32| CanFrame::standard(u16::try_from(id).unwrap(), [0; 8]).unwrap();
    fn drain(device: &mut impl Devices) -> Vec<u32> {
        std::iter::from_fn(|| device.next_frame(0)).map(|frame| frame.header()).collect()
    }
    fn buses() -> [Bus; 3] {
        let silent = || Bus::new().with_keep_alive(Duration::from_secs(10));
        let mut buses = [silent(), silent(), silent()];
        buses[0].attach(Config::<M3508>::new(1)).unwrap();
        buses[1].attach(Config::<M3508>::new(5)).unwrap();
        buses[2].attach(Config::<Gm6020Voltage>::new(5)).unwrap();
        buses
    }
    fn check(
        device: &mut impl Devices,
        tick: impl Fn(u64) -> Tick,
        zeros: impl Fn(u32) -> CanFrame,
    ) {
        device.update(tick(1_000));
        assert_eq!(drain(device), [0x200, 0x1FF, 0x2FF]);
        device.update(tick(1_001));
        assert_eq!(drain(device), [0_u32; 0], "zeros are sent once");
        for (ms, id) in (1_002..).zip([0x200, 0x1FF, 0x2FF]) {
            assert!(device.requeue(&zeros(id)), "{id:#X}");
            assert_eq!(drain(device), [0_u32; 0], "not before the next update");
            device.update(tick(ms));
            assert_eq!(drain(device), [id]);
        }
        for foreign in [0x1FE, 0x2FE, 0x201, 0x7FF] {
            assert!(!device.requeue(&zeros(foreign)), "{foreign:#X}");
        }
        let remote = CanFrame::new_remote(StandardId::new(0x1FF).unwrap(), 8).unwrap();
        assert!(!device.requeue(&remote));
    }
    check(&mut buses(), tick, zeros);
    check(&mut &mut buses(), tick, zeros);
    let [a, b, c] = buses();
    check(&mut (a, b, c), tick, zeros);
    let [a, b, c] = buses();
    check(&mut (a, b, Bus::new(), c), tick, zeros);
    let [a, b, c] = buses();
    check(&mut ([a, b], c), tick, zeros);
    let mut motors = (own(1), [own(2), own(3)]);
    for id in [0x101, 0x102, 0x103] {
        assert!(motors.requeue(&zeros(id)), "{id:#X}");
        let remote = CanFrame::new_remote(StandardId::new(u16::try_from(id).unwrap()).unwrap(), 8);
        assert!(!motors.requeue(&remote.unwrap()), "{id:#X}");
    }
    assert!(!motors.requeue(&zeros(0x104)) && !motors.requeue(&zeros(0x181)));
}

/// The frame with the last zeros of a motor that is detached comes again, though the motor is gone.
#[test]
fn the_last_zeros_of_a_detached_motor_are_not_lost() {
    let tick = |ms: u64| Tick::new(Instant::from_micros(1_000 * ms), 0.001);
    let mut bus = Bus::new().with_keep_alive(Duration::from_secs(10));
    let wheel = bus.attach(Config::<M3508>::new(1)).unwrap();
    bus.update(tick(1_000));
    assert!(bus.next_frame().is_some());
    bus.detach(wheel);
    bus.update(tick(1_001));
    let last = bus.next_frame().unwrap();
    assert!(bus.requeue(&last));
    bus.update(tick(1_002));
    assert_eq!(bus.next_frame(), Some(last));
    bus.update(tick(1_003));
    assert_eq!(bus.next_frame(), None);
}

/// Joints that answer what reaches them.
struct Snake {
    joints: Joints,
    handles: [Joint; 2],
    ms: u64,
}

impl Snake {
    const IDS: [u8; 2] = [3, 7];

    /// Armed and led.
    fn led() -> Self {
        let mut joints = Joints::new();
        let handles = Self::IDS.map(|id| joints.attach(snake::Config::new(id)).unwrap());
        let mut snake = Self { joints, handles, ms: 1_000 };
        (0..60).for_each(|_| _ = snake.step(|_| false));
        snake.joints.arm(Instant::from_micros(snake.ms * 1_000)).unwrap();
        (0..300).for_each(|_| _ = snake.step(|_| false));
        assert!(snake.driven().iter().all(|driven| *driven));
        snake
    }

    fn driven(&self) -> [bool; 2] {
        self.handles.map(|joint| self.joints.state(joint).is_some_and(|state| state.is_driven))
    }

    /// A millisecond, in which the joints are led to and fro; returns what reaches the bus. What `loses` is given back.
    fn step(&mut self, loses: impl Fn(Command) -> bool) -> Vec<(u8, Command)> {
        self.ms += 1;
        let now = Instant::from_micros(self.ms * 1_000);
        for joint in self.handles {
            let pulses = i32::try_from(self.ms % 7).unwrap();
            _ = self.joints.set_pulses(joint, pulses);
        }
        self.joints.update(Tick::new(now, 0.001));
        let mut sent = Vec::new();
        while let Some(frame) = self.joints.next_frame() {
            let id = u8::try_from(frame.header()).unwrap();
            let command = Command::decode(frame.data()).unwrap();
            if loses(command) {
                assert!(self.joints.requeue(&frame), "{command:?}");
                continue;
            }
            sent.push((id, command));
            if let Command::Read(register) = command {
                let value = i32::from(register == Register::Enable);
                let address = StandardId::new(id.into()).unwrap();
                let reply = CanFrame::new(address, &register.reply(value)).unwrap();
                assert_eq!(self.joints.ingest(&reply, now), Ingest::Taken);
            }
        }
        sent
    }
}

/// The reminder comes after 100 ms only: what is lost must not wait for it.
#[test]
fn a_disable_that_is_lost_goes_out_in_the_next_update() {
    let stops: [fn(&mut Joints); 2] = [Devices::disarm, Devices::emergency_stop];
    for stop in stops {
        for lost_ms in [1, 2, 20] {
            let mut snake = Snake::led();
            stop(&mut snake.joints);
            for _ in 0..lost_ms {
                let sent = snake.step(|command| command == Command::DISABLE);
                assert!(sent.iter().all(|(_, command)| command.is_safe()), "{sent:?}");
            }
            let sent = snake.step(|_| false);
            for id in Snake::IDS {
                assert!(
                    sent.contains(&(id, Command::DISABLE)),
                    "{id} after {lost_ms} ms: {sent:?}"
                );
            }
        }
    }
}

#[test]
fn the_disable_of_a_detached_joint_is_not_lost() {
    let mut snake = Snake::led();
    snake.joints.detach(snake.handles[1]);
    for _ in 0..5 {
        let sent = snake.step(|command| command == Command::DISABLE);
        assert!(sent.iter().all(|(id, _)| *id != 7), "{sent:?}");
    }
    assert!(snake.step(|_| false).contains(&(7, Command::DISABLE)));
}

/// A write is given back: the register is written with its newest value, and none is forgotten.
#[test]
fn each_register_that_is_lost_is_written_again() {
    for lost in [
        Register::Mode,
        Register::Current,
        Register::Acceleration,
        Register::Speed,
        Register::Position,
        Register::Enable,
    ] {
        let mut snake = Snake::led();
        snake.joints.disarm();
        (0..300).for_each(|_| _ = snake.step(|_| false));
        snake.joints.arm(Instant::from_micros(snake.ms * 1_000)).unwrap();
        let is_lost = |command| matches!(command, Command::Write(register, value) if register == lost && (value, register) != (0, Register::Enable));
        let writes =
            |sent: &[(u8, Command)]| sent.iter().filter(|(_, command)| is_lost(*command)).count();
        for _ in 0..30 {
            assert_eq!(writes(&snake.step(is_lost)), 0);
        }
        let mut written = [false; 2];
        for _ in 0..60 {
            for (id, command) in snake.step(|_| false) {
                if is_lost(command) {
                    written[Snake::IDS.iter().position(|other| *other == id).unwrap()] = true;
                }
            }
        }
        assert_eq!(written, [true; 2], "{lost:?}");
    }
}

/// A question that did not go out is not waited for, does not count, and keeps its turn.
#[test]
fn a_question_that_is_lost_is_asked_again_at_once() {
    let mut snake = Snake::led();
    for _ in 0..30 {
        let (before, ms) = (snake.joints.counters(), snake.ms);
        let sent = snake.step(|command| matches!(command, Command::Read(_)));
        assert!(!sent.iter().any(|(_, command)| matches!(command, Command::Read(_))));
        let after = snake.joints.counters();
        assert_eq!(
            (after.requests, after.unanswered),
            (before.requests, before.unanswered),
            "{ms}"
        );
        assert!(snake.handles.iter().all(|joint| snake.joints.awaited(*joint).is_none()));
        let sent = snake.step(|_| false);
        assert!(sent.iter().any(|(_, command)| matches!(command, Command::Read(_))), "{sent:?}");
    }
    assert_eq!(snake.joints.counters().unanswered, 0);
}

/// A motor that moved from one bus struct to another: a frame given back went to the bus that sent it once, which then
/// sent zeros on the id of the motor that runs.
#[test]
fn a_frame_goes_back_to_the_part_that_sends_it_now() {
    let at_ms = |ms: u64| Instant::from_micros(1_000 * ms);
    let silent = || Bus::new().with_keep_alive(Duration::from_secs(10));
    let (mut before, mut now): (Bus, Bus) = (silent(), silent());
    let gone = before.attach(Config::<M3508>::new(1)).unwrap();
    before.detach(gone);
    let wheel = now.attach(Config::<M3508>::new(1)).unwrap();
    let mut both = (before, now);
    for ms in 1_000..1_400 {
        let feedback = CanFrame::standard(0x201, [0x10, 0, 0, 0, 0, 0, 30, 0]).unwrap();
        assert_eq!(both.ingest(&feedback, at_ms(ms)), drivetrain::motor::Ingest::Taken);
        if ms == 1_000 {
            both.1.arm(at_ms(ms)).unwrap();
        }
        both.1.set_raw(wheel, 5_000).unwrap();
        both.update(Tick::new(at_ms(ms), 0.001));
        let sent: Vec<CanFrame> = std::iter::from_fn(|| both.next_frame(0)).collect();
        if ms > 1_300 {
            assert!(sent.iter().all(|frame| *frame.bytes() != [0; 8]), "{ms}: {sent:?}");
        }
        if ms > 1_100 && ms % 10 == 0 {
            assert!(both.requeue(&sent[0]));
        }
    }
}

/// A frame of an actuator that was refused, failed or evicted is replaced by a newer one, and was not counted: 0 of 10.
#[test]
fn a_frame_of_an_own_motor_that_comes_back_counts_as_superseded() {
    let at_ms = |ms: u64| Instant::from_micros(1_000 * ms);
    let mut motor = own(1);
    for ms in 1..=10 {
        motor.update(Tick::new(at_ms(ms), 0.001));
        let frame = motor.next_frame(0).unwrap();
        assert!(motor.requeue(&frame));
    }
    assert_eq!(motor.superseded(), 10);
}

/// A controller that is off the bus, with one mailbox: each frame takes the place of the one before, and none leaves.
struct Dead(Option<CanFrame>);

impl embedded_can::nb::Can for Dead {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        Ok(self.0.replace(*frame))
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        Err(nb::Error::WouldBlock)
    }
}

/// The parts of a device take turns in sending first, so the frame that was evicted last is taken first.
#[test]
fn frames_of_several_parts_that_evict_each_other_are_a_bus_that_is_down() {
    fn losses<D: Devices>(device: D) -> u32 {
        let clock = Cell::new(Instant::START);
        let mut runner = Runner::new(Nb(Dead(None)), &clock, device);
        for _ in 0..150 {
            clock.set(clock.get() + Duration::from_millis(1));
            runner.tick(Tick::new(clock.get(), 0.001));
        }
        assert!(runner.is_bus_down());
        runner.statistics().bus_losses
    }
    let bus = |id| {
        let mut bus: Bus = Bus::new().with_keep_alive(Duration::ZERO);
        bus.attach(Config::<M3508>::new(id)).unwrap();
        bus
    };
    assert_eq!(losses(bus(1)), 1);
    assert_eq!(losses([bus(1), bus(5)]), 1);
    assert_eq!(losses((bus(1), own(1))), 1);
    assert_eq!(losses((bus(1), bus(5), own(1))), 1);
}
