use super::DeadClock;
use crate::control::{Pid, PidConfig};
use crate::error::ConfigError;
use crate::geometry::{Body, Gimbal, Heading, Twist};
use crate::math::{sin_cos, wrap_tau};
use crate::time::TimeStep;
use crate::units::Angle;
use core::f32::consts::TAU;

/// How the chassis moves under a gimbal.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ChassisMode {
    /// No motion is wanted: the motors should be relaxed.
    #[default]
    Relax,
    /// The command is in the frame of the gimbal, and the chassis turns into the direction of the gimbal.
    FollowGimbal,
    /// The command is in the frame of the gimbal, and the chassis spins under the gimbal.
    Rotor,
    /// The command is in the frame of the chassis, its turn included.
    Independent,
}

/// Configuration of the modes.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{ChassisMode, ModeConfig, Modes}, control::PidConfig, geometry::Twist, units::Angle};
///
/// let config = ModeConfig::new(PidConfig::new(6.0, 0.0, 0.1).with_output_limit(8.0))
///     .with_rotor(6.0, 2.0, 3.0)
///     .with_clockwise_rotor()
///     .with_transition(0.0);
/// let mut modes = Modes::new(config)?;
/// modes.set_mode(ChassisMode::Rotor);
/// let body = modes.update(Twist::ZERO, Some(Angle::ZERO), 0.001).ok_or("driving")?;
/// assert_eq!(body.wz_rad_s, -6.0); // the swing begins at its base
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ModeConfig {
    follow: PidConfig,
    rotor_rad_s: f32,
    swing_rad_s: f32,
    swing_frequency_rad_s: f32,
    clockwise: bool,
    alternating: bool,
    gimbal_timeout_s: f32,
    relaxes_without_gimbal: bool,
    transition_s: f32,
}

impl ModeConfig {
    /// Takes the loop that turns the chassis after the gimbal: from rad to rad/s. The period of the circle is set here.
    ///
    /// The rotor spins at 6 rad/s; the gimbal's yaw may be missing for 0.03 s; a change takes 0.2 s.
    #[must_use]
    pub const fn new(follow: PidConfig) -> Self {
        Self {
            follow,
            rotor_rad_s: 6.0,
            swing_rad_s: 0.0,
            swing_frequency_rad_s: 0.0,
            clockwise: false,
            alternating: false,
            gimbal_timeout_s: 0.03,
            relaxes_without_gimbal: false,
            transition_s: 0.2,
        }
    }

    /// Sets the speed of the rotor: `base + swing * sin(frequency * t)`, in rad/s each.
    ///
    /// All finite and zero or more, the swing not above the base: the direction never changes on the way.
    #[must_use]
    pub const fn with_rotor(self, base: f32, swing: f32, frequency: f32) -> Self {
        Self { rotor_rad_s: base, swing_rad_s: swing, swing_frequency_rad_s: frequency, ..self }
    }

    /// Spins the rotor clockwise; counter-clockwise otherwise. A direction once taken is kept until the mode is left.
    #[must_use]
    pub const fn with_clockwise_rotor(self) -> Self {
        Self { clockwise: true, ..self }
    }

    /// Spins the rotor the other way each time the mode is entered; the configured way first.
    #[must_use]
    pub const fn with_alternating_rotor(self) -> Self {
        Self { alternating: true, ..self }
    }

    /// Sets for how many seconds the last yaw of the gimbal is used, zero or more. Then the chassis drives as in
    /// [`ChassisMode::Independent`].
    #[must_use]
    pub const fn with_gimbal_timeout(self, timeout_s: f32) -> Self {
        Self { gimbal_timeout_s: timeout_s, ..self }
    }

    /// Relaxes while a mode lacks the gimbal's yaw, instead of driving as in [`ChassisMode::Independent`].
    #[must_use]
    pub const fn with_relax_without_gimbal(self) -> Self {
        Self { relaxes_without_gimbal: true, ..self }
    }

    /// Sets the time in seconds of the transition from one mode to the next, zero or more.
    #[must_use]
    pub const fn with_transition(self, transition_s: f32) -> Self {
        Self { transition_s, ..self }
    }
}

