//! Drives with command frames of their own, each written from its manual and without the codec of its family.

mod damiao;
mod lk;
mod odrive;
mod rmd;
mod robstride;
mod vesc;

pub use damiao::DamiaoDrive;
pub use lk::LkDrive;
pub use odrive::OdriveDrive;
pub use rmd::RmdDrive;
pub use robstride::RobStrideDrive;
pub use vesc::VescDrive;

use super::{Line, Sender, SimError, Simulation};
use crate::frame::CanFrame;
use crate::time::Duration;

/// The longest step of the drives, in µs.
const STEP_US: u64 = 250;

/// A drive with its shaft, for tests: hears frames, answers, sends frames by itself, and moves.
///
/// [`Simulation::advance_drives`] puts drives on a bus: those of the families, and your own. A program may also call these methods itself.
pub trait Drive {
    /// Takes a frame from the bus and returns the answer. Returns `None` for a frame without an answer, and for a frame to another drive.
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame>;

    /// Advances by a time in s.
    fn step(&mut self, dt_s: f32);

    /// Returns the next frame that the drive sends by itself; `None` until the next is due, and for a drive that only answers.
    fn next_frame(&mut self) -> Option<CanFrame> {
        None
    }
}

impl Simulation {
    /// Moves time forward with drives on their buses.
    ///
    /// Each drive hears the frames of the controller on its line, when a frame has passed, and sends its answer at once. Frames of other
    /// senders, and frames lost by a fault, are not heard. Shafts move in steps of at most 250 µs, and after each step the drives send the
    /// frames that are due. The drives of a line are one foreign node: they send in the order of their frames. The time of a blocking call
    /// does not move the drives.
    ///
    /// # Errors
    /// [`SimError::BusFull`] if 64 frames wait on a bus: the frame of the drive is lost. The time has passed all the same.
    ///
    /// # Examples
    /// A drive of LK-TECH and a VESC on two buses:
    /// ```
    /// use drivetrain::frame::CanFrame;
    /// use drivetrain::lk::Model;
    /// use drivetrain::encoder::GearRatio;
    /// use drivetrain::sim::{Line, LkDrive, Simulation, VescDrive};
    /// use drivetrain::time::Duration;
    /// use drivetrain::units::AngularVelocity;
    /// use drivetrain::vesc;
    /// use embedded_can::nb::Can;
    ///
    /// let model = vesc::Model {
    ///     name: "wheel",
    ///     pole_pairs: 7,
    ///     gear: GearRatio::DIRECT,
    ///     torque_constant_nm_per_a: 0.05,
    ///     current_limit_a: 40.0,
    ///     max_velocity: AngularVelocity::from_rad_per_s(600.0),
    /// };
    /// let mut yaw = LkDrive::of(Model::MF9025_16T, 1);
    /// let mut shooter = VescDrive::of(model, 23).with_status_hz(500.0);
    ///
    /// let world = Simulation::new(7);
    /// let torque = CanFrame::standard(0x141, [0xA1, 0, 0, 0, 100, 0, 0, 0]).ok_or("id")?;
    /// world.controller().transmit(&torque).map_err(|_| "refused")?;
    /// let tick = Duration::from_millis(10);
    /// world.advance_drives(tick, &mut [(Line::Can1, &mut yaw), (Line::Can2, &mut shooter)])?;
    /// assert_eq!(world.traffic(Line::Can1).frames, 2); // the command and its answer
    /// assert_eq!(world.traffic(Line::Can2).heard, 12); // status 1, 4 and 5 after 2, 4, 6 and 8 ms
    /// assert!(yaw.shaft().velocity_rad_per_s() > 0.0);
    ///
    /// // Equal drives on one line:
    /// let mut joints = [2, 3].map(|id| LkDrive::of(Model::MG5010E_I10, id));
    /// world.advance_drives(tick, &mut joints.each_mut().map(|joint| (Line::Can3, joint as _)))?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn advance_drives(
        &self,
        duration: Duration,
        drives: &mut [(Line, &mut dyn Drive)],
    ) -> Result<(), SimError> {
        let mut outcome = Ok(());
        let mut left_us = duration.as_micros();
        loop {
            let span = Duration::from_micros(left_us.min(STEP_US));
            self.advance_with(span, |record| {
                if record.sender != Sender::Controller || !record.delivered {
                    return;
                }
                for (_, drive) in drives.iter_mut().filter(|(line, _)| *line == record.line) {
                    if let Some(answer) = drive.hear(&record.frame) {
                        outcome = outcome.and(self.inject(record.line, answer));
                    }
                }
            });
            for (line, drive) in drives.iter_mut() {
                drive.step(span.as_secs_f32());
                let mut sent = Ok(());
                // A drive that always has a frame ends with a full bus.
                while let (Ok(()), Some(frame)) = (sent, drive.next_frame()) {
                    sent = self.inject(*line, frame);
                }
                outcome = outcome.and(sent);
            }
            left_us = left_us.saturating_sub(STEP_US);
            if left_us == 0 {
                return outcome;
            }
        }
    }
}

