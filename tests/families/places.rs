//! More drives behind one controller than the controller has places for frames: three, as bxCAN has.

#![expect(clippy::cast_possible_truncation, reason = "six drives at most")]

use drivetrain::damiao::{Mode, Model, Motor};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{Actuator, Devices, ImpedanceControl, VelocityDrive};
use drivetrain::robstride;
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{
    Controller, DamiaoDrive, Drive, DriveShaft, Fault, Line, RobStrideDrive, Sender, Simulation,
};
use drivetrain::time::{Duration, Instant};
use drivetrain::units::AngularVelocity;
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use std::cell::Cell;

/// The driver of the simulator, which evicts the frame of the lowest priority; or refuses the fourth frame until it was polled.
struct Driver<'w> {
    controller: Controller<'w>,
    only_refuses: bool,
    taken: u8,
}

impl<'w> embedded_can::nb::Can for Driver<'w> {
    type Frame = CanFrame;
    type Error = <Controller<'w> as embedded_can::nb::Can>::Error;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, Self::Error> {
        if self.only_refuses && self.taken == 3 {
            return Err(nb::Error::WouldBlock);
        }
        self.taken += 1;
        self.controller.transmit(frame)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, Self::Error> {
        let received = self.controller.receive();
        self.taken = if received.is_err() { 0 } else { self.taken };
        received
    }
}

/// Drives `N` joints for a second, polled every `poll_us`. Returns the fewest commands in a second that reached a drive.
fn fewest_commands<const N: usize>(only_refuses: bool, period_us: u32, poll_us: u32) -> usize {
    let (world, model) = (Simulation::new(1), Model::J4310);
    let mode = || Mode::velocity(AngularVelocity::from_rpm(100.0));
    let joints: [_; N] = core::array::from_fn(|index| {
        Actuator::new(Motor::new(model, index as u8 + 1, mode()).unwrap())
    });
    let mut drives: [_; N] = core::array::from_fn(|index| {
        let drive = DamiaoDrive::of(model, index as u8 + 1);
        drive.with_register(10, 3.0).with_shaft(DriveShaft::new(0.02, 0.02))
    });
    let period = Duration::from_micros(period_us.into());
    let driver = Driver { controller: world.controller(), only_refuses, taken: 0 };
    let mut runner = Runner::new(Nb(driver), world.clock(), joints).with_period(period);
    let mut commands = [0; N];
    for step in 0..3_000_000 / poll_us {
        let mut answers = Vec::new();
        world.advance_with(Duration::from_micros(poll_us.into()), |record| {
            if record.sender != Sender::Controller {
                return;
            }
            for (index, drive) in drives.iter_mut().enumerate() {
                let is_command = record.frame.id() == id(0x201 + index as u16);
                commands[index] += usize::from(is_command && step * poll_us >= 2_000_000);
                answers.extend(drive.hear(&record.frame));
            }
        });
        for answer in answers {
            _ = world.inject(Line::Can1, answer);
        }
        drives.iter_mut().for_each(|drive| drive.step(poll_us as f32 * 1e-6));
        runner.poll(16);
        if let Some(tick) = runner.due() {
            if tick.now().as_micros() / 1_000 >= 500 && !runner.is_armed() {
                runner.arm(tick).unwrap();
            }
            for joint in runner.device_mut() {
                _ = joint.set_velocity((), AngularVelocity::from_rpm(30.0));
            }
            runner.tick(tick);
        }
        assert_eq!(runner.device_mut().next_edge(), None);
        assert_eq!(runner.next_edge(), None);
    }
    for drive in &drives {
        let wanted = AngularVelocity::from_rpm(30.0).as_rad_per_s();
        assert!((drive.shaft().velocity_rad_per_s() - wanted).abs() < 0.1);
    }
    commands.into_iter().min().unwrap()
}

fn id(raw: u16) -> Id {
    StandardId::new(raw).unwrap().into()
}

#[test]
fn four_and_six_drives_at_half_load_share_a_controller_with_three_places() {
    for poll_us in [100, 1_000] {
        assert_eq!(fewest_commands::<4>(false, 2_000, poll_us), 500);
        assert_eq!(fewest_commands::<6>(false, 4_000, poll_us), 250);
        assert_eq!(fewest_commands::<5>(true, 2_000, poll_us), 500);
        assert_eq!(fewest_commands::<6>(true, 4_000, poll_us), 250);
    }
}

