use super::kinematics::{Fastest, slowed};
use super::{ChassisLimits, ChassisStatus, DeadClock, Kinematics, Odometry, WheelSpeed};
use crate::error::ConfigError;
use crate::geometry::{Body, Heading, Pose2, Twist, World};
use crate::math;
use crate::motor::TargetError;
use crate::time::{Instant, Tick};
use crate::units::Angle;

/// A chassis of any layout: commands in, wheel speeds out, pose kept.
///
/// Once a tick: set a command, then [`drive`](Self::drive) the motors, whichever devices own them. A program without motors
/// of this crate gives measured wheel speeds to [`update`](Self::update) and sends the targets itself. In a tick:
///
/// 1. measured wheels and gyroscope move the [`Odometry`];
/// 2. the command is brought into the world and approached within the acceleration limits: the same for every heading;
/// 3. back in the body, the bend of a turning step is taken off and the wheels are slowed together to their limit;
/// 4. the modules of a [`Swerve`](super::Swerve) take the shorter way, and at rest keep their angles:
///    see [`Swerve::steer`](super::Swerve::steer).
///
/// A command that is NaN or infinite, or faster than 1e19 m/s, stops the chassis and is counted. A command not renewed
/// for 0.1 s counts as zero. After a pause of 0.5 s, in which the chassis was not updated, the motion starts over from the wheels,
/// and a command that was set before this tick counts as zero: the next one counts. When a heading differs by more than 0.2 rad
/// from the heading before and the turn of the wheels since, as of a gyroscope that starts again, the wheels go on as before, and a command in the world is approached from
/// there: set the limits of the acceleration, or the wheels jump with the command. A `dt` that is zero, negative, NaN or infinite moves neither pose nor command; a `dt` over
/// 0.1 s counts as 0.1 s for the acceleration, and a `dt` over 1 s moves no pose. In the 100th tick in a row without
/// usable time the clock is dead: the command counts as stale, and since no ramp can be timed, the wheels stop at once.
///
/// # Examples
/// ```
/// use drivetrain::chassis::{Chassis, Mecanum, MecanumWheels};
/// use drivetrain::{geometry::{Twist, Vec2}, time::{Instant, Tick}, units::AngularVelocity};
///
/// let mut chassis = Chassis::new(Mecanum::new(0.1, Vec2::new(0.2, 0.2))?);
/// chassis.set_body(Twist::new(1.0, 0.0, 0.0));
/// let measured = MecanumWheels::splat(Some(AngularVelocity::from_rad_per_s(10.0)));
/// let targets = chassis.update(measured, Tick::new(Instant::from_micros(1_000), 0.001));
/// assert!((targets.front_left.as_rad_per_s() - 10.0).abs() < 1e-5);
/// assert!((chassis.pose().x_m - 0.001).abs() < 1e-9);
/// # Ok::<(), drivetrain::error::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chassis<K: Kinematics> {
    kinematics: K,
    steering: K::Steering,
    limits: ChassisLimits,
    command: Command,
    command_age_s: f32,
    is_renewed: bool,
    updated: Option<Instant>,
    /// Turn of the wheels, less that of the headings, since the last heading that differed; `None` if a part of it is not known.
    unseen_rad: Option<f32>,
    clock: DeadClock,
    gyro: Option<Heading>,
    reference: Twist<World>,
    measured: Twist<Body>,
    odometry: Odometry,
    status: ChassisStatus,
}

/// The commanded motion, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Command {
    Body(Twist<Body>),
    World(Twist<World>),
    Lock,
}

impl<K: Kinematics> Chassis<K> {
    /// The longest step in seconds that counts in full for the acceleration limit.
    pub const MAX_STEP_S: f32 = 0.1;

    /// The largest turn of a chassis against its wheels between two headings of a gyroscope: 11°.
    const JUMP_RAD: f32 = 0.2;

    /// The largest turn of the wheels beside one heading: after a larger turn the wheels slip, or the heading is old.
    const UNSEEN_RAD: f32 = 1.0;

    /// The longest pause between two updates after which the motion of the wheels and the age of a command are known.
    const PAUSE_S: f32 = 0.5;

    /// Takes the layout. Nothing is limited; commands must be renewed every 0.1 s.
    #[must_use]
    pub const fn new(kinematics: K) -> Self {
        Self {
            kinematics,
            steering: K::UNSTEERED,
            limits: ChassisLimits::new(),
            command: Command::Body(Twist::ZERO),
            command_age_s: f32::MAX,
            is_renewed: false,
            updated: None,
            unseen_rad: None,
            clock: DeadClock::new(),
            gyro: None,
            reference: Twist::ZERO,
            measured: Twist::ZERO,
            odometry: Odometry::new(Pose2::ORIGIN),
            status: ChassisStatus {
                motion_known: false,
                lost_wheels: 0,
                blind_s: 0.0,
                slip_m_s: None,
                command_stale: true,
                saturated: false,
                rejected: 0,
                refused: 0,
                refusal: None,
            },
        }
    }

    /// Sets the limits, valid from the next tick on.
    ///
    /// # Errors
    /// Names the value that is not above zero, or too long. The limits then stay unchanged.
    pub fn set_limits(&mut self, limits: ChassisLimits) -> Result<(), ConfigError> {
        limits.validate()?;
        self.limits = limits;
        Ok(())
    }

    /// Commands a motion in the frame of the body.
    ///
    /// Costs 26 instructions on a Cortex-M4F (`docs/figures.md`).
    pub fn set_body(&mut self, twist: Twist<Body>) {
        self.set_command(Command::Body(twist), can_be_meant(twist));
    }

    /// Commands a motion in the frame of the world, and gives the gyroscope's heading for this tick.
    ///
    /// If the heading is NaN or infinite, the command counts as NaN: the chassis stops.
    pub fn set_world(&mut self, twist: Twist<World>, heading: Heading) {
        self.set_command(Command::World(twist), can_be_meant(twist) && heading.is_finite());
        self.gyro = Some(heading).filter(|heading| heading.is_finite());
    }

    /// Sets the gyroscope's heading for the next tick. In ticks without a heading, the wheels continue the heading.
    ///
    /// A heading that is NaN or infinite is ignored, and counted in [`ChassisStatus::rejected`].
    pub const fn set_heading(&mut self, heading: Heading) {
        if heading.is_finite() {
            self.gyro = Some(heading);
        } else {
            self.gyro = None;
            self.status.rejected = self.status.rejected.saturating_add(1);
        }
    }

    /// Commands standing still: the chassis comes to a stop within its limits.
    pub fn stop(&mut self) {
        self.set_body(Twist::ZERO);
    }