/// An output shaft with inertia and viscous friction, turned by a drive and by a load.
///
/// # Examples
/// ```
/// use drivetrain::sim::DriveShaft;
///
/// let mut shaft = DriveShaft::new(0.01, 0.0); // kg m², Nm s/rad
/// shaft.set_load(0.5);
/// for _ in 0..1_000 {
///     shaft.step(0.0, 0.001);
/// }
/// assert!((shaft.velocity_rad_per_s() - 50.0).abs() < 0.01);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct DriveShaft {
    angle_rad: f64,
    velocity_rad_per_s: f64,
    torque_nm: f64,
    load_nm: f64,
    inertia_kg_m2: f64,
    friction_nm_s: f64,
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to single precision")]
impl DriveShaft {
    /// Makes a shaft at rest with an inertia in kg m², above zero, and a viscous friction in Nm s/rad.
    #[must_use]
    pub fn new(inertia_kg_m2: f32, friction_nm_s: f32) -> Self {
        Self {
            angle_rad: 0.0,
            velocity_rad_per_s: 0.0,
            torque_nm: 0.0,
            load_nm: 0.0,
            inertia_kg_m2: inertia_kg_m2.into(),
            friction_nm_s: friction_nm_s.into(),
        }
    }

    /// Sets an external torque in Nm, such as the weight of an arm.
    pub fn set_load(&mut self, torque_nm: f32) {
        self.load_nm = torque_nm.into();
    }

    /// Sets the angle in rad.
    pub fn set_angle(&mut self, angle_rad: f32) {
        self.angle_rad = angle_rad.into();
    }

    /// Sets the velocity in rad/s.
    pub fn set_velocity(&mut self, velocity_rad_per_s: f32) {
        self.velocity_rad_per_s = velocity_rad_per_s.into();
    }

    /// Returns the angle in rad, over any number of turns.
    #[must_use]
    pub const fn angle_rad(&self) -> f32 {
        self.angle_rad as f32
    }

    /// Returns the velocity in rad/s.
    #[must_use]
    pub const fn velocity_rad_per_s(&self) -> f32 {
        self.velocity_rad_per_s as f32
    }

    /// Returns the torque of the drive in the last step, in Nm.
    #[must_use]
    pub const fn torque_nm(&self) -> f32 {
        self.torque_nm as f32
    }

    /// Advances by a time in s under a torque of the drive in Nm.
    pub fn step(&mut self, torque_nm: f64, dt_s: f64) {
        self.torque_nm = torque_nm;
        let sum = torque_nm + self.load_nm - self.friction_nm_s * self.velocity_rad_per_s;
        self.velocity_rad_per_s += sum / self.inertia_kg_m2 * dt_s;
        self.angle_rad += self.velocity_rad_per_s * dt_s;
    }

