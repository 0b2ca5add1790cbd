use super::motor::{Constants, MotorConfig};
use core::f32::consts::TAU;

/// One turn of the rotor in the unit of the stored angle.
const TURN: f32 = 4_294_967_296.0;

/// The command of the ESC's power stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Drive {
    /// The power stage is open: no current.
    Open,
    Amperes(f32),
    Volts(f32),
}

/// Effects of faults on the mechanics of one motor.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Mechanics {
    pub(crate) blocked: bool,
    pub(crate) reversed: bool,
}

/// The electrical and mechanical part of a motor: winding, rotor, gearbox, friction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rotor {
    constants: Constants,
    torque_constant: f32,
    back_emf: f32,
    current_limit: f32,
    supply_v: f32,
    inertia: f32,
    /// Dry friction of motor and load, Nm.
    coulomb: f32,
    gear: f32,
    /// The rotor's lowest and highest angle.
    stops: Option<(i64, i64)>,
    /// Rotor turns times 2^32: exact for 2^31 turns, at any speed.
    angle: i64,
    /// Output shaft, rad/s.
    velocity: f32,
    current: f32,
    /// Nm at the output shaft, from outside; positive turns counter-clockwise.
    pub(crate) load_nm: f32,
    pub(crate) mechanics: Mechanics,
    temperature: f64,
}

impl Rotor {
    pub(crate) const fn new(config: &MotorConfig, angle_counts: u16) -> Self {
        let facts = config.model.facts();
        let constants = Constants::of(config.model);
        let gear = facts.gear.as_f32();
        let angle = (angle_counts as i64) << 19;
        Self {
            constants,
            torque_constant: facts.torque_constant_nm_per_a,
            back_emf: constants.back_emf(facts),
            current_limit: facts.current_full_scale_a,
            supply_v: config.supply_v,
            inertia: constants.inertia + config.load_inertia_kg_m2,
            coulomb: constants.coulomb + config.load_friction_nm,
            gear,
            stops: match config.stops {
                Some((lower, upper)) => {
                    Some((angle + rotor_angle(lower, gear), angle + rotor_angle(upper, gear)))
                }
                None => None,
            },
            angle,
            velocity: 0.0,
            current: 0.0,
            load_nm: 0.0,
            mechanics: Mechanics { blocked: false, reversed: false },
            temperature: AMBIENT_C as f64,
        }
    }

    /// Moves the current by one step of `dt_s`.
    pub(crate) fn step_current(&mut self, drive: Drive, dt_s: f32) {
        let time_constant = self.constants.current_time_constant;
        let share = dt_s / (time_constant + dt_s); // backward Euler: never overshoots
        let settled = match drive {
            Drive::Open => {
                self.current = 0.0;
                return;
            }
            Drive::Amperes(target) => target,
            Drive::Volts(target) => {
                let volts = target.clamp(-self.supply_v, self.supply_v);
                (volts - self.generated()) / self.constants.resistance
            }
        };
        let current = self.current + (settled - self.current) * share;
        // The range of the supply against the back-EMF; within it, the range of the ESC.
        let generated = self.generated();
        let highest = (self.supply_v - generated) / self.constants.resistance;
        let lowest = (-self.supply_v - generated) / self.constants.resistance;
        let current = at_least(at_most(current, highest), lowest);
        self.current = at_most(at_least(current, -self.current_limit), self.current_limit);
    }

    /// Returns the torque of the motor at the output shaft in Nm, before friction.
    pub(crate) fn torque_nm(&self) -> f32 {
        self.torque_constant * self.current
    }

    /// Returns the back-EMF in V.
    fn generated(&self) -> f32 {
        let volts = self.back_emf * self.velocity;
        if self.mechanics.reversed { -volts } else { volts }
    }

    /// Returns the electric power in W: current times back-EMF and voltage over the winding.
    pub(crate) fn power_w(&self) -> f32 {
        self.current * (self.generated() + self.constants.resistance * self.current)
    }

    /// Moves speed and angle by one step of `dt_s`, with one more torque at the output shaft.
    pub(crate) fn step_motion(&mut self, other_torque_nm: f32, dt_s: f32) {
        if self.mechanics.blocked {
            self.velocity = 0.0;
            return;
        }
        let torque = self.torque_nm();
        let torque = if self.mechanics.reversed { -torque } else { torque };
        let impulse = (torque + self.load_nm + other_torque_nm) * dt_s;
        let moving = (self.inertia * self.velocity + impulse)
            / (self.inertia + self.constants.viscous * dt_s);
        // Dry friction takes speed away, and never more than there is.
        let loss = self.coulomb * dt_s / self.inertia;
        self.velocity = if moving.abs() <= loss { 0.0 } else { moving - loss.copysign(moving) };
        self.angle = self.angle.wrapping_add(self.travel(dt_s));
        if let Some((lowest, highest)) = self.stops {
            let within = self.angle.clamp(lowest, highest);
            if within != self.angle {
                self.angle = within;
                self.velocity = 0.0;
            }
        }
    }

