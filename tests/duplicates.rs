//! Two drives with one id: found at rest, at each rate of the loop, and nothing else looks like two.

#![cfg(test)]
#![expect(clippy::cast_precision_loss, reason = "microseconds of milliseconds")]

use drivetrain::frame::CanFrame;
use drivetrain::motor::{
    Actuator, ArmError, Condition, Devices, DriveProtocol, HealthConfig, ImpedanceControl,
    Reaction, Timeouts, VelocityDrive,
};
use drivetrain::sim::{DamiaoDrive, Drive, LkDrive, RmdDrive, RobStrideDrive};
use drivetrain::time::{Duration, Instant, Tick};
use drivetrain::units::AngularVelocity;
use drivetrain::{damiao, lk, rmd, robstride};

/// A motor beside its drives, in a loop of any rate.
struct Bench<M> {
    own: Actuator<M>,
    drives: Vec<Box<dyn Drive>>,
    /// So many of them are on the bus.
    shown: usize,
    period_us: u64,
    now_us: u64,
    /// A frame of another controller in each update.
    rival: Option<CanFrame>,
    /// The driver takes frames after so many of 100 updates.
    percent: u64,
    room: u64,
    /// Each n-th answer is lost on reception; 0 for none.
    lost: u64,
    heard: u64,
}

impl<M: DriveProtocol> Bench<M> {
    fn new<D: Drive + 'static>(motor: M, hz: u64, drive: impl Fn() -> D) -> Self {
        // At rest each second frame may be a question.
        let late = Duration::from_micros(2_500_000 / hz).max(Duration::from_millis(10));
        let timeouts = Timeouts::new().with_feedback(late, Duration::from_millis(200)).unwrap();
        let own = Actuator::new(motor).with_timeouts(timeouts);
        let drives = (0..2).map(|_| Box::new(drive()) as Box<dyn Drive>).collect();
        let period_us = 1_000_000 / hz;
        Self {
            own,
            drives,
            shown: 1,
            period_us,
            now_us: 0,
            rival: None,
            percent: 100,
            room: 0,
            lost: 0,
            heard: 0,
        }
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    fn deliver(&mut self, frame: &CanFrame) {
        let now = self.now();
        for drive in self.drives.iter_mut().take(self.shown) {
            let Some(answer) = drive.hear(frame) else { continue };
            self.heard += 1;
            if self.lost == 0 || !self.heard.is_multiple_of(self.lost) {
                _ = Devices::ingest(&mut self.own, &answer, now);
            }
        }
    }

    /// The driver takes all frames; returns how many.
    fn send(&mut self) -> u64 {
        let mut sent = 0;
        while let Some(frame) = self.own.next_frame(0) {
            self.deliver(&frame);
            sent += 1;
        }
        sent
    }

    fn run(&mut self, ms: u64) {
        for _ in 0..ms * 1_000 / self.period_us {
            // Of the kind that the mode takes; refused by a disarmed motor.
            _ = self.own.set_torque(0.0);
            _ = self.own.set_velocity((), AngularVelocity::ZERO);
            self.tick();
        }
    }

    fn tick(&mut self) {
        self.now_us += self.period_us;
        let dt_s = self.period_us as f32 * 1e-6;
        self.own.update(Tick::new(self.now(), dt_s));
        self.room += self.percent;
        if self.room >= 100 {
            self.room -= 100;
            self.send();
        }
        if let Some(frame) = self.rival {
            let now = self.now();
            _ = Devices::ingest(&mut self.own, &frame, now);
            self.deliver(&frame);
        }
        self.drives.iter_mut().for_each(|drive| drive.step(dt_s));
    }

    /// Asks in each tick of so many seconds, until armed; returns after how many.
    fn ask_for(&mut self, seconds: u64) -> u64 {
        let most = seconds * 1_000_000 / self.period_us;
        for ticks in 0..most {
            if self.own.arm(self.now()).is_ok() {
                return ticks;
            }
            self.tick();
        }
        most
    }

    fn is_double(&self) -> bool {
        self.own.health().conditions.contains(Condition::DuplicateId)
    }