    /// Commands a stop in which the chassis resists being pushed.
    ///
    /// The chassis stops within its limits; then the modules of a [`Swerve`](super::Swerve) turn to an X. Other layouts
    /// stand as after [`stop`](Self::stop): the speed loops alone hold the wheels. Renew the command like any other;
    /// otherwise, the modules stay at their angles.
    pub fn lock(&mut self) {
        self.set_command(Command::Lock, true);
    }

    /// Starts over from the measured motion and angles: call this when the motors were relaxed, so that they take over
    /// without a jump.
    pub fn restart(&mut self) {
        self.command = Command::Body(Twist::ZERO);
        self.take_over();
    }

    fn take_over(&mut self) {
        self.steering = K::UNSTEERED;
        self.reference = self.measured.to_world(self.odometry.heading());
    }

    fn set_command(&mut self, command: Command, finite: bool) {
        if finite {
            self.command = command;
        } else {
            self.command = Command::Body(Twist::ZERO);
            self.status.rejected = self.status.rejected.saturating_add(1);
        }
        self.is_renewed = true;
    }

    /// Takes the measured speed of each wheel, `None` without fresh feedback, and returns the target speed of each wheel.
    ///
    /// For a module whose speed is unknown, pass NaN as its speed; its angle is still used for steering.
    pub fn update(
        &mut self,
        measured: K::Wheels<Option<K::Speed>>,
        tick: Tick,
    ) -> K::Wheels<K::Speed> {
        let dt_s = self.clock.take_step(tick.dt_s());
        self.measure(measured, dt_s);
        let heading = self.odometry.heading();
        let passed_s = self.passed_s(tick.now());
        if passed_s > Self::PAUSE_S {
            self.take_over();
            (self.command_age_s, self.is_renewed) = (f32::MAX, false);
        }
        let target = self.target(if passed_s > dt_s { passed_s } else { dt_s }).to_world(heading);
        let step_s = if dt_s > Self::MAX_STEP_S { Self::MAX_STEP_S } else { dt_s };
        self.reference = if self.clock.is_dead() {
            Twist::ZERO
        } else {
            self.limits.approach(self.reference, target, step_s)
        };
        let twist = self.reference.to_body(heading).discretized(step_s);
        let wheels = self.kinematics.inverse(twist);
        let mut fastest = Fastest::default();
        let _: K::Wheels<()> = K::map(wheels, |wheel| fastest.include(wheel.velocity()));
        let scale = fastest.scale(self.limits.wheel_speed());
        // A motion beyond the wheels must not wind up: the next step starts from the motion of the
        // wheels.
        self.reference = if scale > 0.0 { self.reference * scale } else { Twist::ZERO };
        self.status.saturated = scale < 1.0;
        let wheels = K::map(wheels, |wheel| slowed(wheel, scale));
        if self.is_locking() {
            self.kinematics.lock(&mut self.steering, measured)
        } else {
            self.kinematics.steer(&mut self.steering, wheels, measured)
        }
    }

    fn is_locking(&self) -> bool {
        self.command == Command::Lock && !self.status.command_stale && self.reference == Twist::ZERO
    }

    fn measure(&mut self, wheels: K::Wheels<Option<K::Speed>>, dt_s: f32) {
        let wheels = K::map(wheels, |wheel| wheel.filter(|speed| speed.is_finite()));
        let (mut lost, mut any) = (0_u8, None);
        let _: K::Wheels<()> = K::map(wheels, |wheel| {
            lost = lost.saturating_add(u8::from(wheel.is_none()));
            any = any.or(wheel);
        });
        self.status.lost_wheels = lost;
        self.status.slip_m_s = None;
        let motion = match any {
            Some(any) if lost == 0 => {
                let all = K::map(wheels, |wheel| wheel.unwrap_or(any));
                let slip_m_s = self.kinematics.slip_m_s(all);
                self.status.slip_m_s = Some(if slip_m_s.is_finite() { slip_m_s } else { f32::MAX });
                Some(self.kinematics.forward(all))
            }
            _ => self.kinematics.forward_partial(wheels),
        };
        let motion = motion.filter(|twist| twist.is_finite());
        self.status.motion_known = motion.is_some();
        self.measured = motion.unwrap_or(Twist::ZERO);
        let (before, had_gyro) = (self.odometry.heading(), self.odometry.has_gyro());
        let counted = self.odometry.advance(self.measured, self.gyro.take(), dt_s);
        if motion.is_none() || !counted {
            self.status.blind_s = (self.status.blind_s + dt_s).min(f32::MAX);
            self.unseen_rad = None;
        }
        let rolled = if counted { self.measured.wz_rad_s * dt_s } else { 0.0 };
        let jump = self.heading_jump(before, had_gyro, rolled);
        if jump != 0.0 {
            // The heading jumps; the robot does not.
            let heading = self.odometry.heading();
            let expected = Heading::new(heading.angle() + Angle::from_radians(jump));
            self.reference = self.reference.to_body(expected).to_world(heading);
        }
    }

    /// Returns by how much the wheels turned further than the heading, in rad, if the heading jumped; otherwise 0. `rolled` is the turn of
    /// the wheels since the heading `before`.
    fn heading_jump(&mut self, before: Heading, had_gyro: bool, rolled: f32) -> f32 {
        let turn = math::wrap_pi((self.odometry.heading().angle() - before.angle()).as_radians());
        let unseen = self.unseen_rad.filter(|unseen| unseen.abs() < Self::UNSEEN_RAD);
        self.unseen_rad = unseen.map(|unseen| unseen + rolled - turn);
        match (self.odometry.has_gyro(), had_gyro) {
            (true, false) => {
                self.unseen_rad = Some(0.0);
                rolled - turn
            }
            // A program may give a heading again until the next one comes.
            (true, true) if turn != 0.0 => {
                let unseen = self.unseen_rad.replace(0.0).map_or(0.0, math::wrap_pi);
                if unseen.abs() > Self::JUMP_RAD { unseen } else { 0.0 }
            }
            _ => 0.0,
        }
    }

    /// Returns the time since the update before; 0 in the first.
    fn passed_s(&mut self, now: Instant) -> f32 {
        let before = self.updated.replace(now);
        before.map_or(0.0, |before| now.since(before).as_secs_f32())
    }

