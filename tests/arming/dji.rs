//! The DJI bus: `arm`, `arm_only` and `engage`.

use crate::{PAUSE_MS, RIVAL_MS, at_ms};
use drivetrain::dji::{AnyHandle, Bus, Config, M3508};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Devices;
use drivetrain::motor::{self, ArmError, Ingest};
use drivetrain::time::Tick;

/// The motors #1 and #2 share a command frame, #5 has another.
const IDS: [u8; 3] = [1, 2, 5];

struct Bench {
    bus: Bus,
    motors: [AnyHandle; 3],
    ms: u64,
}

/// Feedback of a motor that turns slowly, with an error code.
fn feedback(index: usize, ms: u64, code: u8) -> CanFrame {
    let id = 0x200 + u16::from(IDS[index]);
    let angle = u16::try_from(ms % 8_192).unwrap().to_be_bytes();
    CanFrame::standard(id, [angle[0], angle[1], 0, 0, 0, 0, 30, code]).unwrap()
}

/// A code of the C620 for which it must not be driven: a lost phase.
const LOST_PHASE: u8 = 3;

impl Bench {
    fn new() -> Self {
        let mut bus = Bus::new();
        let motors = bus.attach_all(IDS.map(Config::<M3508>::new)).unwrap().map(|it| it.erase());
        Self { bus, motors, ms: 1_000 }
    }

    fn step(&mut self, feedback: impl Fn(usize, u64) -> Option<CanFrame>) {
        self.ms += 1;
        for frame in (0..3).filter_map(|index| feedback(index, self.ms)) {
            assert_eq!(self.bus.ingest(&frame, at_ms(self.ms)), Ingest::Taken);
        }
        self.bus.update(Tick::new(at_ms(self.ms), 0.001));
        while self.bus.next_frame().is_some() {}
    }

    fn wait(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step(|index, ms| Some(feedback(index, ms, 0))));
    }

    /// A while in which one motor is silent, or reports a fault.
    fn silent(&mut self, silent: usize) {
        for _ in 0..15 {
            self.step(|index, ms| (index != silent).then(|| feedback(index, ms, 0)));
        }
    }

    fn faulty(&mut self, broken: usize) {
        for _ in 0..15 {
            let code = |index| if index == broken { LOST_PHASE } else { 0 };
            self.step(|index, ms| Some(feedback(index, ms, code(index))));
        }
    }

    fn only(&mut self, indices: &[usize]) -> Result<(), String> {
        let chosen: Vec<AnyHandle> = indices.iter().map(|index| self.motors[*index]).collect();
        self.bus.arm_only(&chosen, at_ms(self.ms)).map_err(|error| error.to_string())
    }

    fn armed(&self) -> [bool; 3] {
        self.motors.map(|motor| self.bus.is_motor_armed(motor))
    }

    /// Whether a target leads to a word that is not zero, for each motor.
    fn drives(&mut self) -> [bool; 3] {
        let mut words = [0; 3];
        // The range may open slowly.
        for _ in 0..300 {
            for motor in self.motors {
                _ = self.bus.set_raw(motor, 5_000);
            }
            self.ms += 1;
            for index in 0..3 {
                _ = self.bus.ingest(&feedback(index, self.ms, 0), at_ms(self.ms));
            }
            self.bus.update(Tick::new(at_ms(self.ms), 0.001));
            while let Some(frame) = self.bus.next_frame() {
                let [a, b, c, d, ..] = *frame.bytes();
                let pair = [[a, b], [c, d]].map(i16::from_be_bytes);
                match frame.header() {
                    0x200 => words[..2].copy_from_slice(&pair),
                    _ => words[2] = pair[0],
                }
            }
        }
        words.map(|word| word != 0)
    }
}

/// Every choice of motors, as their indices.
fn choices() -> impl Iterator<Item = Vec<usize>> {
    (1..8).map(|bits| (0..3).filter(|index| bits & 1 << index != 0).collect())
}

fn within(choice: &[usize]) -> [bool; 3] {
    [0, 1, 2].map(|index| choice.contains(&index))
}

// `arm_only` was made to arm a motor whose ESC reports a fault, and no test noticed.
#[test]
fn arm_only_refuses_a_choice_with_a_faulty_motor_and_no_other() {
    for (broken, id) in IDS.into_iter().enumerate() {
        for choice in choices() {
            let mut bench = Bench::new();
            bench.wait(20);
            bench.faulty(broken);
            let outcome = bench.only(&choice);
            if choice.contains(&broken) {
                let refused =
                    format!("not fit to be driven, see health(): M3508 #{id} (ESC fault)");
                assert_eq!((outcome, bench.armed()), (Err(refused), [false; 3]), "{choice:?}");
                bench.wait(PAUSE_MS);
                assert_eq!(bench.only(&choice), Ok(()), "{choice:?}: the fault is over");
            } else {
                assert_eq!(outcome, Ok(()), "{choice:?}");
            }
            assert_eq!(bench.armed(), within(&choice));
            assert_eq!(bench.drives(), within(&choice));
        }
    }
}

#[test]
fn arm_only_refuses_a_choice_with_a_silent_motor_and_no_other() {
    for (silent, id) in IDS.into_iter().enumerate() {
        for choice in choices() {
            let mut bench = Bench::new();
            bench.wait(20);
            bench.silent(silent);
            let outcome = bench.only(&choice);
            if choice.contains(&silent) {
                let refused = format!("no feedback from M3508 #{id}");
                assert_eq!((outcome, bench.armed()), (Err(refused), [false; 3]), "{choice:?}");
                bench.wait(PAUSE_MS);
                assert_eq!(bench.only(&choice), Ok(()), "{choice:?}: it is heard again");
            } else {
                assert_eq!(outcome, Ok(()), "{choice:?}");
            }
            assert_eq!(bench.armed(), within(&choice));
            assert_eq!(bench.drives(), within(&choice));
        }
    }
}