    /// Returns the angle covered by the rotor in `dt_s`, in turns times 2^32.
    const fn travel(&self, dt_s: f32) -> i64 {
        rotor_angle(self.velocity * dt_s, self.gear)
    }

    /// Moves the temperature by one step of `dt_s`; call it less often than the others.
    pub(crate) fn step_temperature(&mut self, dt_s: f32) {
        let settled = f64::from(AMBIENT_C + self.constants.heating * self.current * self.current);
        let share = f64::from(dt_s / self.constants.thermal_time_constant);
        self.temperature += (settled - self.temperature) * share;
    }

    /// Returns the rotor's angle `dt_s` after the last step, in counts of 8192 a turn.
    pub(crate) fn counts(&self, dt_s: f32) -> i64 {
        self.angle.wrapping_add(self.travel(dt_s)) >> 19
    }

    /// Returns the turns of the output shaft `dt_s` after the last step.
    pub(crate) fn shaft_turns(&self, dt_s: f32) -> f64 {
        let turns = self.angle.wrapping_add(self.travel(dt_s)) as f64 / f64::from(TURN);
        turns / f64::from(self.gear)
    }

    /// Returns the angle of the output shaft within a turn in rad, from the rotor's zero at the start.
    #[expect(clippy::cast_possible_truncation, reason = "within a turn")]
    pub(crate) fn shaft_rad(&self) -> f32 {
        let turns = self.angle as f64 / f64::from(TURN) / f64::from(self.gear);
        let within = turns - (turns as i64) as f64;
        (within * core::f64::consts::TAU) as f32
    }

    /// Returns the velocity of the output shaft in rad/s.
    pub(crate) const fn velocity(&self) -> f32 {
        self.velocity
    }

    /// Returns the inertia at the output shaft in kg m².
    pub(crate) const fn inertia(&self) -> f32 {
        self.inertia
    }

    /// Returns the velocity of the rotor in rpm.
    pub(crate) fn rotor_rpm(&self) -> f32 {
        self.velocity * self.gear * (60.0 / TAU)
    }

    pub(crate) const fn current(&self) -> f32 {
        self.current
    }

    /// Returns the temperature in °C.
    #[expect(clippy::cast_possible_truncation, reason = "a temperature fits f32")]
    pub(crate) const fn temperature(&self) -> f32 {
        self.temperature as f32
    }

    pub(crate) const fn set_temperature(&mut self, celsius: f32) {
        self.temperature = celsius as f64;
    }
}

/// Returns the angle of the rotor, in turns times 2^32, at this angle of the output shaft.
#[expect(clippy::cast_possible_truncation, reason = "saturates; far below 2^63 at any real speed")]
const fn rotor_angle(output_rad: f32, gear: f32) -> i64 {
    (output_rad * (gear / TAU) * TURN) as i64
}

/// Room temperature in °C.
/// Returns the value or the limit, in one instruction: a current is never NaN, which `f32::min` and `f32::clamp` would check.
const fn at_most(value: f32, upper: f32) -> f32 {
    if value > upper { upper } else { value }
}

const fn at_least(value: f32, lower: f32) -> f32 {
    if value < lower { lower } else { value }
}

const AMBIENT_C: f32 = 25.0;

#[cfg(test)]
mod tests {
    use super::super::motor::Model;
    use super::*;
    use crate::motor::Capability;

    const STEP: f32 = 1e-4;
    const MODELS: [Model; 4] =
        [Model::M2006, Model::M3508, Model::Gm6020Voltage, Model::Gm6020Current];

    #[test]
    fn a_stop_holds_against_full_torque_and_lets_go_the_other_way() {
        let stops = [-0.3, 0.2].map(crate::units::Angle::from_radians);
        let config = MotorConfig::new(Model::M2006, 1).with_stops(stops[0], stops[1]);
        let mut rotor = Rotor::new(&config, 4_000);
        let mut press = |amperes: f32| {
            for _ in 0..10_000 {
                rotor.step_current(Drive::Amperes(amperes), STEP);
                rotor.step_motion(0.0, STEP);
            }
            let turned = (rotor.counts(0.0) - 4_000) as f32 / (8_192.0 * 36.0) * TAU;
            (turned, rotor.velocity(), rotor.current())
        };
        for (amperes, stop) in [(10.0, 0.2), (-10.0, -0.3), (5.0, 0.2_f32)] {
            let (turned, velocity, current) = press(amperes);
            assert!((turned - stop).abs() < 1e-4 && velocity.abs() < 0.01, "{turned}, {velocity}");
            assert!((current - amperes).abs() < 0.01, "{current}");
        }
    }

