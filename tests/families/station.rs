//! A motor of any family with its simulated drive: the face that tests of all families need.

use crate::drives::{raw, with_id};
use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, AngleDrive, ArmError, BusLoad, CanDevice, Capabilities, Claim, Conditions, Devices,
    DriveProtocol, HealthConfig, Ingest, Link, TargetError, VelocityDrive,
};
use drivetrain::sim::DriveShaft;
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};

/// A motor as a device, whichever type it has.
pub(crate) trait Device {
    fn update(&mut self, tick: Tick);
    fn next_frame(&mut self) -> Option<CanFrame>;
    fn requeue(&mut self, frame: &CanFrame) -> bool;
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest;
    fn arm(&mut self, now: Instant) -> Result<(), ArmError>;
    fn disarm(&mut self);
    fn emergency_stop(&mut self);
    fn clear_emergency_stop(&mut self);
    fn is_armed(&mut self) -> bool;
    /// Sets a share of the target that the test of a mode drives to.
    fn set(&mut self, share: f32) -> Result<(), TargetError>;
    fn set_velocity(&mut self, rad_per_s: f32) -> Result<(), TargetError>;
    fn capabilities(&self) -> Capabilities;
    /// Turns the positive direction round.
    fn reverse(&mut self);
    fn set_present_angle(&mut self, angle_rad: f32) -> Result<(), TargetError>;
    fn set_health(&mut self, config: &'static HealthConfig);
    fn conditions(&self) -> Conditions;
    fn angle_rad(&self) -> Option<f32>;
    fn velocity_rad_per_s(&self) -> Option<f32>;
    fn link(&self) -> Link;
    fn claims(&self) -> Vec<Claim>;
    fn has_rival(&self) -> bool;
    fn error_code(&self) -> u8;
    /// Of a bus of 1 Mbit/s at 1 kHz.
    fn load(&self) -> BusLoad;
}

pub(crate) type Set<M> = fn(&mut Actuator<M>, f32) -> Result<(), TargetError>;

/// A motor, and the target that it is driven to.
pub(crate) struct Driven<M>(pub(crate) Actuator<M>, pub(crate) Set<M>);

impl<M: DriveProtocol + Copy> Device for Driven<M> {
    fn update(&mut self, tick: Tick) {
        Devices::update(&mut self.0, tick);
    }
    fn next_frame(&mut self) -> Option<CanFrame> {
        Devices::next_frame(&mut self.0, 0)
    }
    fn requeue(&mut self, frame: &CanFrame) -> bool {
        Devices::requeue(&mut self.0, frame)
    }
    fn ingest(&mut self, frame: &CanFrame, now: Instant) -> Ingest {
        Devices::ingest(&mut self.0, frame, now)
    }
    fn arm(&mut self, now: Instant) -> Result<(), ArmError> {
        Devices::arm(&mut self.0, now)
    }
    fn disarm(&mut self) {
        Devices::disarm(&mut self.0);
    }
    fn emergency_stop(&mut self) {
        Devices::emergency_stop(&mut self.0);
    }
    fn clear_emergency_stop(&mut self) {
        Devices::clear_emergency_stop(&mut self.0);
    }
    fn is_armed(&mut self) -> bool {
        Devices::is_armed(&mut self.0)
    }
    fn set(&mut self, share: f32) -> Result<(), TargetError> {
        (self.1)(&mut self.0, share)
    }
    fn set_velocity(&mut self, rad_per_s: f32) -> Result<(), TargetError> {
        self.0.set_velocity((), AngularVelocity::from_rad_per_s(rad_per_s))
    }
    fn capabilities(&self) -> Capabilities {
        VelocityDrive::capabilities(&self.0, ())
    }
    fn reverse(&mut self) {
        self.0 = self.0.reversed();
    }
    fn set_present_angle(&mut self, angle_rad: f32) -> Result<(), TargetError> {
        self.0.set_present_angle(Angle::from_radians(angle_rad))
    }
    fn set_health(&mut self, config: &'static HealthConfig) {
        self.0 = self.0.with_health(config).unwrap();
    }
    fn conditions(&self) -> Conditions {
        self.0.health().conditions
    }
    fn angle_rad(&self) -> Option<f32> {
        AngleDrive::angle(&self.0, ()).map(Angle::as_radians)
    }
    fn velocity_rad_per_s(&self) -> Option<f32> {
        VelocityDrive::velocity(&self.0, ()).map(AngularVelocity::as_rad_per_s)
    }
    fn link(&self) -> Link {
        self.0.guard().link()
    }
    fn claims(&self) -> Vec<Claim> {
        CanDevice::claims(&self.0).collect()
    }
    fn has_rival(&self) -> bool {
        CanDevice::second_master(&self.0).is_some()
    }
    fn error_code(&self) -> u8 {
        self.0.health().error_code
    }
    fn load(&self) -> BusLoad {
        self.0.load(1_000_000, 1_000)
    }
}

/// A simulated drive, and its protocol as its manual has it: nothing here comes from the codec of the family.
pub(crate) trait Drive {
    fn hear(&mut self, frame: &CanFrame) -> Option<CanFrame>;
    /// The frames that the drive sends by itself in this millisecond.
    fn reports(&mut self) -> Vec<CanFrame> {
        Vec::new()
    }
    fn step(&mut self, dt_s: f32);
    fn shaft(&self) -> &DriveShaft;
    fn shaft_mut(&mut self) -> &mut DriveShaft;
    fn lose_supply(&mut self);
    /// The drive fails, until its error is cleared.
    fn fail(&mut self);
    /// Sets the drive to a mode that the program is not written for.
    ///
    /// # Errors
    /// The reason why the family has no such setting.
    fn missets(&mut self) -> Result<(), &'static str> {
        Err("each command has its mode")
    }
    /// Sets the drive to a range that the program is not written for.
    ///
    /// # Errors
    /// The end of the cell of a family without such a setting.
    fn misranges(&mut self) -> Result<(), &'static str> {
        Err("")
    }
    /// Has the drive take no other mode; `false` for a drive whose settings are read.
    fn keeps_modes(&mut self) -> bool {
        false
    }
    /// A frame of the feedback whose value no shaft has.
    ///
    /// # Errors
    /// The reason why there is none.
    fn impossible(&mut self) -> Result<CanFrame, &'static str> {
        Err("the fields have no such value")
    }
    /// The same frame, from a drive with another id on the same bus.
    fn of_neighbour(&self, frame: &CanFrame) -> CanFrame {
        with_id(frame, raw(frame) + 1)
    }
    /// The echo of a command by this drive or another.
    ///
    /// # Errors
    /// The reason why no command comes back on the id of the feedback.
    fn echo(&self, command: &CanFrame) -> Result<CanFrame, &'static str>;
    /// Whether a drive reads no torque from the frame: 0 Nm within half a count and no gains, no current, disabled, or a question.
    fn is_rest(&self, frame: &CanFrame) -> bool;
}