#[test]
fn arm_only_refuses_a_choice_whose_command_another_node_sends_and_no_other() {
    for (id, theirs, first) in [(0x200, [0, 1], 1), (0x1FF, [2, 2], 5)] {
        for choice in choices() {
            let mut bench = Bench::new();
            bench.wait(20);
            let rival = CanFrame::standard(id, [0; 8]).unwrap();
            assert_eq!(bench.bus.ingest(&rival, at_ms(bench.ms)), Ingest::Unrelated);
            let outcome = bench.only(&choice);
            if choice.iter().any(|index| theirs.contains(index)) {
                let named = if choice.contains(&theirs[0]) { first } else { IDS[theirs[1]] };
                let refused =
                    format!("another node sends the command of M3508 #{named} on 0x{id:X}");
                assert_eq!((outcome, bench.armed()), (Err(refused), [false; 3]), "{choice:?}");
                bench.wait(RIVAL_MS);
                assert_eq!(bench.only(&choice), Ok(()), "{choice:?}: it is forgotten");
            } else {
                assert_eq!(outcome, Ok(()), "{choice:?}");
            }
            assert_eq!(bench.armed(), within(&choice));
        }
    }
}

#[test]
fn arm_only_refuses_under_an_emergency_stop_and_without_a_motor() {
    for choice in choices() {
        let mut bench = Bench::new();
        bench.wait(20);
        bench.bus.emergency_stop();
        let chosen: Vec<AnyHandle> = choice.iter().map(|index| bench.motors[*index]).collect();
        assert_eq!(bench.bus.arm_only(&chosen, at_ms(bench.ms)), Err(ArmError::Stopped));
        assert_eq!((bench.armed(), bench.drives()), ([false; 3], [false; 3]));
        bench.bus.clear_emergency_stop();
        assert_eq!((bench.armed(), bench.drives()), ([false; 3], [false; 3]));
        bench.wait(PAUSE_MS);
        assert_eq!(bench.only(&choice), Ok(()));
        assert_eq!(bench.drives(), within(&choice));
    }
    let mut bench = Bench::new();
    bench.wait(20);
    assert_eq!(bench.bus.arm_only(&[], at_ms(bench.ms)), Err(ArmError::NoMotors));
    bench.bus.detach(bench.motors[0]);
    assert_eq!(bench.bus.arm_only(&bench.motors[..1], at_ms(bench.ms)), Err(ArmError::NoMotors));
    assert_eq!(bench.armed(), [false; 3]);
    // Beside one that is detached the others are armed.
    assert_eq!(bench.only(&[0, 2]), Ok(()));
    assert_eq!(bench.armed(), [false, false, true]);
}

#[test]
fn arm_only_leaves_the_motors_that_run_alone() {
    let mut bench = Bench::new();
    bench.wait(20);
    assert_eq!(bench.only(&[0, 2]), Ok(()));
    assert_eq!(bench.drives(), [true, false, true]);
    bench.bus.set_raw(bench.motors[0], 5_000).unwrap();
    assert_eq!(bench.only(&[0, 1]), Ok(()));
    bench.wait(1);
    // The first one drives on with the target that it has.
    let mut again = Bench { ms: bench.ms + 1, ..bench };
    again.bus.update(Tick::new(at_ms(again.ms), 0.001));
    let frame = std::iter::from_fn(|| again.bus.next_frame()).find(|frame| frame.header() == 0x200);
    assert!(frame.is_some_and(|frame| frame.bytes()[..2] != [0; 2]));
}

/// `engage` alone arms the motors that may be driven, each for itself.
#[test]
fn engage_arms_neither_a_faulty_motor_nor_a_silent_one_nor_under_a_stop() {
    for (spoil, name) in
        [(Bench::faulty as fn(&mut Bench, usize), "faulty"), (Bench::silent, "silent")]
    {
        for (spoiled, id) in IDS.into_iter().enumerate() {
            let mut bench = Bench::new();
            bench.wait(20);
            spoil(&mut bench, spoiled);
            motor::CanDevice::engage(&mut bench.bus, at_ms(bench.ms));
            let expected = [0, 1, 2].map(|index| index != spoiled);
            assert_eq!(bench.armed(), expected, "{name} #{id}");
            assert!(!bench.bus.is_armed());
            assert_eq!(bench.drives(), expected, "{name} #{id}");
        }
    }
    let mut bench = Bench::new();
    bench.wait(20);
    bench.bus.emergency_stop();
    motor::CanDevice::engage(&mut bench.bus, at_ms(bench.ms));
    assert_eq!((bench.armed(), bench.drives()), ([false; 3], [false; 3]));
}

#[test]
fn a_whole_bus_refuses_what_one_of_its_motors_refuses() {
    let arm = |bench: &mut Bench| {
        Devices::arm(&mut bench.bus, at_ms(bench.ms)).map_err(|error| error.to_string())
    };
    for (index, id) in IDS.into_iter().enumerate() {
        let mut bench = Bench::new();
        bench.wait(20);
        bench.faulty(index);
        assert_eq!(
            arm(&mut bench),
            Err(format!("not fit to be driven, see health(): M3508 #{id} (ESC fault)"))
        );
        assert_eq!(bench.armed(), [false; 3]);
        bench.wait(PAUSE_MS);
        bench.silent(index);
        assert_eq!(arm(&mut bench), Err(format!("no feedback from M3508 #{id}")));
        assert_eq!(bench.armed(), [false; 3]);
        bench.wait(PAUSE_MS);
        assert_eq!(arm(&mut bench), Ok(()));
        assert_eq!(bench.drives(), [true; 3]);
    }
}