    #[test]
    fn friction_of_the_load_is_overcome_by_more_current_only() {
        let config = MotorConfig::new(Model::M2006, 1).with_load_friction_nm(0.3); // and 0.05 own
        for (amperes, moves) in [(1.8, false), (-1.8, false), (2.1, true), (-2.1, true)] {
            let mut rotor = Rotor::new(&config, 0);
            for _ in 0..1_000 {
                rotor.step_current(Drive::Amperes(amperes), STEP); // 0.18 Nm/A
                rotor.step_motion(0.0, STEP);
            }
            assert_eq!(rotor.velocity().abs() > 0.1, moves, "{amperes} A");
        }
    }

    fn rotor(model: Model) -> Rotor {
        Rotor::new(&MotorConfig::new(model, 1), 0)
    }

    fn full(model: Model) -> Drive {
        let facts = model.facts();
        if facts.control == Capability::Voltage {
            Drive::Volts(facts.command_full_scale)
        } else {
            Drive::Amperes(facts.command_full_scale)
        }
    }

    fn reversed(drive: Drive) -> Drive {
        match drive {
            Drive::Open => Drive::Open,
            Drive::Amperes(amperes) => Drive::Amperes(-amperes),
            Drive::Volts(volts) => Drive::Volts(-volts),
        }
    }

    fn run(rotor: &mut Rotor, drive: Drive, steps: u32) {
        for _ in 0..steps {
            rotor.step_current(drive, STEP);
            rotor.step_motion(0.0, STEP);
        }
    }

    fn rpm(rotor: &Rotor) -> f32 {
        rotor.velocity() * 60.0 / TAU
    }

    #[test]
    fn documented_no_load_speeds_come_out_in_both_directions() {
        for model in MODELS {
            let documented = model.facts().no_load_rpm;
            for (drive, sign) in [(full(model), 1.0), (reversed(full(model)), -1.0)] {
                let mut rotor = rotor(model);
                run(&mut rotor, drive, 20_000);
                let error = sign * rpm(&rotor) / documented - 1.0;
                assert!(error.abs() < 1e-3, "{model:?}: {} rpm", rpm(&rotor));
            }
        }
    }

    #[test]
    fn the_back_emf_that_follows_is_the_one_in_the_docs() {
        let documented =
            [(Model::M2006, 0.454), (Model::M3508, 0.475), (Model::Gm6020Voltage, 0.71)];
        for (model, v_s_per_rad) in documented {
            assert!((rotor(model).back_emf - v_s_per_rad).abs() < 6e-4, "{model:?}");
        }
    }

    #[test]
    fn the_m3508_meets_its_rated_point() {
        let mut rotor = rotor(Model::M3508);
        rotor.load_nm = -3.0;
        run(&mut rotor, full(Model::M3508), 20_000);
        assert!((rpm(&rotor) - 469.0).abs() < 1.0, "{} rpm", rpm(&rotor));
    }

    #[test]
    fn half_the_supply_gives_about_half_the_speed() {
        for model in MODELS {
            let config = MotorConfig::new(model, 1).with_supply_v(12.0);
            let mut rotor = Rotor::new(&config, 0);
            run(&mut rotor, full(model), 20_000);
            let share = rpm(&rotor) / model.facts().no_load_rpm;
            assert!((0.48..0.5).contains(&share), "{model:?}: {share}");
        }
    }

    #[test]
    fn the_current_of_a_held_shaft_stays_at_the_limit_of_the_esc() {
        for model in MODELS {
            for drive in
                [full(model), reversed(full(model)), Drive::Amperes(1e9), Drive::Volts(-1e9)]
            {
                let mut rotor = rotor(model);
                for _ in 0..1000 {
                    rotor.step_current(drive, STEP);
                    assert!(rotor.current().abs() <= model.facts().current_full_scale_a);
                }
                assert!(rotor.current().abs() > 0.999 * model.facts().current_full_scale_a);
            }
        }
    }