    /// Two drives are not armed, and one is, also after it was driven and switched off.
    fn check(mut self, what: &str) {
        self.run(2_500);
        assert!(!self.is_double(), "{what}: one drive");
        self.own.arm(self.now()).unwrap_or_else(|error| panic!("{what}: {error}"));
        self.run(1_300);
        assert!(self.own.is_armed() && self.own.guard().has_target(), "{what}: driven");
        Devices::disarm(&mut self.own);
        for _ in 0..20 {
            self.run(100);
            assert!(!self.is_double(), "{what}: one drive that was driven");
        }
        self.shown = 2;
        self.run(3_000);
        let refused = self.own.arm(self.now());
        // The second echo of a drive that echoes commands is one of another node.
        let is_found = matches!(refused, Err(ArmError::Faulty(_) | ArmError::SecondMaster(_)));
        assert!(is_found, "{what}: two drives, {refused:?}");
        self.shown = 1;
        self.run(3_000);
        self.own.arm(self.now()).unwrap_or_else(|error| panic!("{what}: one again, {error}"));
    }
}

fn mit() -> ImpedanceControl {
    ImpedanceControl::new(2.0).unwrap()
}

fn damiao(hz: u64) -> Bench<damiao::Motor> {
    let model = damiao::Model::J4310;
    let motor = damiao::Motor::new(model, 1, mit()).unwrap();
    Bench::new(motor, hz, move || DamiaoDrive::of(model, 1))
}

#[test]
fn two_drives_with_one_id_are_found_at_each_rate_of_the_loop() {
    for hz in [100, 125, 200, 250, 400, 500, 700, 1_000, 2_000] {
        damiao(hz).check(&format!("damiao at {hz} Hz"));
        let mode = damiao::Mode::velocity(AngularVelocity::from_rad_per_s(5.0));
        let motor = damiao::Motor::new(damiao::Model::J4310, 1, mode).unwrap();
        let drive = || DamiaoDrive::of(damiao::Model::J4310, 1).with_register(10, 3.0);
        Bench::new(motor, hz, drive).check(&format!("damiao, velocity, at {hz} Hz"));
        let motor = robstride::Motor::new(robstride::Model::RS02, 1, mit()).unwrap();
        let drive = || RobStrideDrive::of(robstride::Model::RS02, 1);
        Bench::new(motor, hz, drive).check(&format!("robstride at {hz} Hz"));
        let motor = lk::Motor::new(lk::Model::MG5010E_I10, 1, mit()).unwrap();
        let drive = || LkDrive::of(lk::Model::MG5010E_I10, 1);
        Bench::new(motor, hz, drive).check(&format!("lk at {hz} Hz"));
        let motor = rmd::Motor::new(rmd::Model::X8_120, 1, mit()).unwrap();
        Bench::new(motor, hz, || RmdDrive::new(1, 2.4)).check(&format!("rmd at {hz} Hz"));
    }
}

/// The program asks from the first tick on, and a person has not waited.
#[test]
fn two_drives_from_the_start_are_never_armed_and_one_is_soon() {
    for hz in [100_u32, 250, 500, 1_000, 2_000] {
        let robstride = || {
            let motor = robstride::Motor::new(robstride::Model::RS02, 1, mit()).unwrap();
            Bench::new(motor, hz.into(), || RobStrideDrive::of(robstride::Model::RS02, 1))
        };
        check_start(&damiao, hz);
        check_start(&|_| robstride(), hz);
    }
}

fn check_start<M: DriveProtocol>(bench: &dyn Fn(u64) -> Bench<M>, hz: u32) {
    for shown in [1, 2] {
        let mut bench = bench(hz.into());
        bench.shown = shown;
        let ticks = bench.ask_for(6);
        assert_eq!(bench.own.is_armed(), shown == 1, "{hz} Hz, {shown} drives");
        // A request in each tick is one request, which a trip would refuse; none tripped.
        assert!(shown == 2 || ticks < 250, "{hz} Hz: {ticks} ticks");
    }
}

/// Whenever the second drive comes, in the window of the rate or not.
#[test]
fn a_second_drive_is_found_within_a_second() {
    for hz in [250, 500, 1_000] {
        for begins_ms in [2_000, 2_100, 2_300, 2_500, 2_700, 2_900] {
            let mut bench = damiao(hz);
            bench.run(begins_ms);
            bench.shown = 2;
            bench.run(1_000);
            assert!(bench.is_double(), "{hz} Hz, plugged in after {begins_ms} ms");
            bench.shown = 1;
            bench.run(1_000);
            assert!(!bench.is_double(), "{hz} Hz, plugged in after {begins_ms} ms");
        }
        // Both were without supply while the controller ran.
        for silent_ms in [1_000, 1_300, 1_600, 1_900] {
            let mut bench = damiao(hz);
            bench.shown = 0;
            bench.run(silent_ms);
            bench.shown = 2;
            bench.run(1_000);
            assert!(bench.is_double(), "{hz} Hz, silent for {silent_ms} ms");
        }
    }
}