/// A motor and its drive on a bus that loses nothing unless told.
pub(crate) struct Station {
    pub(crate) device: Box<dyn Device>,
    pub(crate) drive: Box<dyn Drive>,
    /// The result of arming two motors with the id of this one.
    pub(crate) twins: Result<(), ArmError>,
    pub(crate) now_us: u64,
    /// The time step that an update is given.
    pub(crate) dt_s: f32,
    /// The frames of the last update.
    pub(crate) frames: Vec<CanFrame>,
    /// The outcome of each frame of the drive in the last update.
    pub(crate) outcomes: Vec<Ingest>,
    /// No frame reaches the drive.
    pub(crate) is_cut: bool,
    /// The frames of the drive are lost.
    pub(crate) is_deaf: bool,
    pub(crate) bend: Option<Bend>,
    /// The driver gives each frame back.
    pub(crate) is_full: bool,
    /// The answers of the drive to the frames of the last update.
    pub(crate) answers: Vec<CanFrame>,
    /// The frames of the drive in the last update.
    pub(crate) heard: Vec<CanFrame>,
}

/// The frames that the bus delivers for a frame of the drive.
pub(crate) type Bend = Box<dyn FnMut(&dyn Drive, &CanFrame) -> Vec<CanFrame>>;

impl Station {
    pub(crate) fn new<M: DriveProtocol + Copy + 'static>(
        motor: M,
        set: Set<M>,
        drive: impl Drive + 'static,
    ) -> Self {
        let mut twins = [Actuator::new(motor), Actuator::new(motor)];
        Self {
            twins: Devices::arm(&mut twins, Instant::from_micros(1_000)),
            device: Box::new(Driven(Actuator::new(motor), set)),
            drive: Box::new(drive),
            now_us: 1_000,
            dt_s: 0.001,
            frames: Vec::new(),
            outcomes: Vec::new(),
            is_cut: false,
            is_deaf: false,
            bend: None,
            is_full: false,
            heard: Vec::new(),
            answers: Vec::new(),
        }
    }

    pub(crate) const fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    pub(crate) fn deliver(&mut self, frame: &CanFrame) {
        if self.is_deaf {
            return;
        }
        self.heard.push(*frame);
        let frames = match &mut self.bend {
            Some(bend) => bend(&*self.drive, frame),
            None => vec![*frame],
        };
        for frame in frames {
            self.outcomes.push(self.device.ingest(&frame, self.now()));
        }
    }

    /// An update a millisecond after the last.
    pub(crate) fn step(&mut self) {
        self.now_us += 1_000;
        self.step_here();
    }

    /// An update at the present time.
    pub(crate) fn step_here(&mut self) {
        self.outcomes.clear();
        self.heard.clear();
        for report in self.drive.reports() {
            self.deliver(&report);
        }
        self.device.update(Tick::new(self.now(), self.dt_s));
        self.frames.clear();
        self.answers.clear();
        while let Some(frame) = self.device.next_frame() {
            self.frames.push(frame);
            if self.is_full {
                assert!(self.device.requeue(&frame), "{frame:?}");
            }
            if self.is_cut || self.is_full {
                continue;
            }
            if let Some(answer) = self.drive.hear(&frame) {
                self.answers.push(answer);
                self.deliver(&answer);
            }
        }
        assert!(self.frames.len() <= 2, "{:?}", self.frames);
        for _ in 0..10 {
            self.drive.step(1e-4);
        }
    }

    pub(crate) fn steps(&mut self, steps: u32, mut each: impl FnMut(&mut Self)) {
        for _ in 0..steps {
            each(self);
            self.step();
        }
    }

    /// Heard and asked for its settings.
    pub(crate) fn settled(mut self) -> Self {
        self.steps(150, |_| {});
        self
    }

    pub(crate) fn armed(self) -> Self {
        let mut station = self.settled();
        station.device.arm(station.now()).unwrap();
        station
    }

    /// Armed, and driven to the whole target for half a second.
    pub(crate) fn driven(self) -> Self {
        let mut station = self.armed();
        let mut was_driven = false;
        station.steps(500, |station| {
            station.device.set(1.0).unwrap();
            was_driven |= !station.rests();
        });
        assert!(was_driven && station.device.is_armed(), "driven by {:?}", station.frames);
        station
    }

    /// Whether each frame of the last update is rest.
    pub(crate) fn rests(&self) -> bool {
        self.frames.iter().all(|frame| self.drive.is_rest(frame))
    }

    /// Asks for the whole target in each of the next milliseconds. Returns after how many of them each frame was rest, and after how
    /// many the motor was no longer armed.
    pub(crate) fn fade(&mut self, ms: u32) -> (u32, Option<u32>) {
        let (mut rests_after, mut trips_after) = (0, None);
        for after in 1..=ms {
            _ = self.device.set(1.0);
            self.step();
            if !self.rests() {
                rests_after = after;
            }
            if trips_after.is_none() && !self.device.is_armed() {
                trips_after = Some(after);
            }
        }
        assert!(rests_after < ms, "driven to the end: {:?}", self.frames);
        (rests_after + 1, trips_after)
    }
}
