//! One quiet tick, many times: what a robot runs in each millisecond, for each way of a tick.
//!
//! `.ci/one-tick` runs each test alone, with counters in each function, and compares the files whose functions ran in each cycle
//! with the list in DESIGN: "One tick", "One tick of an actuator", "One tick of joints". What runs once, or now and then, has a
//! smaller count than there are cycles.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::damiao::{Model, Motor};
use drivetrain::dji::{self, Handle, M3508};
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, VelocityDrive};
use drivetrain::runner::{Nb, Runner};
use drivetrain::snake::{self, Joint, Joints};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{ErrorKind, Frame, nb::Can};
use std::cell::Cell;
use std::collections::VecDeque;

const MOTORS: usize = 8;
/// Twice what `.ci/one-tick` asks for: what runs in every second cycle counts.
const CYCLES: u32 = 2_000;
/// Cycles before, until a drive is asked, armed and enabled: far fewer than count.
const PREPARATION: u32 = 100;
/// Rotor counts in a cycle, at 191 rpm.
const COUNTS: u32 = 26;

/// A driver that takes each frame, and has the answers of the drives ready in the next cycle.
struct Stub<D> {
    received: VecDeque<CanFrame>,
    sent: usize,
    drives: D,
}

impl<D> Stub<D> {
    fn new(drives: D) -> Self {
        Self { received: VecDeque::new(), sent: 0, drives }
    }
}

impl<D: FnMut(&CanFrame) -> Option<CanFrame>> Can for Stub<D> {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        self.sent += 1;
        self.received.extend((self.drives)(frame));
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.received.pop_front().ok_or(nb::Error::WouldBlock)
    }
}

type Shell<'c, D, B> = Runner<Nb<Stub<D>>, &'c Cell<Instant>, B>;