/// The drive answers a tool, or another controller, that the program knows of.
#[test]
fn a_second_master_that_is_ignored_is_no_second_drive() {
    static TOLERANT: HealthConfig =
        HealthConfig::new().with_reaction(Condition::SecondMaster, Reaction::Ignore);
    for hz in [250, 1_000] {
        let mut bench = damiao(hz);
        bench.own = bench.own.with_health(&TOLERANT).unwrap();
        // Disables.
        bench.rival = CanFrame::standard(1, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD]);
        bench.run(3_000);
        assert!(!bench.is_double(), "{hz} Hz");
        bench.own.arm(bench.now()).unwrap();
    }
}

/// The application wants an edge alone, and takes the two for one.
#[test]
fn two_drives_that_are_only_reported_are_armed() {
    static REPORTS: HealthConfig =
        HealthConfig::new().with_reaction(Condition::DuplicateId, Reaction::Report);
    let mut bench = damiao(1_000);
    bench.own = bench.own.with_health(&REPORTS).unwrap();
    bench.shown = 2;
    bench.run(3_000);
    assert!(bench.is_double());
    bench.own.arm(bench.now()).unwrap();
}

/// A frame that the bus had no place for is not answered.
#[test]
fn two_drives_are_found_on_a_bus_with_room_for_a_part_of_the_frames() {
    for percent in [90, 80, 70, 60, 55] {
        for shown in [1, 2] {
            let mut bench = damiao(1_000);
            let late = Duration::from_millis(20);
            let timeouts = Timeouts::new().with_feedback(late, Duration::from_millis(300)).unwrap();
            bench.own = bench.own.with_timeouts(timeouts);
            (bench.shown, bench.percent) = (shown, percent);
            (0..3_000).for_each(|_| bench.tick());
            assert_eq!(bench.is_double(), shown == 2, "{percent} %, {shown} drives");
            assert_eq!(
                bench.own.arm(bench.now()).is_ok(),
                shown == 1,
                "{percent} %, {shown} drives"
            );
        }
    }
}

/// The rest of each disarming is answered too, and is one frame however often the program disarms.
#[test]
fn a_program_that_disarms_between_the_updates_has_one_drive_and_a_bus_with_room() {
    for hz in [50, 100, 125, 200, 250, 500, 1_000] {
        for (times, shown) in [(1, 1), (20, 1), (1, 2), (20, 2)] {
            let mut bench = damiao(hz);
            bench.shown = shown;
            let mut sent = 0;
            for _ in 0..5 * hz {
                bench.tick();
                for _ in 0..times {
                    Devices::disarm(&mut bench.own);
                    sent += bench.send();
                }
            }
            assert_eq!(bench.is_double(), shown == 2, "{hz} Hz, {shown} drives");
            assert!(sent <= 5 * hz, "{hz} Hz: {sent} frames in {} updates", 5 * hz);
            assert_eq!(bench.own.arm(bench.now()).is_ok(), shown == 1, "{hz} Hz, {shown} drives");
        }
    }
}

/// A second drive comes while the motor is driven, and the program arms again as soon as it may.
#[test]
fn a_second_drive_that_comes_while_driven_is_not_armed_again() {
    for (hz, pause_ms) in [(1_000, 105), (500, 105), (250, 105), (250, 250), (100, 105), (100, 500)]
    {
        let mut bench = damiao(hz);
        bench.run(2_500);
        bench.own.arm(bench.now()).unwrap();
        bench.run(500);
        bench.shown = 2;
        bench.run(200);
        Devices::disarm(&mut bench.own);
        bench.run(pause_ms);
        let ticks = bench.ask_for(3);
        assert!(!bench.own.is_armed(), "{hz} Hz, {pause_ms} ms, after {ticks} updates");
    }
}

/// Both drives are silent for less than the 100 ms after which the drive may be another one.
#[test]
fn two_drives_stay_two_over_a_gap() {
    for hz in [250, 500, 1_000, 2_000] {
        for gap_ms in (8..=96).step_by(8) {
            let mut bench = damiao(hz);
            bench.shown = 2;
            bench.run(3_000);
            assert!(bench.is_double(), "{hz} Hz");
            bench.shown = 0;
            bench.run(gap_ms);
            bench.shown = 2;
            for _ in 0..2 * hz {
                bench.tick();
                let refused = bench.own.arm(bench.now());
                assert!(refused.is_err() && bench.is_double(), "{hz} Hz, {gap_ms} ms");
            }
        }
    }
}