    fn target(&mut self, passed_s: f32) -> Twist<Body> {
        // The step came before a new command, and after an old command.
        self.command_age_s = if self.is_renewed { 0.0 } else { self.command_age_s + passed_s };
        self.is_renewed = false;
        self.status.command_stale =
            self.clock.is_dead() || self.command_age_s > self.limits.command_timeout_s();
        match self.command {
            _ if self.status.command_stale => Twist::ZERO,
            Command::Lock => Twist::ZERO,
            Command::Body(twist) => twist,
            Command::World(twist) => twist.to_body(self.odometry.heading()),
        }
    }

    /// Returns the measured motion of the last tick; zero if unknown.
    #[must_use]
    pub const fn measured(&self) -> Twist<Body> {
        self.measured
    }

    /// Returns the motion commanded to the wheels: the command within the limits.
    #[must_use]
    pub const fn reference(&self) -> Twist<Body> {
        self.reference.to_body(self.odometry.heading())
    }

    /// Returns the pose of the chassis, relative to its start or to the last pose set.
    #[must_use]
    pub const fn pose(&self) -> Pose2<World> {
        self.odometry.pose()
    }

    /// Puts the chassis at a pose; the motion continues. The next heading of a gyroscope takes the place of the pose's angle.
    ///
    /// A pose that is NaN or infinite changes nothing, and is counted in [`ChassisStatus::rejected`].
    pub fn set_pose(&mut self, pose: Pose2<World>) {
        if !(pose.x_m.is_finite() && pose.y_m.is_finite() && pose.angle.is_finite()) {
            self.status.rejected = self.status.rejected.saturating_add(1);
            return;
        }
        let body = self.reference();
        let offset = self.odometry.gyro_offset();
        self.odometry = Odometry::new(pose);
        self.odometry.set_gyro_offset(offset);
        self.reference = body.to_world(self.odometry.heading());
    }

    /// Returns the status of the last tick.
    #[must_use]
    pub const fn status(&self) -> &ChassisStatus {
        &self.status
    }

    /// Returns the layout.
    #[must_use]
    pub const fn kinematics(&self) -> &K {
        &self.kinematics
    }

    /// Sets the angle added to each heading of the gyroscope: see [`Odometry::set_gyro_offset`]. The offset outlasts
    /// [`set_pose`](Self::set_pose). An angle that is NaN or infinite changes nothing, and is counted in
    /// [`ChassisStatus::rejected`].
    pub const fn set_gyro_offset(&mut self, offset: Angle) {
        if offset.is_finite() {
            self.odometry.set_gyro_offset(offset);
        } else {
            self.status.rejected = self.status.rejected.saturating_add(1);
        }
    }

    /// Reads the owner of the motors by `measured`, updates, and sets the targets by `command`.
    pub(super) fn drive_by<O: ?Sized, H: Copy>(
        &mut self,
        owner: &mut O,
        wheels: K::Wheels<H>,
        tick: Tick,
        measured: impl Fn(&O, H) -> Option<K::Speed>,
        command: impl Fn(&mut O, H, K::Speed) -> Result<(), TargetError>,
    ) -> K::Wheels<K::Speed> {
        let measured = K::map(wheels, |wheel| measured(owner, wheel));
        let targets = self.update(measured, tick);
        (self.status.refused, self.status.refusal) = (0, None);
        let (status, mut taken) = (&mut self.status, false);
        let _: K::Wheels<()> = K::map(K::zip(wheels, targets), |(wheel, target)| {
            match command(owner, wheel, target) {
                Ok(()) => taken = true,
                Err(error) => {
                    status.refused = status.refused.saturating_add(1);
                    status.refusal = status.refusal.or(Some(error));
                }
            }
        });
        if !taken {
            self.take_over();
        }
        targets
    }
}

