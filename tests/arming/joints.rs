//! Joints: `arm` and `engage`.

use crate::{PAUSE_MS, RIVAL_MS, at_ms};
use drivetrain::frame::CanFrame;
use drivetrain::motor::Devices;
use drivetrain::motor::{self, ArmError, Ingest};
use drivetrain::snake::{Command, Config, Joint, Joints, Register};
use drivetrain::time::Tick;
use embedded_can::{Frame, StandardId};

const IDS: [u8; 3] = [2, 5, 9];

/// Joints that answer at once and stand at zero.
struct Bench {
    joints: Joints,
    handles: [Joint; 3],
    ms: u64,
}

fn frame(id: u8, data: &[u8]) -> CanFrame {
    CanFrame::new(StandardId::new(id.into()).unwrap(), data).unwrap()
}

impl Bench {
    fn new() -> Self {
        let mut joints = Joints::new();
        let handles = IDS.map(|id| joints.attach(Config::new(id)).unwrap());
        Self { joints, handles, ms: 1_000 }
    }

    fn wait(&mut self, ms: u64) {
        self.wait_without(ms, u8::MAX);
    }

    /// Some milliseconds, in which one joint does not answer.
    fn wait_without(&mut self, ms: u64, silent: u8) {
        for _ in 0..ms {
            self.ms += 1;
            self.joints.update(Tick::new(at_ms(self.ms), 0.001));
            while let Some(sent) = self.joints.next_frame() {
                let id = u8::try_from(sent.header()).unwrap();
                let Some(Command::Read(register)) = Command::decode(sent.data()) else { continue };
                if id != silent {
                    let enabled = i32::from(register == Register::Enable);
                    let reply = frame(id, &register.reply(enabled));
                    assert_eq!(self.joints.ingest(&reply, at_ms(self.ms)), Ingest::Taken);
                }
            }
        }
    }

    fn arm(&mut self) -> Result<(), String> {
        self.joints.arm(at_ms(self.ms)).map_err(|error| error.to_string())
    }

    fn armed(&self) -> [bool; 3] {
        self.handles.map(|joint| self.joints.is_joint_armed(joint))
    }
}

#[test]
fn joints_refuse_what_one_of_them_refuses() {
    for (index, id) in IDS.into_iter().enumerate() {
        // Never heard, then heard and silent.
        let mut bench = Bench::new();
        bench.wait_without(60, id);
        let refused = Err(format!("no feedback from snake joint #{id}"));
        assert_eq!((bench.arm(), bench.armed()), (refused.clone(), [false; 3]));
        bench.wait(PAUSE_MS);
        bench.wait_without(60, id);
        assert_eq!((bench.arm(), bench.armed()), (refused, [false; 3]));
        bench.wait(2 * PAUSE_MS);
        // Somebody else leads it.
        let rival = Command::Write(Register::Position, 7).frame(id).unwrap();
        let outcome = bench.joints.ingest(&rival, at_ms(bench.ms));
        assert_ne!(outcome, Ingest::Taken);
        let refused = format!("another node sends the command of snake joint #{id} on 0x{id:X}");
        assert_eq!((bench.arm(), bench.armed()), (Err(refused), [false; 3]));
        bench.wait(RIVAL_MS);
        assert_eq!((bench.arm(), bench.armed()), (Ok(()), [true; 3]), "{index}");
    }
}

#[test]
fn engage_arms_the_joints_that_are_heard_and_none_under_a_stop() {
    for (index, id) in IDS.into_iter().enumerate() {
        for silence_ms in [0, 200] {
            let mut bench = Bench::new();
            bench.wait(silence_ms);
            bench.wait_without(60, id);
            motor::CanDevice::engage(&mut bench.joints, at_ms(bench.ms));
            assert_eq!(bench.armed(), [0, 1, 2].map(|other| other != index), "{id}");
            assert!(!bench.joints.is_armed());
        }
    }
    let mut bench = Bench::new();
    bench.wait(60);
    bench.joints.emergency_stop();
    motor::CanDevice::engage(&mut bench.joints, at_ms(bench.ms));
    assert_eq!(bench.armed(), [false; 3]);
    assert_eq!(bench.joints.arm(at_ms(bench.ms)), Err(ArmError::Stopped));
    bench.joints.clear_emergency_stop();
    assert_eq!(bench.armed(), [false; 3]);
    bench.wait(PAUSE_MS);
    assert_eq!((bench.arm(), bench.armed()), (Ok(()), [true; 3]));
}