/// Turns the driver's command into a motion of the body, by mode.
///
/// The yaw is the angle of the gimbal relative to the chassis, counter-clockwise positive, any number of turns. A
/// change of mode resets the loop and moves evenly to the new motion in 0.2 s, without a jump. If the yaw is missing
/// for longer than the timeout, or from the start, modes that need the yaw are replaced as configured;
/// [`take_edge`](Self::take_edge) reports the replacement.
///
/// # Examples
/// ```
/// use drivetrain::{chassis::{ChassisMode, ModeConfig, Modes}, control::PidConfig, geometry::Twist, units::Angle};
///
/// let mut modes = Modes::new(ModeConfig::new(PidConfig::new(5.0, 0.0, 0.0)).with_transition(0.0))?;
/// modes.set_mode(ChassisMode::FollowGimbal);
/// let yaw = Some(Angle::from_radians(0.2)); // the gimbal looks to the left
/// let body = modes.update(Twist::new(1.0, 0.0, 0.0), yaw, 0.001).ok_or("driving")?;
/// assert!((body.wz_rad_s - 1.0).abs() < 1e-5); // so the chassis turns left
/// assert!((body.vy_m_s - 0.2_f32.sin()).abs() < 1e-6); // and goes where the gimbal looks
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modes {
    config: ModeConfig,
    follow: Pid,
    mode: ChassisMode,
    acting: ChassisMode,
    yaw: Option<Heading>,
    yaw_age_s: f32,
    clock: DeadClock,
    gimbal_lost: bool,
    edges: [Option<ChassisMode>; 2],
    clockwise: bool,
    entered_rotor: bool,
    swing_rad: f32,
    output: Twist<Body>,
    from: Twist<Body>,
    progress: f32,
}

impl Modes {
    /// Takes the configuration; the mode is [`ChassisMode::Relax`].
    ///
    /// # Errors
    /// Names the invalid value.
    pub fn new(config: ModeConfig) -> Result<Self, ConfigError> {
        let named = [
            (config.rotor_rad_s, "the rotor's base"),
            (config.swing_rad_s, "the rotor's swing"),
            (config.swing_frequency_rad_s, "the rotor's frequency"),
            (config.gimbal_timeout_s, "the gimbal's timeout"),
            (config.transition_s, "the transition"),
        ];
        for (value, name) in named {
            if !value.is_finite() || value < 0.0 {
                return Err(ConfigError::Negative(name));
            }
        }
        let (swing, base) = (config.swing_rad_s, config.rotor_rad_s);
        ConfigError::check_range("rotor's swing around its base in rad/s", swing, 0.0, base)?;
        Ok(Self {
            config,
            follow: Pid::new(config.follow.with_period(TAU))
                .map_err(|error| ConfigError::Loop("the follow loop", error.parameter()))?,
            mode: ChassisMode::Relax,
            acting: ChassisMode::Relax,
            yaw: None,
            yaw_age_s: f32::MAX,
            clock: DeadClock::new(),
            gimbal_lost: false,
            edges: [None; 2],
            clockwise: false,
            entered_rotor: false,
            swing_rad: 0.0,
            output: Twist::ZERO,
            from: Twist::ZERO,
            progress: 1.0,
        })
    }

    /// Sets the mode. The present mode again changes nothing.
    pub fn set_mode(&mut self, mode: ChassisMode) {
        if mode == self.mode {
            return;
        }
        self.mode = mode;
        if mode == ChassisMode::Rotor {
            self.clockwise = if self.config.alternating && self.entered_rotor {
                !self.clockwise
            } else {
                self.config.clockwise
            };
            self.entered_rotor = true;
            self.swing_rad = 0.0;
        }
    }

    /// Returns the chosen mode.
    #[must_use]
    pub const fn mode(&self) -> ChassisMode {
        self.mode
    }

    /// Returns the acting mode: the replacement while the gimbal's yaw is missing.
    #[must_use]
    pub const fn acting(&self) -> ChassisMode {
        self.acting
    }