/// A frame of a RobStride carries its torque in the id. Frames that found no place while the cable was out for a moment must be known
/// again by their motor, not by their torque: they count as sent then.
#[test]
fn a_cable_that_is_out_for_a_moment_is_no_bus_that_is_down() {
    for (period_us, gap_ms) in [(4_000, 5), (4_000, 9), (2_000, 7), (5_000, 9)] {
        let (world, model) = (Simulation::new(1), robstride::Model::RS02);
        let mode = || ImpedanceControl::new(5.0).unwrap();
        let joints =
            [1, 2, 3].map(|id| Actuator::new(robstride::Motor::new(model, id, mode()).unwrap()));
        let mut drives = [1, 2, 3]
            .map(|id| RobStrideDrive::of(model, id).with_shaft(DriveShaft::new(0.25, 0.5)));
        let period = Duration::from_micros(period_us);
        let mut runner =
            Runner::new(Nb(world.controller()), world.clock(), joints).with_period(period);
        let at_ms = |ms: u64| Instant::from_micros(1_000 * ms);
        world.fault(Fault::Unplugged(Line::Can1), at_ms(1_000)..at_ms(1_000 + gap_ms)).unwrap();
        for step in 0..12_000 {
            let [one, two, three] = &mut drives;
            let on: [&mut dyn Drive; 3] = [one, two, three];
            let mut on = on.map(|drive| (Line::Can1, drive));
            world.advance_drives(Duration::from_micros(250), &mut on).unwrap();
            runner.poll(32);
            let Some(tick) = runner.due() else { continue };
            if !runner.is_armed() && (600..700).contains(&(step / 4)) {
                runner.arm(tick).unwrap();
            }
            for (place, joint) in runner.device_mut().iter_mut().enumerate() {
                let torque_nm = 0.3 * (0.01 * step as f32 + place as f32).sin();
                _ = joint.set_torque(torque_nm);
            }
            runner.tick(tick);
            assert_eq!(runner.next_edge(), None, "period {period_us} us, {gap_ms} ms");
        }
        assert!(runner.is_armed(), "period {period_us} us, {gap_ms} ms");
        assert!(runner.statistics().refused > 0, "the cable was not missed");
    }
}

/// Takes every frame but those of some types, whose bits are the highest five of an id of 29.
struct Picky {
    refused: [u32; 2],
    received: Option<CanFrame>,
}

impl embedded_can::nb::Can for Picky {
    type Frame = CanFrame;
    type Error = embedded_can::ErrorKind;

    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, Self::Error> {
        let Id::Extended(id) = frame.id() else { return Ok(None) };
        if self.refused.contains(&(id.as_raw() >> 24)) {
            return Err(nb::Error::WouldBlock);
        }
        Ok(None)
    }

    fn receive(&mut self) -> nb::Result<CanFrame, Self::Error> {
        self.received.take().ok_or(nb::Error::WouldBlock)
    }
}

/// Operation frames that leave must not hide questions that never do: both have the motor in one claim.
#[test]
fn a_question_that_never_leaves_beside_commands_that_do_is_a_bus_that_is_down() {
    let clock = Cell::new(Instant::START);
    let mode = ImpedanceControl::new(5.0).unwrap();
    let motor = robstride::Motor::new(robstride::Model::RS02, 1, mode).unwrap();
    let can = Picky { refused: [0x03, 0x11], received: None };
    let mut runner = Runner::new(Nb(can), &clock, Actuator::new(motor));
    for _ in 0..150 {
        clock.set(clock.get() + Duration::from_millis(1));
        let feedback = [0x7F, 0xFF, 0x7F, 0xFF, 0x7F, 0xFF, 1, 0];
        let id = ExtendedId::new(0x0200_01FD).unwrap();
        runner.port_mut().0.received = Some(CanFrame::of(id, feedback));
        runner.poll(16);
        let tick = runner.due().unwrap();
        runner.tick(tick);
    }
    assert!(runner.is_bus_down());
}