/// The length of a change between two motions is limited, so its square must not overflow.
fn can_be_meant<F>(twist: Twist<F>) -> bool {
    twist.linear().dot(twist.linear()).is_finite() && twist.wz_rad_s.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chassis::{Mecanum, MecanumWheels, ModuleMotors, ModuleState, Swerve};
    use crate::geometry::Vec2;
    use crate::math::wrap_pi;
    use crate::motor::{AngleDrive, TargetError, VelocityDrive};
    use crate::time::Instant;
    use crate::units::AngularVelocity;
    use proptest::prelude::*;

    const TICK: Tick = Tick::new(Instant::START, 0.001);
    const NONE: MecanumWheels<Option<AngularVelocity>> =
        MecanumWheels { front_left: None, front_right: None, rear_left: None, rear_right: None };

    fn mecanum() -> Mecanum {
        Mecanum::new(0.1, Vec2::new(0.2, 0.2)).unwrap()
    }

    fn limited(limits: ChassisLimits) -> Chassis<Mecanum> {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_limits(limits).unwrap();
        chassis
    }

    fn facing(degrees: f32) -> Heading {
        Heading::new(Angle::from_degrees(degrees))
    }

    #[test]
    fn facing_left_a_world_command_forward_strafes_right() {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_world(Twist::new(1.0, 0.0, 0.0), facing(90.0));
        let wheels = chassis.update(NONE, TICK);
        assert!(wheels.front_left.as_rad_per_s() > 9.9 && wheels.front_right.as_rad_per_s() < -9.9);
    }

    #[test]
    fn the_acceleration_is_the_same_for_every_heading_and_keeps_the_direction() {
        let limits = ChassisLimits::new().with_acceleration(2.0, 100.0);
        for degrees in [0.0, 30.0, 45.0, 90.0, 200.0] {
            let mut chassis = limited(limits);
            for _ in 0..100 {
                chassis.set_world(Twist::new(3.0, 4.0, 0.0), facing(degrees));
                chassis.update(NONE, TICK);
            }
            let world = chassis.reference().to_world(facing(degrees)).linear();
            assert!((world.norm() - 0.2).abs() < 1e-4, "{degrees}: {world:?}");
            assert!(world.cross(Vec2::new(3.0, 4.0)).abs() < 1e-4, "{degrees}: {world:?}");
        }
    }

    #[test]
    fn yaw_is_limited_together_with_the_translation() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1000.0, 10.0));
        chassis.set_body(Twist::new(1.0, 0.0, 2.0));
        chassis.update(NONE, TICK);
        let reference = chassis.reference();
        assert!((reference.wz_rad_s - 0.01).abs() < 1e-6, "{reference:?}");
        assert!((reference.vx_m_s - 0.005).abs() < 1e-6, "{reference:?}");
    }

    #[test]
    fn a_spinning_chassis_follows_a_world_command_without_lag() {
        // Limited in the body frame, the turning command would never be reached.
        let mut chassis = limited(ChassisLimits::new().with_acceleration(2.0, 1000.0));
        let mut degrees = 0.0;
        for _ in 0..2000 {
            degrees += 0.6; // 10 rad/s
            chassis.set_world(Twist::new(1.0, 0.0, 10.0), facing(degrees));
            chassis.update(NONE, TICK);
        }
        let world = chassis.reference().to_world(facing(degrees));
        assert!((world - Twist::new(1.0, 0.0, 10.0)).linear().norm() < 1e-3, "{world:?}");
    }

    #[test]
    fn a_gyroscope_slower_than_the_loop_makes_no_lag_either() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(2.0, 1000.0));
        let spinning = mecanum().inverse(Twist::new(0.0, 0.0, 10.0)).map(Some);
        for step in 1..=2000_u16 {
            let heading = facing(f32::from(step) * 0.01_f32.to_degrees());
            if step % 5 == 0 {
                chassis.set_world(Twist::new(1.0, 0.0, 10.0), heading);
            }
            chassis.update(spinning, TICK);
        }
        let world = chassis.reference().to_world(chassis.pose().heading());
        assert!((world - Twist::new(1.0, 0.0, 10.0)).linear().norm() < 1e-3, "{world:?}");
        let turned = wrap_pi(chassis.pose().angle.as_radians() - 20.0);
        assert!(turned.abs() < 1e-3, "{turned}");
    }

    // The first seed's base limits the wheels and throws the result away.
    #[test]
    fn the_wheel_speed_limit_is_applied_and_does_not_wind_up() {
        let limit = AngularVelocity::from_rad_per_s(20.0);
        let limits = ChassisLimits::new().with_acceleration(10.0, 1000.0).with_wheel_speed(limit);
        let mut chassis = limited(limits);
        for _ in 0..1000 {
            chassis.set_body(Twist::new(6.0, 2.0, 0.0));
            for wheel in chassis.update(NONE, TICK) {
                assert!(wheel.as_rad_per_s().abs() <= 20.001);
            }
        }
        let reference = chassis.reference();
        assert!(chassis.status().saturated);
        assert!(
            (reference.vx_m_s - 1.5).abs() < 0.02 && (reference.vy_m_s - 0.5).abs() < 0.01,
            "{reference:?}"
        );
        chassis.set_body(Twist::ZERO);
        chassis.update(NONE, TICK);
        assert!(chassis.reference().vx_m_s < reference.vx_m_s);
    }

    #[test]
    fn a_command_that_is_not_renewed_brings_the_chassis_to_a_stop() {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        for _ in 0..100 {
            chassis.update(NONE, TICK);
        }
        assert!(chassis.reference().vx_m_s > 0.9 && !chassis.status().command_stale);
        chassis.update(NONE, TICK);
        chassis.update(NONE, TICK);
        assert!(chassis.status().command_stale);
        assert_eq!(chassis.reference(), Twist::ZERO);
    }

    // The step in which the command expires used to count from the next tick on.
    #[test]
    fn the_first_tick_after_a_long_stall_finds_the_command_old() {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        chassis.update(NONE, TICK);
        let stalled = Tick::new(Instant::START, 0.5);
        let mut renewed = chassis;
        chassis.update(NONE, stalled);
        assert!(chassis.status().command_stale && chassis.reference() == Twist::ZERO);
        renewed.set_body(Twist::new(1.0, 0.0, 0.0)); // after the stall
        renewed.update(NONE, stalled);
        assert!(!renewed.status().command_stale && renewed.reference().vx_m_s > 0.9);
    }

    // The length of the change overflowed: the chassis kept its motion, for every command.
    #[test]
    fn a_command_whose_square_overflows_stops_and_is_counted() {
        for speed in [-2e19, 1e25, f32::MAX] {
            let mut chassis = limited(ChassisLimits::new().with_acceleration(10.0, 10.0));
            for _ in 0..100 {
                chassis.set_body(Twist::new(1.0, 0.0, 0.0));
                chassis.update(NONE, TICK);
            }
            for _ in 0..100 {
                chassis.set_body(Twist::new(speed, 0.0, 0.0));
                chassis.update(NONE, TICK);
            }
            assert!(chassis.reference().vx_m_s.abs() < 1e-4, "{:?}", chassis.reference());
            assert_eq!(chassis.status().rejected, 100);
        }
    }

    #[test]
    fn seconds_without_position_never_overflow() {
        let mut chassis = Chassis::new(mecanum());
        for _ in 0..3 {
            chassis.update(NONE, Tick::new(Instant::START, f32::MAX));
        }
        assert!(chassis.status().blind_s.is_finite());
    }

    #[test]
    fn a_turning_chassis_with_a_slow_loop_does_not_skew() {
        let (mut chassis, dt_s, mut truth) = (Chassis::new(mecanum()), 0.02, Odometry::default());
        for _ in 0..100 {
            chassis.set_world(Twist::new(1.0, 0.0, 10.0), truth.heading());
            let wheels = chassis.update(NONE, Tick::new(Instant::START, dt_s));
            truth.advance(mecanum().forward(wheels), None, dt_s);
        }
        // Without taking the bend off: half the turn of a step to the left, 0.2 m in 2 m.
        assert!((truth.pose().x_m - 2.0).abs() < 1e-3, "{:?}", truth.pose());
        assert!(truth.pose().y_m.abs() < 1e-3, "{:?}", truth.pose());
    }

    #[test]
    fn an_offset_of_the_gyroscope_turns_the_pose_and_not_the_motion_and_outlasts_a_new_pose() {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_gyro_offset(Angle::from_degrees(90.0));
        chassis.set_gyro_offset(Angle::from_degrees(f32::NAN));
        assert_eq!(chassis.status().rejected, 1);
        chassis.set_pose(Pose2::new(1.0, 2.0, Angle::ZERO));
        // Along x of the world, while the gyroscope says 0 and the chassis faces y: to its right.
        chassis.set_world(Twist::new(1.0, 0.0, 0.0), facing(0.0));
        chassis.update(NONE, TICK);
        assert!((chassis.pose().angle.as_degrees() - 90.0).abs() < 1e-3, "{:?}", chassis.pose());
        let right = chassis.reference() - Twist::new(0.0, -1.0, 0.0);
        assert!(right.linear().norm() < 1e-5, "{:?}", chassis.reference());
    }

    #[test]
    fn a_command_of_nan_stops_and_is_counted() {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_body(Twist::new(f32::NAN, 0.0, 0.0));
        let wheels = chassis.update(NONE, TICK);
        assert_eq!(wheels, MecanumWheels::splat(AngularVelocity::ZERO));
        chassis.set_world(Twist::new(1.0, f32::INFINITY, 0.0), facing(f32::NAN));
        let wheels = chassis.update(NONE, TICK);
        assert_eq!(wheels, MecanumWheels::splat(AngularVelocity::ZERO));
        assert_eq!(chassis.status().rejected, 2);
    }

    #[test]
    fn a_lost_wheel_is_flagged_and_the_pose_continues_two_lost_wheels_hold_the_pose() {
        let mut chassis = Chassis::new(mecanum());
        let rolling = mecanum().inverse(Twist::new(1.0, 0.0, 0.0)).map(Some);
        chassis.update(MecanumWheels { rear_left: None, ..rolling }, TICK);
        let status = chassis.status();
        assert!(status.motion_known && status.lost_wheels > 0, "{status:?}");
        assert_eq!(chassis.status().lost_wheels, 1);
        assert!((chassis.pose().x_m - 0.001).abs() < 1e-7);
        let nan = Some(AngularVelocity::from_rad_per_s(f32::NAN));
        chassis.update(MecanumWheels { rear_left: None, front_left: nan, ..rolling }, TICK);
        assert!(!chassis.status().motion_known);
        assert_eq!(chassis.status().lost_wheels, 2);
        assert!((chassis.pose().x_m - 0.001).abs() < 1e-7);
        assert!((chassis.status().blind_s - 0.001).abs() < 1e-7);
    }

    #[test]
    fn the_first_heading_of_the_gyroscope_does_not_turn_the_motion() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1.0, 1.0));
        for _ in 0..500 {
            chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            chassis.update(NONE, TICK);
        }
        let before = chassis.reference();
        chassis.set_heading(facing(120.0));
        chassis.update(NONE, TICK);
        assert!((chassis.reference() - before).linear().norm() < 2e-3);
    }

    #[test]
    fn a_step_of_nan_or_zero_changes_no_pose_and_no_limited_command() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1.0, 1.0));
        let rolling = mecanum().inverse(Twist::new(1.0, 0.0, 0.0)).map(Some);
        for dt in [f32::NAN, 0.0, -1.0] {
            chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            chassis.update(rolling, Tick::new(Instant::START, dt));
        }
        assert_eq!((chassis.pose(), chassis.reference()), (Pose2::ORIGIN, Twist::ZERO));
    }

    #[test]
    fn a_step_of_no_time_moves_no_command_either_when_nothing_is_limited() {
        for dt in [f32::NAN, 0.0, -1.0, f32::INFINITY] {
            let mut chassis = Chassis::new(mecanum());
            chassis.set_body(Twist::new(2.0, 0.0, 0.0));
            let wheels = chassis.update(NONE, Tick::new(Instant::START, dt));
            assert_eq!(wheels, MecanumWheels::splat(AngularVelocity::ZERO), "{dt}");
        }
    }

    #[test]
    fn a_clock_that_died_stops_the_chassis_and_its_return_lets_it_go_on() {
        for limits in [ChassisLimits::new(), ChassisLimits::new().with_acceleration(1.0, 1.0)] {
            for dt in [f32::NAN, 0.0, -1.0, f32::INFINITY] {
                let mut chassis = limited(limits);
                chassis.set_body(Twist::new(2.0, 0.0, 0.0));
                chassis.update(NONE, TICK);
                let moving = chassis.reference();
                for ticks in 1..=200 {
                    chassis.set_body(Twist::new(2.0, 0.0, 0.0));
                    chassis.update(NONE, Tick::new(Instant::START, dt));
                    let dead = ticks >= 100;
                    assert_eq!(chassis.status().command_stale, dead, "{dt} {ticks}");
                    let expected = if dead { Twist::ZERO } else { moving };
                    assert_eq!(chassis.reference(), expected, "{dt} {ticks}");
                }
                chassis.set_body(Twist::new(2.0, 0.0, 0.0));
                chassis.update(NONE, TICK);
                assert_eq!(chassis.reference(), moving);
                assert!(chassis.status().blind_s.is_finite());
            }
        }
    }

    #[test]
    fn a_module_whose_angle_is_no_number_is_lost_and_the_others_keep_the_pose() {
        let corners = [(0.3, 0.3), (0.3, -0.3), (-0.3, 0.3), (-0.3, -0.3)];
        let swerve = Swerve::new(0.05, corners.map(|(x, y)| Vec2::new(x, y))).unwrap();
        let mut rolling = swerve.inverse(Twist::new(1.0, 0.0, 0.0)).map(Some);
        for angle in [f32::NAN, f32::INFINITY] {
            rolling[0] = rolling[0]
                .map(|module| ModuleState { angle: Angle::from_radians(angle), ..module });
            let mut chassis = Chassis::new(swerve);
            chassis.update(rolling, TICK);
            let status = chassis.status();
            assert_eq!((status.motion_known, status.lost_wheels), (true, 1));
            assert!((chassis.pose().x_m - 0.001).abs() < 1e-6, "{:?}", chassis.pose());
        }
    }

    #[test]
    fn wheels_beyond_all_numbers_leave_a_finite_slip() {
        for speed in [1e38, f32::MAX] {
            let mut chassis = Chassis::new(mecanum());
            let mut wheels = MecanumWheels::splat(Some(AngularVelocity::from_rad_per_s(speed)));
            wheels.rear_left = wheels.rear_left.map(|wheel| wheel * -1.0);
            chassis.update(wheels, TICK);
            let status = chassis.status();
            assert!(
                status.slip_m_s.is_some_and(|slip| slip > 1e6 && slip.is_finite()),
                "{status:?}"
            );
        }
    }

    #[test]
    fn a_heading_of_nan_is_counted_and_a_world_command_with_it_stops() {
        let mut chassis = Chassis::new(mecanum());
        chassis.set_world(Twist::new(1.0, 0.0, 0.0), facing(f32::NAN));
        chassis.update(NONE, TICK);
        assert_eq!((chassis.reference(), chassis.status().rejected), (Twist::ZERO, 1));
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        chassis.set_heading(facing(f32::INFINITY));
        chassis.update(NONE, TICK);
        assert_eq!(chassis.status().rejected, 2);
        assert_eq!(chassis.reference(), Twist::new(1.0, 0.0, 0.0)); // a body command needs no heading
    }

    #[test]
    fn putting_the_chassis_at_another_pose_does_not_turn_its_motion() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1.0, 1.0));
        for _ in 0..500 {
            chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            chassis.update(NONE, TICK);
        }
        let before = chassis.reference();
        chassis.set_pose(Pose2::new(3.0, -1.0, Angle::from_degrees(120.0)));
        let error = chassis.reference() - before;
        assert!(error.linear().norm() < 1e-6, "{error:?}");
        assert!((chassis.pose().angle.as_degrees() - 120.0).abs() < 1e-3);
    }

    #[test]
    fn a_command_of_before_a_pause_does_not_drive_and_the_next_one_does() {
        let at_ms = |ms: u64| Tick::new(Instant::from_micros(1_000 * ms), 0.001);
        let mut chassis = Chassis::new(mecanum());
        let mut drive = |is_renewed, ms| {
            if is_renewed {
                chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            }
            chassis.update(NONE, at_ms(ms));
            (chassis.reference().vx_m_s, chassis.status().command_stale)
        };
        assert_eq!(drive(true, 5_000), (1.0, false));
        // A program that drives while armed alone: these are the next updates.
        assert_eq!(drive(false, 11_000), (0.0, true));
        assert_eq!(drive(true, 17_000), (0.0, true), "of any time of the pause");
        assert_eq!(drive(true, 17_001), (1.0, false));
        assert_eq!(drive(false, 17_100), (1.0, false), "a pause of 0.1 s");
        assert_eq!(drive(true, 3), (1.0, false), "the clock went back");
        for ms in [403, 803, 1_203] {
            chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            chassis.update(NONE, Tick::new(Instant::from_micros(1_000 * ms), 0.4));
            assert!(!chassis.status().command_stale, "steps of a slow program");
        }
        for turn in 1..99 {
            chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            let now = Instant::from_micros(1_203_000 + 125_000 * turn);
            chassis.update(NONE, Tick::new(now, 0.02));
            assert!(!chassis.status().command_stale, "a program that limits its steps");
        }
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        chassis.update(NONE, Tick::new(Instant::from_micros(20_000_000), 6.4));
        assert_eq!((chassis.reference(), chassis.status().command_stale), (Twist::ZERO, true));
    }

    #[test]
    fn a_chassis_that_was_not_updated_for_a_while_starts_from_its_wheels() {
        let limits = ChassisLimits::new().with_acceleration(2.0, 10.0);
        let rolling = mecanum().inverse(Twist::new(0.3, 0.0, 0.0)).map(Some);
        for (restarts, wheels, vx_m_s) in
            [(false, NONE, 0.0), (true, NONE, 0.0), (false, rolling, 0.298)]
        {
            let mut chassis = limited(limits);
            for ms in 0..2_000 {
                chassis.set_body(Twist::new(1.0, 0.0, 0.0));
                let wheels = mecanum().inverse(chassis.reference()).map(Some);
                chassis.update(wheels, Tick::new(Instant::from_micros(1_000 * ms), 0.001));
            }
            assert!((chassis.reference().vx_m_s - 1.0).abs() < 1e-3);
            if restarts {
                chassis.restart();
            }
            // Disarmed, and stopped by hand.
            chassis.stop();
            chassis.update(wheels, Tick::new(Instant::from_micros(12_000_000), 0.001));
            let motion = chassis.reference();
            assert!((motion.vx_m_s - vx_m_s).abs() < 1e-4, "{motion:?}");
        }
    }

    #[test]
    fn a_heading_that_jumps_turns_the_pose_and_not_the_wheels() {
        let limits = ChassisLimits::new().with_acceleration(3.0, 30.0);
        // An IMU that starts again, and one that is wrong once.
        for (first, from, then) in [(120.0, 1_001, 0.0), (0.0, 1_000, 180.0), (0.0, 1_000, -12.0)] {
            let (mut chassis, mut last) = (limited(limits), Twist::ZERO);
            let mut wheels = MecanumWheels::splat(Some(AngularVelocity::ZERO));
            for ms in 0..2_000 {
                let jumps = if from == 1_001 { ms >= from } else { ms == from };
                chassis.set_heading(facing(if jumps { then } else { first }));
                chassis.set_body(Twist::new(1.5, 0.0, 0.0));
                wheels = chassis.update(wheels, TICK).map(Some);
                let step = (chassis.reference() - last).linear().norm();
                assert!(step <= 0.003_01, "{step} m/s in tick {ms} from {first} to {then}");
                last = chassis.reference();
            }
            assert!((last.vx_m_s - 1.5).abs() < 1e-3, "{last:?}");
        }
    }

    #[test]
    fn a_chassis_that_spins_keeps_its_way_with_headings_of_any_rate() {
        let limits = ChassisLimits::new().with_acceleration(3.0, 30.0);
        for (wz, period_ms, lost) in [
            (15.0, 20, 0),
            (11.0, 20, 0),
            (15.0, 10, 7),
            (15.0, 5, 0),
            (15.0, 1, 0),
            (-12.0, 50, 0),
        ] {
            for repeats in [true, false] {
                let mut chassis = limited(limits);
                let (mut truth, mut given) = (0.0_f32, 0.0_f32);
                let mut wheels = MecanumWheels::splat(Some(AngularVelocity::ZERO));
                for ms in 0..3_000 {
                    truth = wrap_pi(truth + 0.001 * chassis.reference().wz_rad_s);
                    let is_heard = ms % period_ms == 0 && (lost == 0 || ms / period_ms % lost != 0);
                    given = if is_heard { truth } else { given };
                    let heading = Heading::new(Angle::from_radians(given));
                    let twist = Twist::new(1.0, 0.0, wz);
                    if repeats {
                        chassis.set_world(twist, heading);
                    } else {
                        if is_heard {
                            chassis.set_heading(heading);
                        }
                        chassis.set_body(twist.to_body(facing(chassis.pose().angle.as_degrees())));
                    }
                    wheels = chassis.update(wheels, TICK).map(Some);
                    let way =
                        chassis.reference().to_world(facing(chassis.pose().angle.as_degrees()));
                    let ahead = if ms < 500 { 1.0 } else { way.vx_m_s };
                    assert!(ahead > 0.9, "{wz} rad/s, each {period_ms} ms, tick {ms}: {way:?}");
                }
            }
        }
    }

    #[test]
    fn a_chassis_that_is_turned_against_its_wheels_keeps_its_motion_in_the_world() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1.0, 1.0));
        let rolls = mecanum().inverse(Twist::new(1.0, 0.0, 0.0)).map(Some);
        for ms in 0..3_000_u16 {
            // Hit after 2 s: 10 rad/s for 0.1 s, which no wheel shows.
            let turned = 0.01 * f32::from(ms.saturating_sub(2_000).min(100));
            chassis.set_heading(Heading::new(Angle::from_radians(turned)));
            chassis.set_world(Twist::new(1.0, 0.0, 0.0), Heading::new(Angle::from_radians(turned)));
            chassis.update(rolls, TICK);
        }
        let body = chassis.reference();
        assert!((body.vx_m_s - 1.0_f32.cos()).abs() < 1e-3, "{body:?}");
        assert!((body.vy_m_s + 1.0_f32.sin()).abs() < 1e-3, "{body:?}");
    }

    #[test]
    fn a_pose_of_nan_is_counted_and_changes_nothing() {
        let mut chassis = Chassis::new(mecanum());
        let pose = Pose2::new(1.0, 2.0, Angle::from_degrees(30.0));
        chassis.set_pose(pose);
        chassis.set_pose(Pose2::new(f32::NAN, 0.0, Angle::ZERO));
        chassis.set_pose(Pose2::new(0.0, f32::INFINITY, Angle::ZERO));
        chassis.set_pose(Pose2::new(0.0, 0.0, Angle::from_radians(f32::NAN)));
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        chassis.update(NONE, TICK);
        assert_eq!((chassis.pose(), chassis.status().rejected), (pose, 3));
        assert!(chassis.reference().vx_m_s > 0.9);
    }

    struct Bench {
        speeds: [AngularVelocity; 4],
        broken: usize,
    }

    impl VelocityDrive<usize> for Bench {
        fn velocity(&self, motor: usize) -> Option<AngularVelocity> {
            (motor != self.broken).then(|| self.speeds[motor])
        }

        fn set_velocity(
            &mut self,
            motor: usize,
            target: AngularVelocity,
        ) -> Result<(), TargetError> {
            if motor == self.broken {
                return Err(TargetError::NoFeedback);
            }
            self.speeds[motor] = target;
            Ok(())
        }
    }

    #[test]
    fn driving_motors_closes_the_circle_and_reports_the_broken_one() {
        let mut bench = Bench { speeds: [AngularVelocity::ZERO; 4], broken: 3 };
        let wheels = MecanumWheels::from_array([0, 1, 2, 3]);
        let mut chassis = Chassis::new(mecanum());
        for _ in 0..1001 {
            chassis.set_body(Twist::new(0.5, 0.0, 0.0));
            chassis.drive(&mut bench, wheels, TICK);
        }
        assert!((chassis.pose().x_m - 0.5).abs() < 1e-4, "{:?}", chassis.pose());
        assert_eq!(chassis.status().refused, 1);
        assert_eq!(chassis.status().refusal, Some(TargetError::NoFeedback));
    }

    #[test]
    fn a_lost_wheel_leaves_the_slip_unknown_and_not_zero() {
        let mut chassis = Chassis::new(mecanum());
        assert_eq!(chassis.status().slip_m_s, None);
        let mut wheels = mecanum().inverse(Twist::new(1.0, 0.0, 0.0)).map(Some);
        chassis.update(wheels, TICK);
        assert!(chassis.status().slip_m_s.is_some_and(|slip| slip < 1e-5));
        wheels.front_left = Some(AngularVelocity::ZERO); // blocked
        chassis.update(wheels, TICK);
        assert!(chassis.status().slip_m_s.is_some_and(|slip| (slip - 0.25).abs() < 1e-5));
        wheels.rear_right = None;
        chassis.update(wheels, TICK);
        assert_eq!(chassis.status().slip_m_s, None);
    }

    #[test]
    fn wheels_that_do_not_steer_lock_by_standing() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1.0, 1.0));
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        chassis.update(NONE, TICK);
        chassis.lock();
        assert_eq!(chassis.update(NONE, TICK), MecanumWheels::splat(AngularVelocity::ZERO));
        assert_eq!(size_of::<Chassis<Mecanum>>(), 192); // steering costs them nothing
    }

    const CORNERS: [Vec2; 4] =
        [Vec2::new(0.3, 0.3), Vec2::new(0.3, -0.3), Vec2::new(-0.3, 0.3), Vec2::new(-0.3, -0.3)];
    /// The encoders of the modules at the forward direction.
    const ZERO: Angle = Angle::from_degrees(200.0);

    fn swerve() -> Swerve<4> {
        Swerve::new(0.05, CORNERS).unwrap()
    }

    /// Steering motors at their commanded angles, with one that may be broken.
    struct Turned {
        angles: [Angle; 4],
        broken: usize,
    }

    impl AngleDrive<usize> for Turned {
        fn angle(&self, motor: usize) -> Option<Angle> {
            (motor != self.broken).then(|| self.angles[motor])
        }

        fn set_angle(&mut self, motor: usize, target: Angle) -> Result<(), TargetError> {
            if motor == self.broken {
                return Err(TargetError::Relaxed);
            }
            self.angles[motor] = target;
            Ok(())
        }
    }

    struct Motors {
        drives: Bench,
        steerings: Turned,
    }

    impl VelocityDrive<usize> for Motors {
        fn velocity(&self, motor: usize) -> Option<AngularVelocity> {
            self.drives.velocity(motor)
        }

        fn set_velocity(
            &mut self,
            motor: usize,
            target: AngularVelocity,
        ) -> Result<(), TargetError> {
            self.drives.set_velocity(motor, target)
        }
    }

    impl AngleDrive<usize> for Motors {
        fn angle(&self, motor: usize) -> Option<Angle> {
            self.steerings.angle(motor)
        }

        fn set_angle(&mut self, motor: usize, target: Angle) -> Result<(), TargetError> {
            self.steerings.set_angle(motor, target)
        }
    }

    struct Modules {
        motors: Motors,
        chassis: Chassis<Swerve<4>>,
    }

    impl Modules {
        const NONE: usize = 9;

        fn new() -> Self {
            let drives = Bench { speeds: [AngularVelocity::ZERO; 4], broken: Self::NONE };
            let steerings = Turned { angles: [ZERO; 4], broken: Self::NONE };
            Self { motors: Motors { drives, steerings }, chassis: Chassis::new(swerve()) }
        }

        fn drive(&mut self) {
            let modules = [0, 1, 2, 3].map(|motor| ModuleMotors::new(motor, motor, ZERO));
            self.chassis.drive(&mut self.motors, modules, TICK);
        }

        fn go(&mut self, vx: f32, vy: f32) {
            self.chassis.set_body(Twist::new(vx, vy, 0.0));
            self.drive();
        }

        fn degrees(&self) -> [f32; 4] {
            self.motors.steerings.angles.map(|angle| (angle - ZERO).as_degrees())
        }

        fn assert_degrees(&self, expected: [f32; 4]) {
            let degrees = self.degrees();
            for (is, should) in degrees.into_iter().zip(expected) {
                assert!((is - should).abs() < 0.3, "{degrees:?} and not {expected:?}");
            }
        }
    }

    // The fifth seed's system and librm turn their modules to 0 at zero command; so did this chassis.
    #[test]
    fn a_swerve_chassis_told_to_stand_keeps_its_angles() {
        let mut modules = Modules::new();
        modules.go(0.5, 0.5);
        modules.assert_degrees([45.0; 4]);
        for _ in 0..300 {
            modules.drive(); // the command grows old
        }
        modules.chassis.stop();
        modules.drive();
        modules.assert_degrees([45.0; 4]);
        assert_eq!(modules.motors.drives.speeds, [AngularVelocity::ZERO; 4]);
        assert!((modules.chassis.pose().x_m - 0.0505).abs() < 2e-3, "{:?}", modules.chassis.pose());
    }

    #[test]
    fn a_swerve_chassis_before_its_first_command_turns_no_module() {
        let mut modules = Modules::new();
        modules.motors.steerings.angles = [10.0, 250.0, 98.0, 333.0].map(Angle::from_degrees);
        let before = modules.degrees();
        modules.drive();
        modules.assert_degrees(before);
    }

    #[test]
    fn the_lock_waits_for_standstill_and_crosses_the_modules_until_the_next_command() {
        let mut modules = Modules::new();
        let limits = ChassisLimits::new().with_acceleration(10.0, 10.0);
        modules.chassis.set_limits(limits).unwrap();
        for _ in 0..100 {
            modules.go(1.0, 0.0);
        }
        modules.assert_degrees([0.0; 4]);
        for _ in 0..90 {
            modules.chassis.lock();
            modules.drive();
        }
        modules.assert_degrees([0.0; 4]); // still rolling
        let x = [45.0, -45.0, -45.0, 45.0];
        for _ in 0..20 {
            modules.chassis.lock();
            modules.drive();
        }
        modules.assert_degrees(x);
        assert_eq!(modules.motors.drives.speeds, [AngularVelocity::ZERO; 4]);
        for _ in 0..200 {
            modules.drive();
        }
        assert!(modules.chassis.status().command_stale);
        modules.assert_degrees(x);
        modules.go(1.0, 0.0);
        modules.assert_degrees([0.0; 4]);
    }

    #[test]
    fn a_module_off_its_angle_does_not_drive_and_the_others_do() {
        let mut modules = Modules::new();
        modules.motors.steerings.broken = 2;
        modules.go(1.0, 0.0);
        assert_eq!(
            modules.motors.drives.speeds.map(|speed| speed > AngularVelocity::ZERO),
            [true, true, false, true]
        );
        let status = modules.chassis.status();
        assert_eq!((status.refused, status.refusal), (1, Some(TargetError::Relaxed)));
        assert_eq!((status.lost_wheels, status.motion_known), (1, true));
    }

    #[test]
    fn a_module_whose_drive_is_silent_still_steers() {
        let mut modules = Modules::new();
        modules.motors.drives.broken = 1;
        modules.go(0.0, 1.0);
        modules.assert_degrees([90.0; 4]);
        assert_eq!(
            (modules.chassis.status().lost_wheels, modules.chassis.status().refused),
            (1, 1)
        );
    }

    #[test]
    fn modules_turned_by_hand_while_relaxed_keep_their_angles() {
        let by_hand = [20.0, 30.0, 40.0, 50.0];
        let turned = by_hand.map(|degrees| Angle::from_degrees(degrees) + ZERO);
        let mut modules = Modules::new();
        modules.go(1.0, 0.0);
        modules.chassis.restart();
        modules.motors.steerings.angles = turned;
        modules.drive();
        modules.assert_degrees(by_hand);

        // Nobody says `restart`, but all motors refuse for a while.
        let mut modules = Modules::new();
        modules.go(1.0, 0.0);
        let mut refusing = Refusing;
        let four = [0, 1, 2, 3].map(|motor| ModuleMotors::new(motor, motor, ZERO));
        modules.chassis.drive(&mut refusing, four, TICK);
        modules.chassis.stop();
        modules.motors.steerings.angles = turned;
        modules.drive();
        modules.assert_degrees(by_hand);
    }

    // The stick is held forward while nothing is armed: the chassis used to leap at full speed
    // after arming.
    #[test]
    fn a_chassis_that_was_refused_starts_from_the_measured_motion() {
        let mut chassis = limited(ChassisLimits::new().with_acceleration(1.0, 1.0));
        let wheels = MecanumWheels::from_array([0, 1, 2, 3]);
        for _ in 0..2000 {
            chassis.set_body(Twist::new(1.0, 0.0, 0.0));
            chassis.drive(&mut Refusing, wheels, TICK);
        }
        let mut bench = Bench { speeds: [AngularVelocity::ZERO; 4], broken: 9 };
        chassis.set_body(Twist::new(1.0, 0.0, 0.0));
        chassis.drive(&mut bench, wheels, TICK);
        assert!((chassis.reference().vx_m_s - 0.001).abs() < 1e-6, "{:?}", chassis.reference());
    }

    /// Motors with feedback and not armed.
    struct Refusing;

    impl VelocityDrive<usize> for Refusing {
        fn velocity(&self, _: usize) -> Option<AngularVelocity> {
            Some(AngularVelocity::ZERO)
        }

        fn set_velocity(&mut self, _: usize, _: AngularVelocity) -> Result<(), TargetError> {
            Err(TargetError::Disarmed)
        }
    }

    impl AngleDrive<usize> for Refusing {
        fn angle(&self, _: usize) -> Option<Angle> {
            Some(ZERO)
        }

        fn set_angle(&mut self, _: usize, _: Angle) -> Result<(), TargetError> {
            Err(TargetError::Disarmed)
        }
    }

    proptest! {
        #[test]
        fn no_step_exceeds_the_acceleration(
            vx in -5.0_f32..5.0, vy in -5.0_f32..5.0, wz in -20.0_f32..20.0, degrees in -720.0_f32..720.0
        ) {
            let mut chassis = limited(ChassisLimits::new().with_acceleration(3.0, 30.0));
            let mut last = Twist::<World>::ZERO;
            for step in 0..50 {
                let side = if step % 20 < 10 { 1.0 } else { -1.0 };
                let heading = facing(degrees + step as f32);
                chassis.set_world(Twist::new(vx, vy, wz) * side, heading);
                chassis.update(NONE, TICK);
                let now = chassis.reference().to_world(heading);
                prop_assert!((now - last).linear().norm() <= 3.001e-3 + 2e-6);
                prop_assert!((now - last).wz_rad_s.abs() <= 30.001e-3 + 2e-6);
                last = now;
            }
        }
    }
}