    /// Returns the mode that took over because the gimbal's yaw was lost or is back; the oldest change first.
    ///
    /// A lost yaw gives the replacement, [`ChassisMode::Independent`] or [`ChassisMode::Relax`]; a yaw that is back gives the chosen mode.
    /// Each change is returned once. Call this until `None`.
    pub const fn take_edge(&mut self) -> Option<ChassisMode> {
        let [first, second] = self.edges;
        self.edges = [second, None];
        first
    }

    /// Returns the motion of the command in this mode; `None` when the motors should be relaxed.
    ///
    /// A `gimbal_yaw` that is not finite counts as missing. A command that is NaN or infinite, or so large that its
    /// motion overflows, counts as standing still. A `dt_s` that is zero, negative, NaN or infinite counts as zero. From
    /// the 100th such call in a row on the clock is dead: the motion is zero, and a missing yaw counts as lost. When time
    /// is back the motion starts from rest.
    ///
    /// Costs 322 instructions on a Cortex-M4F, to follow the gimbal (`docs/figures.md`).
    pub fn update(
        &mut self,
        command: Twist<Gimbal>,
        gimbal_yaw: Option<Angle>,
        dt_s: f32,
    ) -> Option<Twist<Body>> {
        let command = if command.is_finite() { command } else { Twist::ZERO };
        let dt_s = self.clock.take_step(dt_s);
        self.take_yaw(gimbal_yaw, dt_s);
        let allowed = self.allowed();
        self.act(allowed);
        let wanted = match (self.acting, self.yaw) {
            (ChassisMode::Relax, _) => {
                self.output = Twist::ZERO;
                self.progress = 1.0;
                return None;
            }
            (ChassisMode::FollowGimbal, Some(yaw)) => {
                // The chassis stands at minus the yaw on the gimbal's circle, and shall stand at zero.
                let step = TimeStep::of(dt_s);
                let wz_rad_s = self.follow.step(0.0, -yaw.angle().as_radians(), &step);
                command.to_body_by_yaw(yaw).with_wz(wz_rad_s)
            }
            (ChassisMode::Rotor, Some(yaw)) => command.to_body_by_yaw(yaw).with_wz(self.spin(dt_s)),
            _ => Twist::new(command.vx_m_s, command.vy_m_s, command.wz_rad_s),
        };
        if self.clock.is_dead() {
            (self.from, self.output, self.progress) = (Twist::ZERO, Twist::ZERO, 0.0);
            return Some(Twist::ZERO);
        }
        let output = self.blend(wanted, dt_s);
        self.output = if output.is_finite() { output } else { Twist::ZERO };
        Some(self.output)
    }

    fn take_yaw(&mut self, yaw: Option<Angle>, dt_s: f32) {
        match yaw.filter(|angle| angle.is_finite()) {
            Some(angle) => {
                self.yaw = Some(Heading::new(angle));
                self.yaw_age_s = 0.0;
            }
            None if self.clock.is_dead() => self.yaw_age_s = f32::MAX,
            None => self.yaw_age_s += dt_s,
        }
    }

    /// The chosen mode, or its replacement.
    fn allowed(&mut self) -> ChassisMode {
        if !matches!(self.mode, ChassisMode::FollowGimbal | ChassisMode::Rotor) {
            self.gimbal_lost = false;
            return self.mode;
        }
        let lost = self.yaw.is_none() || self.yaw_age_s > self.config.gimbal_timeout_s;
        let allowed = match (lost, self.config.relaxes_without_gimbal) {
            (false, _) => self.mode,
            (true, false) => ChassisMode::Independent,
            (true, true) => ChassisMode::Relax,
        };
        if lost != self.gimbal_lost {
            self.gimbal_lost = lost;
            let last = match self.edges {
                [None, _] => 0,
                _ => 1,
            };
            if let Some(slot) = self.edges.get_mut(last) {
                *slot = Some(allowed);
            }
        }
        allowed
    }