    #[test]
    fn torque_follows_the_documented_constant() {
        for (model, nm_per_a) in
            [(Model::M2006, 0.18), (Model::M3508, 0.3), (Model::Gm6020Current, 0.741)]
        {
            let mut rotor = rotor(model);
            for _ in 0..1000 {
                rotor.step_current(Drive::Amperes(1.0), STEP);
            }
            assert!((rotor.torque_nm() - nm_per_a).abs() < 1e-4, "{model:?}");
        }
    }

    #[test]
    fn a_current_below_friction_does_not_move_the_shaft() {
        for model in MODELS {
            let mut rotor = rotor(model);
            let breakaway = Constants::of(model).coulomb / model.facts().torque_constant_nm_per_a;
            run(&mut rotor, Drive::Amperes(0.9 * breakaway), 1000);
            assert_eq!((rotor.angle, rotor.velocity().to_bits()), (0, 0), "{model:?}");
            run(&mut rotor, Drive::Amperes(1.1 * breakaway), 1000);
            assert!(rotor.angle > 0, "{model:?}");
        }
    }

    #[test]
    fn an_open_motor_only_loses_energy_and_comes_to_rest() {
        for model in MODELS {
            let mut rotor = rotor(model);
            run(&mut rotor, full(model), 5_000);
            let mut last = rotor.velocity();
            for _ in 0..100_000 {
                run(&mut rotor, Drive::Open, 1);
                assert!(rotor.velocity() >= 0.0 && rotor.velocity() <= last, "{model:?}");
                last = rotor.velocity();
            }
            assert_eq!(last.to_bits(), 0, "{model:?} still turns");
        }
    }

    #[test]
    fn work_of_the_motor_is_kinetic_energy_and_friction() {
        for model in MODELS {
            let (mut rotor, constants) = (rotor(model), Constants::of(model));
            let (mut work, mut lost) = (0.0_f64, 0.0_f64);
            for _ in 0..3_000 {
                rotor.step_current(full(model), STEP);
                let before = f64::from(rotor.velocity());
                rotor.step_motion(0.0, STEP);
                let mean = 0.5 * (before + f64::from(rotor.velocity())) * f64::from(STEP);
                work += f64::from(rotor.torque_nm()) * mean;
                lost += f64::from(constants.coulomb + constants.viscous * rotor.velocity()) * mean;
            }
            let speed = f64::from(rotor.velocity());
            let kinetic = 0.5 * f64::from(constants.inertia) * speed * speed;
            let balance = (work - lost - kinetic) / work;
            assert!(balance.abs() < 2e-3, "{model:?}: {balance}");
        }
    }

    #[test]
    fn the_power_of_a_held_shaft_is_heat_and_at_full_speed_that_of_friction() {
        for model in MODELS {
            let facts = model.facts();
            let mut held = rotor(model);
            (0..1_000).for_each(|_| held.step_current(Drive::Amperes(2.0), STEP));
            let heat = 4.0 * Constants::of(model).resistance;
            assert!((held.power_w() / heat - 1.0).abs() < 1e-3, "{model:?}");
            let mut free = rotor(model);
            run(&mut free, full(model), 20_000);
            // At 24 V and the current of friction.
            let friction =
                Constants::of(model).coulomb + Constants::of(model).viscous * free.velocity();
            let expected = 24.0 * friction / facts.torque_constant_nm_per_a;
            assert!(
                (free.power_w() / expected - 1.0).abs() < 0.01,
                "{model:?}: {}",
                free.power_w()
            );
        }
    }

    #[test]
    fn a_motor_driven_above_its_no_load_speed_brakes() {
        let mut rotor = rotor(Model::M3508);
        rotor.load_nm = 10.0;
        run(&mut rotor, Drive::Amperes(0.0), 20_000);
        assert!(rotor.current() < 0.0 && rpm(&rotor) > 482.0 && rotor.power_w() < 0.0);
    }

    #[test]
    fn heat_settles_where_current_and_room_balance() {
        let mut rotor = rotor(Model::M3508);
        for _ in 0..1000 {
            rotor.step_current(Drive::Amperes(10.0), STEP);
        }
        for _ in 0..3_000_000 {
            rotor.step_temperature(1e-3);
        }
        assert!((rotor.temperature() - 85.0).abs() < 0.5, "{}", rotor.temperature());
    }

    #[test]
    fn angles_are_exact_over_many_turns() {
        let mut rotor = rotor(Model::M2006);
        rotor.angle = i64::from(i32::MAX) << 32;
        let before = rotor.counts(0.0);
        rotor.velocity = TAU / 36.0; // one rotor turn a second
        assert!((rotor.counts(0.5) - before - 4096).abs() <= 1);
        rotor.velocity = -rotor.velocity;
        assert!((rotor.counts(0.5) - before + 4096).abs() <= 1);
    }
}
