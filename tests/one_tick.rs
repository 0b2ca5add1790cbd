//! One quiet tick, many times: what a robot runs in each millisecond.
//!
//! `.ci/one-tick` runs this test with counters in each function, and compares the files whose functions ran in each cycle with
//! the list in DESIGN, "One tick". What runs once, or now and then, has a smaller count than there are cycles.

#![cfg(test)]

use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Handle, M3508};
use drivetrain::encoder::Position;

use drivetrain::frame::CanFrame;
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::{Angle, AngularVelocity};
use embedded_can::{ErrorKind, nb::Can};
use std::cell::Cell;

const MOTORS: usize = 8;
/// Twice what `.ci/one-tick` asks for: what runs in every second cycle counts.
const CYCLES: u32 = 2_000;
/// Rotor counts in a cycle, at 191 rpm.
const COUNTS: u32 = 26;

/// A driver that has one frame of each motor in each cycle, and takes what it is given.
struct Stub {
    received: std::vec::IntoIter<CanFrame>,
    sent: usize,
}

impl Can for Stub {
    type Frame = CanFrame;
    type Error = ErrorKind;

    fn transmit(&mut self, _: &CanFrame) -> nb::Result<Option<CanFrame>, ErrorKind> {
        self.sent += 1;
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, ErrorKind> {
        self.received.next().ok_or(nb::Error::WouldBlock)
    }
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
    let mut bus = Bus::new();
    let motors: [Handle<M3508>; MOTORS] = bus
        .attach_all(
            [1, 2, 3, 4, 5, 6, 7, 8].map(|id| {
                Config::new(id).position_loop(position, speed).with_opening(Duration::ZERO)
            }),
        )
        .unwrap();
    let can = Stub { received: Vec::new().into_iter(), sent: 0 };
    let mut runner = Runner::new(Nb(can), &clock, bus);
    for cycle in 0..CYCLES {
        clock.set(clock.get() + Duration::from_millis(1));
        let frames: Vec<_> = (1..=8).map(|id| feedback(id, cycle)).collect();
        runner.port_mut().0.received = frames.into_iter();
        assert_eq!(runner.poll(16), MOTORS);
        let tick = runner.due().unwrap();
        if cycle == 0 {
            runner.arm(tick).unwrap();
        }
        // Half of them turn, half of them follow a position that is just ahead.
        let turns = f64::from(cycle * COUNTS) / 8_192.0 * 187.0 / 3_591.0;
        #[expect(clippy::cast_possible_truncation, reason = "rounded")]
        let ahead = Position::from_angle(Angle::from_turns(turns as f32 + 0.003));
        for (index, motor) in motors.into_iter().enumerate() {
            if index % 2 == 0 {
                let wanted = AngularVelocity::from_rad_per_s(1.0);
                runner.device_mut().set_velocity(motor, wanted).unwrap();
            } else {
                runner.device_mut().set_position(motor, ahead).unwrap();
            }
        }
        runner.tick(tick);
    }
    assert!(runner.is_armed());
    assert_eq!((runner.next_edge(), runner.device_mut().next_edge()), (None, None));
    assert_eq!(runner.port_mut().0.sent, 2 * usize::try_from(CYCLES).unwrap());
}