    /// Returns the torque in Nm of a drive's own speed loop that follows a velocity in rad/s.
    fn following_nm(&self, velocity_rad_per_s: f64) -> f64 {
        100.0 * self.inertia_kg_m2 * (velocity_rad_per_s - self.velocity_rad_per_s)
    }
}

/// Returns the value within its range around zero, at whose end it begins again at the other. The shaft stays within billions of turns.
fn wrapped(value: f64, range: f64) -> f64 {
    let rest = (value + range) % (2.0 * range);
    (if rest < 0.0 { rest + 2.0 * range } else { rest }) - range
}

/// Clamps a value to a limit and its negative; the sign of the limit does not count.
const fn within(value: f64, limit: f64) -> f64 {
    value.min(limit.abs()).max(-limit.abs())
}

/// Returns the value of the bits of a float in a frame, clamped to a million, and 0 for NaN: the shaft stays finite.
fn float(bits: u32) -> f64 {
    let value = f64::from(f32::from_bits(bits));
    if value.is_nan() { 0.0 } else { value.clamp(-1e6, 1e6) }
}

#[cfg(test)]
mod tests {
    use super::{Drive, *};
    use crate::encoder::GearRatio;
    use crate::sim::Fault;
    use crate::time::Instant;
    use crate::units::AngularVelocity;
    use crate::{damiao, lk, robstride, vesc};
    use core::iter;
    use embedded_can::nb::Can;
    use embedded_can::{ExtendedId, Frame, Id, StandardId};
    use std::string::ToString;
    use std::vec;
    use std::vec::Vec;

    /// A drive that records frames and steps, and answers each frame with the same data under the next id.
    #[derive(Default)]
    struct Probe {
        heard: Vec<u16>,
        steps_us: Vec<u64>,
        is_endless: bool,
    }

    impl Drive for Probe {
        fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame> {
            let Id::Standard(id) = frame.id() else { return None };
            self.heard.push(id.as_raw());
            CanFrame::standard(id.as_raw() + 1, *frame.bytes())
        }

        fn step(&mut self, dt_s: f32) {
            self.steps_us.push(Duration::from_secs_f32(dt_s).unwrap().as_micros());
        }

        fn next_frame(&mut self) -> Option<CanFrame> {
            self.is_endless.then(|| standard(0x700, [0; 8]))
        }
    }

    fn standard(id: u16, data: [u8; 8]) -> CanFrame {
        CanFrame::standard(id, data).unwrap()
    }

    fn extended(id: u32, data: &[u8]) -> CanFrame {
        CanFrame::new(ExtendedId::new(id).unwrap(), data).unwrap()
    }

    const MS: Duration = Duration::from_millis(1);

    const VESC: vesc::Model = vesc::Model {
        name: "wheel",
        pole_pairs: 7,
        gear: GearRatio::DIRECT,
        torque_constant_nm_per_a: 0.05,
        current_limit_a: 40.0,
        max_velocity: AngularVelocity::from_rad_per_s(600.0),
    };