/// The receive buffer of the controller overflows.
#[test]
fn two_drives_are_found_while_each_third_answer_is_lost() {
    for hz in [250, 500, 1_000] {
        for (lost, shown) in [(3, 1), (3, 2), (4, 1), (4, 2), (10, 1), (10, 2)] {
            let mut bench = damiao(hz);
            (bench.lost, bench.shown) = (lost, shown);
            bench.run(3_000);
            assert_eq!(bench.is_double(), shown == 2, "{hz} Hz, {lost}, {shown} drives");
        }
    }
}

/// The motor is armed and has no target: it rests, and the program may wait for an hour.
#[test]
fn a_second_drive_that_comes_while_armed_without_a_target_trips() {
    for hz in [100, 250, 500, 1_000] {
        armed_and_idle(damiao(hz), &format!("damiao at {hz} Hz"));
        let motor = robstride::Motor::new(robstride::Model::RS02, 1, mit()).unwrap();
        let drive = || RobStrideDrive::of(robstride::Model::RS02, 1);
        armed_and_idle(Bench::new(motor, hz, drive), &format!("robstride at {hz} Hz"));
        let motor = rmd::Motor::new(rmd::Model::X8_120, 1, mit()).unwrap();
        armed_and_idle(Bench::new(motor, hz, || RmdDrive::new(1, 2.4)), &format!("rmd at {hz} Hz"));
    }
}

fn armed_and_idle<M: DriveProtocol>(mut bench: Bench<M>, what: &str) {
    let idle = |bench: &mut Bench<M>, ms: u64| {
        (0..ms * 1_000 / bench.period_us).for_each(|_| bench.tick())
    };
    bench.run(2_500);
    bench.own.arm(bench.now()).unwrap();
    idle(&mut bench, 3_000);
    assert!(bench.own.is_armed(), "{what}: one drive");
    bench.run(500);
    assert!(bench.own.guard().has_target(), "{what}: driven");
    idle(&mut bench, 3_000);
    assert!(bench.own.is_armed() && !bench.is_double(), "{what}: one drive that was driven");
    bench.shown = 2;
    idle(&mut bench, 3_000);
    assert!(!bench.own.is_armed() && bench.is_double(), "{what}: two drives");
}

/// A tool commands each 200 ms, and both drives answer it.
#[test]
fn a_second_drive_that_comes_beside_a_tool_is_not_armed_after_the_tool() {
    for hz in [50, 100, 125, 250, 1_000] {
        let mut bench = damiao(hz);
        bench.run(5_000);
        for turn in 0..100 {
            bench.shown = if turn < 5 { 1 } else { 2 };
            let rival = CanFrame::standard(1, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD]);
            bench.rival = rival;
            bench.tick();
            bench.rival = None;
            bench.run(200);
        }
        for _ in 0..6 * hz {
            bench.tick();
            assert!(bench.own.arm(bench.now()).is_err(), "{hz} Hz");
        }
        assert!(bench.is_double(), "{hz} Hz");
    }
}

/// A second master is known to the program, and there is none.
#[test]
fn two_drives_are_found_where_a_second_master_is_ignored() {
    static TOLERANT: HealthConfig =
        HealthConfig::new().with_reaction(Condition::SecondMaster, Reaction::Ignore);
    for (hz, shown) in [(100, 1), (100, 2), (1_000, 1), (1_000, 2)] {
        let mut bench = damiao(hz);
        bench.own = bench.own.with_health(&TOLERANT).unwrap();
        bench.shown = shown;
        let ticks = bench.ask_for(5);
        assert_eq!(bench.own.is_armed(), shown == 1, "{hz} Hz, {shown} drives, {ticks} updates");
        assert_eq!(bench.is_double(), shown == 2, "{hz} Hz, {shown} drives");
    }
}

/// The checks of a driven motor are 8 ms apart: its answers until then are none of the rest.
#[test]
fn one_drive_stays_one_whenever_its_target_ends() {
    for hz in [500, 1_000, 2_000, 2_500, 3_000, 4_000, 5_000] {
        let mut bench = damiao(hz);
        bench.run(2_500);
        bench.own.arm(bench.now()).unwrap();
        for pause in 0..60 {
            bench.run(100);
            (0..hz / 5 + pause).for_each(|_| bench.tick());
            assert!(bench.own.is_armed() && !bench.is_double(), "{hz} Hz, pause {pause}");
        }
    }
}
