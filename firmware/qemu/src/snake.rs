//! Twelve joints of a snake robot on one bus, whose drives answer within the tick.

use crate::meter::instructions;
use crate::report::row;
use crate::wiring::START;
use core::hint::black_box;
use drivetrain::encoder::Position;
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Devices, Ingest, TargetError};
use drivetrain::snake::{Command, Config, IDS, Joint, Joints, PULSES_PER_TURN, Register};
use drivetrain::time::{Duration, Instant, Tick};
use embedded_can::{Frame, StandardId};

const JOINTS: usize = IDS as usize;

const PERIOD: Duration = Duration::from_millis(1);

pub fn reply(id: u8, register: Register, value: i32) -> CanFrame {
    let data = register.reply(value);
    CanFrame::of(StandardId::new(u16::from(id)).unwrap(), data)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn snake_ingest(joints: &mut Joints, frame: &CanFrame, now: Instant) -> Ingest {
    joints.ingest(frame, now)
}

/// The whole tick: joints chosen, a request and a write out, the answer in.
#[unsafe(no_mangle)]
#[inline(never)]
fn snake_tick(joints: &mut Joints, answers: &[CanFrame; JOINTS], tick: Tick) {
    joints.update(tick);
    while let Some(frame) = joints.next_frame() {
        if frame.length() == 2 {
            let answer = answers.get(frame.header() as usize - 1);
            _ = answer.map(|answer| joints.ingest(answer, tick.now()));
        }
    }
}

#[unsafe(no_mangle)]
#[inline(never)]
fn snake_set_position(
    joints: &mut Joints,
    joint: Joint,
    position: &Position,
) -> Result<(), TargetError> {
    joints.set_position(joint, *position)
}

struct Snake {
    joints: Joints,
    handles: [Joint; JOINTS],
    /// By id, less one.
    pulses: [i32; JOINTS],
    now: Instant,
}

impl Snake {
    /// Makes joints that are enabled and hold the position that they have, `turns` from zero.
    fn new(turns: i32, start: Instant) -> Self {
        let mut joints = Joints::new();
        let handles = core::array::from_fn(|index| {
            joints.attach(Config::new(black_box(index as u8 + 1))).unwrap()
        });
        let pulses = [turns * PULSES_PER_TURN; JOINTS];
        let mut snake = Self { joints, handles, pulses, now: start };
        snake.run(300);
        snake.joints.arm(snake.now).unwrap();
        snake.run(300);
        assert!(
            handles.iter().all(|joint| snake.joints.state(*joint).is_some_and(|it| it.is_driven))
        );
        snake
    }

    fn run(&mut self, updates: u32) {
        for _ in 0..updates {
            self.pass();
            self.joints.update(Tick::new(self.now, 0.001));
            while let Some(frame) = self.joints.next_frame() {
                let Some(Command::Read(register)) = Command::decode(frame.data()) else { continue };
                let id = frame.header() as u8;
                let value = match register {
                    Register::ActualPosition => self.pulses[usize::from(id) - 1],
                    Register::Enable => 1,
                    _ => 0,
                };
                assert_eq!(
                    self.joints.ingest(&reply(id, register, value), self.now),
                    Ingest::Taken
                );
            }
        }
    }

    /// Lets a period pass, with new targets.
    fn pass(&mut self) {
        self.now = self.now + PERIOD;
        for (joint, pulses) in self.handles.into_iter().zip(self.pulses) {
            _ = self.joints.set_pulses(joint, pulses);
        }
    }
}

/// Returns the instructions of a tick of joints that stand at `turns`.
pub fn tick(turns: i32, start: Instant) -> u32 {
    let mut snake = Snake::new(turns, start);
    let answers: [CanFrame; JOINTS] = core::array::from_fn(|index| {
        reply(index as u8 + 1, Register::ActualPosition, snake.pulses[index])
    });
    instructions(snake_tick as fn(&mut Joints, &[CanFrame; JOINTS], Tick), |tick, _| {
        snake.pass();
        tick(&mut snake.joints, &answers, Tick::new(snake.now, 0.001));
    })
}

/// Returns the instructions of an answer of one joint.
pub fn ingest(id: u8, turns: i32, start: Instant) -> u32 {
    let mut snake = Snake::new(turns, start);
    let answer = reply(id, Register::ActualPosition, turns * PULSES_PER_TURN);
    instructions(snake_ingest as fn(&mut Joints, &CanFrame, Instant) -> Ingest, |ingest, call| {
        // The calls that are measured and those of nothing begin alike, and the joint is heard in both: the bus then has the same work.
        if call == 0 {
            snake = Snake::new(turns, start);
        }
        snake.run(1);
        _ = snake.joints.ingest(&answer, snake.now);
        _ = ingest(&mut snake.joints, &answer, snake.now);
    })
}

fn set_position() -> u32 {
    let Snake { mut joints, handles, .. } = Snake::new(0, START);
    let function = snake_set_position as fn(&mut Joints, Joint, &Position) -> _;
    instructions(function, |set, call| {
        let position = Position::from_turns(i64::from(call % 8));
        _ = set(&mut joints, black_box(handles[0]), &position);
    })
}

pub fn rows() {
    row("snake_tick", &[tick(0, START)]);
    row("snake_ingest", &[ingest(1, 0, START)]);
    row("snake_set_position", &[set_position()]);
}