    #[test]
    fn drives_of_six_families_on_two_buses_answer_the_controller_and_nobody_else() {
        let mut damiao = DamiaoDrive::of(damiao::Model::J4310, 1);
        let mut lk = LkDrive::of(lk::Model::MF9025_16T, 1);
        let mut rmd = RmdDrive::new(2, 2.4);
        let mut robstride = RobStrideDrive::of(robstride::Model::RS02, 1);
        let mut vesc = VescDrive::of(VESC, 23);
        let mut odrive = OdriveDrive::new(3, true, 0.05, 1.0).with_periods(0.0, 0.0);

        let enable_damiao = standard(1, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC]);
        let enable_robstride = extended(0x0300_FD01, &[0; 8]);
        let torque = [0xA1, 0, 0, 0, 100, 0, 0, 0];
        let commands = [
            (Line::Can1, enable_damiao, 0x011),
            (Line::Can1, standard(0x141, torque), 0x141),
            (Line::Can1, standard(0x142, torque), 0x242),
            (Line::Can2, enable_robstride, 0x0280_01FD),
            (Line::Can2, extended(0x817, &[254, 0, 50, 0, 0, 0x80, 0]), 0x8FE),
            (Line::Can2, CanFrame::new_remote(StandardId::new(0x069).unwrap(), 8).unwrap(), 0x069),
        ];
        let world = Simulation::new(1);
        let mut advance = || {
            let drives: &mut [(Line, &mut dyn Drive)] = &mut [
                (Line::Can1, &mut damiao),
                (Line::Can1, &mut lk),
                (Line::Can1, &mut rmd),
                (Line::Can2, &mut robstride),
                (Line::Can2, &mut vesc),
                (Line::Can2, &mut odrive),
            ];
            world.advance_drives(Duration::from_millis(20), drives).unwrap();
            let heard = [Line::Can1, Line::Can2].map(|line| {
                let mut controller = world.controller_on(line);
                let mut heard: Vec<CanFrame> =
                    iter::from_fn(|| controller.receive().ok()).collect();
                heard.sort_by_key(|frame| frame.header() & 0x1FFF_FFFF);
                heard
            });
            let are_enabled = [damiao.is_enabled(), robstride.is_enabled()];
            (heard, are_enabled, [lk.shaft().torque_nm(), rmd.shaft().torque_nm()])
        };
        // A foreign node is heard by the controller, and its commands by no drive.
        for (line, command, _) in commands {
            world.inject(line, command).unwrap();
        }
        let (heard, are_enabled, torques_nm) = advance();
        let injected = commands.map(|(_, command, _)| command);
        assert!(heard.iter().flatten().all(|frame| injected.contains(frame)), "{heard:?}");
        assert_eq!([3, 3], heard.map(|frames| frames.len()));
        assert_eq!(are_enabled, [false; 2]);
        assert!(torques_nm.iter().all(|torque_nm| *torque_nm == 0.0));