/// A cycle of a program: returns how many frames were received.
fn cycle<D, B>(
    runner: &mut Shell<'_, D, B>,
    clock: &Cell<Instant>,
    targets: impl FnOnce(&mut Shell<'_, D, B>, Tick),
) -> usize
where
    D: FnMut(&CanFrame) -> Option<CanFrame>,
    B: Devices,
{
    clock.set(clock.get() + Duration::from_millis(1));
    let received = runner.poll(16);
    let tick = runner.due().unwrap();
    targets(runner, tick);
    runner.tick(tick);
    received
}

/// The feedback of a motor that turns.
fn feedback(id: u16, cycle: u32) -> CanFrame {
    let angle = u16::try_from(cycle * COUNTS % 8_192).unwrap();
    let ([a, b], [c, d]) = (angle.to_be_bytes(), 191_i16.to_be_bytes());
    CanFrame::standard(0x200 + id, [a, b, c, d, 0, 100, 35, 0]).unwrap()
}

#[test]
fn eight_motors_are_driven_in_each_cycle_and_nothing_happens() {
    let speed = PidConfig::new(0.8, 4.0, 0.001);
    let position = PidConfig::new(10.0, 0.5, 0.01);
    let clock = Cell::new(Instant::from_micros(1_000_000));
    let mut bus = dji::Bus::new();
    let motors: [Handle<M3508>; MOTORS] = bus
        .attach_all([1, 2, 3, 4, 5, 6, 7, 8].map(|id| {
            dji::Config::new(id).position_loop(position, speed).with_opening(Duration::ZERO)
        }))
        .unwrap();
    let mut runner = Runner::new(Nb(Stub::new(|_: &CanFrame| None)), &clock, bus);
    for time in 0..CYCLES {
        runner.port_mut().0.received.extend((1..=8).map(|id| feedback(id, time)));
        // Half of them turn, half of them follow a position that is just ahead.
        let turns = f64::from(time * COUNTS) / 8_192.0 * 187.0 / 3_591.0;
        #[expect(clippy::cast_possible_truncation, reason = "rounded")]
        let ahead = Position::from_angle(Angle::from_turns(turns as f32 + 0.003));
        let received = cycle(&mut runner, &clock, |runner, tick| {
            if time == 0 {
                runner.arm(tick).unwrap();
            }
            for (index, motor) in motors.into_iter().enumerate() {
                if index % 2 == 0 {
                    let wanted = AngularVelocity::from_rad_per_s(1.0);
                    runner.device_mut().set_velocity(motor, wanted).unwrap();
                } else {
                    runner.device_mut().set_position(motor, ahead).unwrap();
                }
            }
        });
        assert_eq!(received, MOTORS);
    }
    assert!(runner.is_armed());
    assert_eq!((runner.next_edge(), Devices::next_edge(runner.device_mut())), (None, None));
    assert_eq!(runner.port_mut().0.sent, 2 * usize::try_from(CYCLES).unwrap());
}

/// A J4310 with the id 1 and the feedback id 0x11, by the manual: its registers, and its feedback.
#[derive(Default)]
struct Damiao {
    timeout: [u8; 4],
    is_enabled: bool,
}

impl Damiao {
    fn answer(&mut self, frame: &CanFrame) -> Option<CanFrame> {
        match *frame.bytes() {
            [1, 0, verb @ (0x33 | 0x55), register, written @ ..] => {
                if verb == 0x55 {
                    self.timeout = written;
                }
                let [a, b, c, d] = match register {
                    9 => self.timeout,
                    10 => 1_u32.to_le_bytes(),
                    21 => 12.5_f32.to_le_bytes(),
                    22 => 30.0_f32.to_le_bytes(),
                    23 => 10.0_f32.to_le_bytes(),
                    _ => return None,
                };
                return CanFrame::standard(0x11, [1, 0, verb, register, a, b, c, d]);
            }
            [0xFF, .., power @ (0xFC | 0xFD)] => self.is_enabled = power == 0xFC,
            _ => {}
        }
        // 1 rad/s is 2116 of 4095 counts in 30 rad/s to both sides.
        let head = u8::from(self.is_enabled) << 4 | 1;
        CanFrame::standard(0x11, [head, 0x80, 0, 0x84, 0x48, 0, 30, 35])
    }
}

#[test]
fn an_actuator_with_a_speed_loop_is_driven_in_each_cycle_and_nothing_happens() {
    let speed = PidConfig::new(0.5, 2.0, 0.0);
    let loops = ImpedanceControl::new(3.0)
        .and_then(|control| control.with_loops(PidConfig::new(10.0, 0.0, 0.0), speed));
    let motor = Motor::new(Model::J4310, 1, loops.unwrap()).unwrap();
    let clock = Cell::new(Instant::from_micros(1_000_000));
    let mut drive = Damiao::default();
    let drive = Stub::new(|frame: &CanFrame| drive.answer(frame));
    let actuator = Actuator::new(motor).with_opening(Duration::ZERO);
    let mut runner = Runner::new(Nb(drive), &clock, actuator);
    for _ in 0..PREPARATION {
        cycle(&mut runner, &clock, |_, _| {});
    }
    let mut sent = 0;
    for time in 0..PREPARATION + CYCLES {
        if time == PREPARATION {
            sent = runner.port_mut().0.sent;
            while Devices::next_edge(runner.device_mut()).is_some() {}
        }
        let received = cycle(&mut runner, &clock, |runner, tick| {
            if time == 0 {
                runner.arm(tick).unwrap();
            }
            runner.device_mut().set_velocity((), AngularVelocity::from_rad_per_s(1.1)).unwrap();
        });
        assert!(time < PREPARATION || received == 1);
    }
    assert!(runner.is_armed());
    assert_eq!((runner.next_edge(), Devices::next_edge(runner.device_mut())), (None, None));
    assert_eq!(runner.port_mut().0.sent - sent, usize::try_from(CYCLES).unwrap());
}

const JOINTS: u8 = 4;

#[test]
fn joints_follow_their_targets_in_each_cycle_and_nothing_happens() {
    let clock = Cell::new(Instant::from_micros(1_000_000));
    let mut bus = Joints::new();
    let joints: Vec<Joint> =
        (1..=JOINTS).map(|id| bus.attach(snake::Config::new(id)).unwrap()).collect();
    // By the protocol: the position is register 7, and each register is answered in six bytes.
    let mut pulses = 0_i32;
    let drives = Stub::new(|frame: &CanFrame| {
        let [3, register] = *frame.data() else { return None };
        pulses += 1;
        let [a, b, c, d] = if register == 7 { pulses.to_be_bytes() } else { [0, 0, 0, 1] };
        CanFrame::new(frame.id(), &[4, register, a, b, c, d])
    });
    let mut runner = Runner::new(Nb(drives), &clock, bus);
    for _ in 0..PREPARATION {
        cycle(&mut runner, &clock, |_, _| {});
    }
    joints.iter().for_each(|joint| runner.device_mut().zero(*joint).unwrap());
    for time in 0..PREPARATION + CYCLES {
        if time == PREPARATION {
            while Devices::next_edge(runner.device_mut()).is_some() {}
        }
        let ahead = Position::from_angle(Angle::from_turns(time as f32 * 1e-4));
        let received = cycle(&mut runner, &clock, |runner, tick| {
            if time == 0 {
                runner.arm(tick).unwrap();
            }
            for joint in &joints {
                runner.device_mut().set_position(*joint, ahead).unwrap();
            }
        });
        assert_eq!(received, 1, "{time}");
    }
    assert!(runner.is_armed());
    assert_eq!((runner.next_edge(), Devices::next_edge(runner.device_mut())), (None, None));
}