    fn act(&mut self, mode: ChassisMode) {
        if mode != self.acting {
            self.acting = mode;
            self.follow.reset();
            self.from = self.output;
            self.progress = 0.0;
        }
    }

    fn spin(&mut self, dt_s: f32) -> f32 {
        let config = &self.config;
        let speed = config.rotor_rad_s + config.swing_rad_s * sin_cos(self.swing_rad).0;
        let phase = wrap_tau(self.swing_rad + config.swing_frequency_rad_s * dt_s);
        // After an overflowing step the swing begins again: NaN would stay.
        self.swing_rad = if phase.is_finite() { phase } else { 0.0 };
        if self.clockwise { -speed } else { speed }
    }

    fn blend(&mut self, wanted: Twist<Body>, dt_s: f32) -> Twist<Body> {
        let transition_s = self.config.transition_s;
        self.progress += if transition_s > 0.0 { dt_s / transition_s } else { 1.0 };
        if self.progress < 1.0 {
            self.from + (wanted - self.from) * self.progress
        } else {
            self.progress = 1.0;
            wanted
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::wrap_pi;
    use core::f32::consts::FRAC_PI_2;
    use std::vec::Vec;

    const DT: f32 = 0.001;
    const AHEAD: Twist<Gimbal> = Twist::new(1.0, 0.0, 0.5);

    fn config() -> ModeConfig {
        ModeConfig::new(PidConfig::new(5.0, 0.0, 0.0)).with_rotor(6.0, 2.0, 3.0)
    }

    fn modes(config: ModeConfig, mode: ChassisMode) -> Modes {
        let mut modes = Modes::new(config).unwrap();
        modes.set_mode(mode);
        modes
    }

    fn yaw(degrees: f32) -> Option<Angle> {
        Some(Angle::from_degrees(degrees))
    }

    fn settled(modes: &mut Modes, degrees: f32) -> Twist<Body> {
        for _ in 0..300 {
            let _ = modes.update(AHEAD, yaw(degrees), DT);
        }
        modes.output
    }

    #[test]
    fn gimbal_to_the_left_turns_the_chassis_left_and_right_right() {
        let mut follow = modes(config(), ChassisMode::FollowGimbal);
        assert!((settled(&mut follow, 90.0).wz_rad_s - 5.0 * FRAC_PI_2).abs() < 1e-4);
        assert!((settled(&mut follow, -90.0).wz_rad_s + 5.0 * FRAC_PI_2).abs() < 1e-4);
    }

    #[test]
    fn follow_takes_the_shorter_way_over_the_seam_for_any_number_of_turns() {
        let mut follow = modes(config(), ChassisMode::FollowGimbal);
        assert!(settled(&mut follow, 350.0).wz_rad_s < 0.0); // 10 degrees to the right
        assert!(settled(&mut follow, 190.0).wz_rad_s < 0.0);
        assert!(settled(&mut follow, -350.0).wz_rad_s > 0.0);
        assert!(settled(&mut follow, 3610.0).wz_rad_s > 0.0);
    }

    #[test]
    fn follow_closes_the_loop_from_any_side() {
        for start in [170.0_f32, -170.0, 90.0, 10.0, 1000.0] {
            let mut follow = modes(config(), ChassisMode::FollowGimbal);
            let mut chassis_rad = -start.to_radians(); // the gimbal stands at zero
            for _ in 0..3000 {
                let twist = follow.update(Twist::ZERO, Some(Angle::from_radians(-chassis_rad)), DT);
                chassis_rad += twist.unwrap().wz_rad_s * DT;
            }
            assert!(wrap_pi(chassis_rad).abs() < 1e-3, "{start}: {chassis_rad}");
        }
    }

    #[test]
    fn the_rotor_swings_about_its_base_and_goes_where_the_gimbal_looks() {
        let mut rotor = modes(config().with_transition(0.0), ChassisMode::Rotor);
        let speeds: Vec<f32> =
            (0..2100).map(|_| rotor.update(AHEAD, yaw(90.0), DT).unwrap().wz_rad_s).collect();
        let highest = speeds.iter().copied().fold(0.0, f32::max);
        let lowest = speeds.iter().copied().fold(100.0, f32::min);
        assert!((highest - 8.0).abs() < 1e-3 && (lowest - 4.0).abs() < 1e-3, "{highest} {lowest}");
        assert!(rotor.output.vx_m_s.abs() < 1e-6 && (rotor.output.vy_m_s - 1.0).abs() < 1e-6);
    }

    // The fifth seed draws a random direction and never uses it.
    #[test]
    fn the_rotors_direction_is_kept_and_alternates_with_each_entry() {
        let mut rotor = modes(config().with_alternating_rotor(), ChassisMode::Rotor);
        for side in [1.0, -1.0, 1.0] {
            for _ in 0..5 {
                rotor.set_mode(ChassisMode::Rotor);
                assert!(settled(&mut rotor, 0.0).wz_rad_s * side > 3.0);
            }
            rotor.set_mode(ChassisMode::Independent);
            settled(&mut rotor, 0.0);
            rotor.set_mode(ChassisMode::Rotor);
        }
        let mut clockwise = modes(config().with_clockwise_rotor(), ChassisMode::Rotor);
        assert!(settled(&mut clockwise, 0.0).wz_rad_s < -3.0);
    }

    #[test]
    fn a_change_of_mode_makes_no_jump() {
        let mut modes = modes(config(), ChassisMode::FollowGimbal);
        let mut last = settled(&mut modes, 60.0);
        for mode in [
            ChassisMode::Rotor,
            ChassisMode::Independent,
            ChassisMode::FollowGimbal,
            ChassisMode::Rotor,
        ] {
            modes.set_mode(mode);
            for _ in 0..300 {
                let now = modes.update(AHEAD, yaw(60.0), DT).unwrap();
                assert!((now.wz_rad_s - last.wz_rad_s).abs() < 0.06, "{mode:?} {now:?} {last:?}");
                assert!((now - last).linear().norm() < 0.02);
                last = now;
            }
        }
    }

    #[test]
    fn the_follow_loop_begins_anew_when_its_mode_is_entered_again() {
        let follow = PidConfig::new(5.0, 10.0, 0.0).with_output_limit(50.0);
        let mut modes =
            modes(ModeConfig::new(follow).with_transition(0.0), ChassisMode::FollowGimbal);
        let mut step = |mode, degrees: f32| {
            modes.set_mode(mode);
            modes.update(Twist::ZERO, yaw(degrees), DT).unwrap().wz_rad_s
        };
        let first = step(ChassisMode::FollowGimbal, 10.0);
        for _ in 0..1000 {
            step(ChassisMode::FollowGimbal, 10.0);
        }
        assert!(step(ChassisMode::FollowGimbal, 10.0) > 2.0 * first);
        assert!(step(ChassisMode::Independent, 10.0).abs() < 1e-6);
        assert!((step(ChassisMode::FollowGimbal, 10.0) - first).abs() < 1e-6);
    }

    #[test]
    fn relax_gives_nothing_and_leaving_it_starts_from_rest() {
        let mut modes = modes(config(), ChassisMode::Rotor);
        settled(&mut modes, 0.0);
        modes.set_mode(ChassisMode::Relax);
        assert_eq!(modes.update(AHEAD, yaw(0.0), DT), None);
        modes.set_mode(ChassisMode::Independent);
        let first = modes.update(AHEAD, yaw(0.0), DT).unwrap();
        assert!(first.linear().norm() < 0.01, "{first:?}");
    }

    // F64.
    #[test]
    fn a_stale_yaw_is_replaced_by_independent_after_the_timeout_and_told_once() {
        let mut modes = modes(config(), ChassisMode::FollowGimbal);
        settled(&mut modes, 90.0);
        for _ in 0..29 {
            let _ = modes.update(AHEAD, None, DT);
        }
        assert_eq!((modes.acting(), modes.take_edge()), (ChassisMode::FollowGimbal, None));
        for _ in 0..500 {
            let _ = modes.update(AHEAD, Some(Angle::from_radians(f32::NAN)), DT);
        }
        assert_eq!(modes.acting(), ChassisMode::Independent);
        assert_eq!(modes.output, Twist::new(1.0, 0.0, 0.5));
        assert_eq!((modes.take_edge(), modes.take_edge()), (Some(ChassisMode::Independent), None));
        settled(&mut modes, 90.0);
        assert_eq!(
            (modes.acting(), modes.take_edge()),
            (ChassisMode::FollowGimbal, Some(ChassisMode::FollowGimbal))
        );
    }

    #[test]
    fn a_clock_that_died_stops_the_motion_and_loses_the_gimbal() {
        for dt in [f32::NAN, 0.0, -1.0, f32::INFINITY] {
            for mode in [ChassisMode::FollowGimbal, ChassisMode::Rotor, ChassisMode::Independent] {
                let mut modes = modes(config(), mode);
                let before = settled(&mut modes, 20.0);
                for calls in 1..=200 {
                    let twist = modes.update(AHEAD, None, dt).unwrap();
                    let expected = if calls < 100 { before } else { Twist::ZERO };
                    let change = twist - expected;
                    assert!(change.linear().norm() < 1e-6, "{dt} {calls}: {twist:?}");
                    assert!(change.wz_rad_s.abs() < 0.01, "{dt} {calls}: {twist:?}"); // the swing's last step
                }
                assert_eq!(modes.acting(), ChassisMode::Independent);
                let again = modes.update(AHEAD, yaw(20.0), DT).unwrap();
                assert_eq!(modes.acting(), mode);
                assert!(again.linear().norm() < 0.01, "{again:?}"); // from rest, evenly
            }
        }
    }

    #[test]
    fn without_any_yaw_the_mode_is_replaced_at_once_or_relaxed_as_configured() {
        let mut independent = modes(config(), ChassisMode::FollowGimbal);
        assert!(independent.update(AHEAD, None, DT).is_some());
        assert_eq!(independent.acting(), ChassisMode::Independent);
        let relaxing = config().with_gimbal_timeout(0.05).with_relax_without_gimbal();
        let mut relaxed = modes(relaxing, ChassisMode::Rotor);
        assert_eq!(relaxed.update(AHEAD, None, DT), None);
        assert_eq!(relaxed.take_edge(), Some(ChassisMode::Relax));
    }

    #[test]
    fn modes_never_return_a_value_that_is_not_finite() {
        let mut modes = modes(config(), ChassisMode::Rotor);
        for dt in [f32::NAN, f32::INFINITY, -1.0, 0.0, DT] {
            let twist = modes.update(Twist::new(f32::NAN, 0.0, 0.0), yaw(10.0), dt);
            assert!(twist.is_some_and(Twist::is_finite));
        }
        let command = Twist::new(f32::MIN, f32::MAX, -1.0);
        assert_eq!(modes.update(command, yaw(45.0), 1.0), Some(Twist::ZERO));
    }

    // Its phase was NaN from then on, and the chassis stood still until the mode was left.
    #[test]
    fn a_step_beyond_all_numbers_does_not_end_the_rotor() {
        let mut rotor = modes(config(), ChassisMode::Rotor);
        settled(&mut rotor, 20.0);
        let _ = rotor.update(AHEAD, yaw(20.0), f32::MAX);
        assert!(settled(&mut rotor, 20.0).wz_rad_s >= 4.0, "{:?}", rotor.output);
    }

    #[test]
    fn configurations_that_cannot_work_are_named() {
        let swing = config().with_rotor(1.0, 2.0, 1.0);
        let parameter = "rotor's swing around its base in rad/s";
        let refused = Modes::new(swing).err();
        assert!(
            matches!(refused, Some(ConfigError::Range { parameter: name, .. }) if name == parameter)
        );
        let nan = config().with_transition(f32::NAN);
        assert_eq!(Modes::new(nan), Err(ConfigError::Negative("the transition")));
        let gains = ModeConfig::new(PidConfig::new(f32::NAN, 0.0, 0.0));
        assert!(matches!(Modes::new(gains), Err(ConfigError::Loop(_, _))));
    }
}