        for (line, command, _) in commands {
            world.controller_on(line).transmit(&command).unwrap();
        }
        let (heard, are_enabled, [lk_nm, rmd_nm]) = advance();
        for (line, heard) in [Line::Can1, Line::Can2].into_iter().zip(heard) {
            let ids: Vec<u32> = heard.iter().map(|frame| frame.header() & 0x1FFF_FFFF).collect();
            let answers = commands.iter().filter(|(on, ..)| *on == line).map(|(.., id)| *id);
            assert_eq!(ids.len(), 3, "{line:?}: {heard:?}");
            assert!(answers.into_iter().all(|id| ids.contains(&id)), "{line:?}: {heard:?}");
            // Three frames of the foreign node, three commands, three answers: the drive of LK did not answer its own answer.
            assert_eq!(world.traffic(line).frames, 9);
        }
        assert_eq!(are_enabled, [true; 2]);
        assert!((lk_nm - 100.0 * 33.0 / 4096.0 * 0.32).abs() < 1e-5);
        assert!((rmd_nm - 2.4).abs() < 1e-5);
    }

    #[test]
    fn a_drive_hears_its_line_when_a_frame_has_passed_and_its_answer_is_sent_at_once() {
        let world = Simulation::new(1);
        let (mut here, mut there) = (Probe::default(), Probe::default());
        let lost = Fault::LostFrames {
            line: Line::Can1,
            id: Some(StandardId::new(0x102).unwrap().into()),
            probability: 1.0,
        };
        world.fault(lost, ..).unwrap();
        world.controller().transmit(&standard(0x102, [1; 8])).unwrap();
        world.controller().transmit(&standard(0x100, [1; 8])).unwrap();
        // Two frames of at most 135 bits, the answer, and the lost frame.
        let half = Duration::from_micros(540);
        world
            .advance_drives(half, &mut [(Line::Can1, &mut here), (Line::Can2, &mut there)])
            .unwrap();
        assert_eq!((here.heard, there.heard), (vec![0x100], vec![]));
        assert_eq!(world.controller().receive(), Ok(standard(0x101, [1; 8])));
        assert!(world.controller().receive().is_err());
        assert_eq!((&here.steps_us, &there.steps_us), (&vec![250, 250, 40], &vec![250, 250, 40]));
    }

    #[test]
    fn a_drive_that_always_has_a_frame_fills_its_bus_and_the_time_goes_on() {
        let world = Simulation::new(1);
        let mut endless = Probe { is_endless: true, ..Probe::default() };
        let mut other = Probe::default();
        let mut drives: [(Line, &mut dyn Drive); 2] =
            [(Line::Can3, &mut endless), (Line::Can1, &mut other)];
        assert_eq!(world.advance_drives(MS, &mut drives), Err(SimError::BusFull(Line::Can3)));
        assert_eq!((world.now(), other.steps_us.len()), (Instant::from_micros(1_000), 4));
        let text = SimError::BusFull(Line::Can3).to_string();
        assert_eq!(text, "64 frames wait on Can3 already: advance the time first");
    }

    #[test]
    fn equal_drives_stand_in_one_line_and_each_answers_a_frame_to_all() {
        let world = Simulation::new(1);
        let mut joints = [1, 2, 3].map(|id| RmdDrive::new(id, 2.4));
        world.controller().transmit(&standard(0x280, [0x9C, 0, 0, 0, 0, 0, 0, 0])).unwrap();
        let mut drives = joints.each_mut().map(|joint| (Line::Can1, joint as _));
        world.advance_drives(MS, &mut drives).unwrap();
        let answers = [0, 1, 2].map(|_| world.controller().receive().unwrap().header());
        assert_eq!(answers, [0x241, 0x242, 0x243]);
    }

    #[test]
    fn a_vesc_sends_its_status_frames_at_a_rate_and_none_at_delivery() {
        for (hz, rounds) in [(500.0, 500_usize), (300.0, 300), (0.0, 0), (-1.0, 0), (f32::NAN, 0)] {
            let mut drive = VescDrive::of(VESC, 23).with_status_hz(hz);
            let mut packets = Vec::new();
            for _ in 0..4_000 {
                drive.step(0.000_25);
                packets
                    .extend(iter::from_fn(|| drive.next_frame()).map(|it| it.header() >> 8 & 0xFF));
            }
            assert!(rounds.abs_diff(packets.len() / 3) <= 1, "{hz} Hz: {}", packets.len());
            assert!(packets.chunks(3).all(|round| round == [27, 16, 9]), "{hz} Hz");
        }
        assert!(iter::from_fn(|| VescDrive::of(VESC, 23).next_frame()).next().is_none());
    }

    /// Found by fuzzing: a range of torques below zero, and limits that are no numbers, ended the simulation.
    #[test]
    fn a_register_or_a_limit_that_makes_no_sense_gives_a_finite_torque() {
        let mut damiao = DamiaoDrive::of(damiao::Model::J4310, 1).with_register(23, -10.0);
        let mut odrive = OdriveDrive::new(1, false, 0.05, 1.0);
        for data in [[0xFF; 8], [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC], [0; 8]] {
            let frame = CanFrame::standard(1, data).unwrap();
            assert!(damiao.hear(&frame).is_some());
            damiao.step(1e-3);
            assert!(damiao.shaft().torque_nm().abs() <= 10.0);
        }
        for (number, data) in [(0x0B, [2, 0, 0, 0, 1, 0, 0, 0]), (0x07, [8, 0, 0, 0, 0, 0, 0, 0])] {
            _ = odrive.hear(&CanFrame::standard(1 << 5 | number, data).unwrap());
        }
        // Limits and velocity of NaN.
        for number in [0x0F, 0x0D] {
            _ = odrive.hear(&CanFrame::standard(1 << 5 | number, [0xFF; 8]).unwrap());
            odrive.step(1e-3);
            assert_eq!((odrive.state(), odrive.shaft().torque_nm()), (8, 0.0));
        }
    }
}
