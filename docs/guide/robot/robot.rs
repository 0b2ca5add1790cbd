use crate::base::{Base, Lower, SetupError};
use crate::turret::{Turret, Upper};
use drivetrain::dji::Bus;
use drivetrain::geometry::{Body, Twist};
use drivetrain::motor::{ArmError, ArmingSwitch, SwitchOrder};
use drivetrain::runner::{EmergencyStop, Port, Runner};
use drivetrain::shooter::ShooterOrder;
use drivetrain::time::{Clock, Tick};
use drivetrain::units::Angle;
use drivetrain::wire::referee::BarrelHeat;

/// The targets of the robot for this millisecond.
#[derive(Debug, Clone, Copy)]
pub struct Wish {
    pub is_on: Option<bool>, // `None` while the switch is not known
    pub twist: Twist<Body>,
    pub angle: Angle,
    pub order: ShooterOrder,
    pub heat: Option<BarrelHeat>,
}

impl Wish {
    /// The sticks are let go, and nothing shoots: a robot that is armed otherwise leaps.
    fn is_at_rest(&self) -> bool {
        self.twist == Twist::ZERO && self.order == ShooterOrder::Rest
    }
}

/// Two buses, each with its runner.
#[derive(Debug)]
pub struct Robot<P, K> {
    pub lower: Runner<P, K, Bus<Lower>>,
    pub upper: Runner<P, K, Bus<Upper>>,
    pub base: Base,
    pub turret: Turret,
    switch: ArmingSwitch,
    brakes: bool, // the remote control was lost less than a second ago
    angle: Angle, // of the gimbal
}

impl<P: Port, K: Clock + Copy> Robot<P, K> {
    /// Takes both drivers, the clock of both buses, and the emergency stop of both.
    pub fn new(
        lower: P,
        upper: P,
        clock: K,
        stop: &'static EmergencyStop,
    ) -> Result<Self, SetupError> {
        let (mut wheels, mut gimbal) = (Bus::branded(), Bus::branded());
        let (base, turret) = (Base::new(&mut wheels)?, Turret::new(&mut gimbal)?);
        let lower = Runner::new(lower, clock, wheels).with_emergency_stop(stop);
        let upper = Runner::new(upper, clock, gimbal).with_emergency_stop(stop);
        Ok(Self { lower, upper, base, turret, switch: ArmingSwitch::new(), brakes: false, angle: Angle::ZERO })
    }

    /// Runs the steps that are due. `limit` sees the commands of the wheels before they are sent.
    /// Returns the reason if arming is refused.
    pub fn step(
        &mut self,
        wish: &Wish,
        limit: impl FnOnce(&mut Bus<Lower>, Tick),
    ) -> Option<ArmError> {
        self.lower.poll(16);
        self.upper.poll(16);
        let mut refusal = None;
        if let Some(tick) = self.lower.due() {
            let order = self.switch.read(wish.is_on, wish.is_at_rest(), tick);
            self.brakes = order == SwitchOrder::Brake;
            match order {
                SwitchOrder::Arm => refusal = self.arm(tick),
                SwitchOrder::Keep | SwitchOrder::Brake => {}
                SwitchOrder::Disarm => self.disarm(),
            }
            // Armed means all wheels: when one is lost, the others brake.
            let drives = self.lower.is_armed() && !self.brakes;
            let twist = if drives { wish.twist } else { Twist::ZERO };
            self.base.drive(self.lower.device_mut(), twist, tick);
            self.lower.tick_limited(tick, |bus| limit(bus, tick));
        }
        if let Some(tick) = self.upper.due() {
            if !self.brakes && wish.is_on.is_some() {
                self.angle = wish.angle; // not heard, the gimbal stays
            }
            let order = if self.brakes { ShooterOrder::Rest } else { wish.order };
            self.turret.drive(self.upper.device_mut(), (self.angle, order, wish.heat), tick);
            self.upper.tick(tick);
        }
        refusal
    }

    /// Both buses, or none.
    fn arm(&mut self, tick: Tick) -> Option<ArmError> {
        let refusal = self.lower.arm(tick).err().or_else(|| self.upper.arm(tick).err());
        if refusal.is_some() {
            self.disarm();
        }
        refusal
    }

    fn disarm(&mut self) {
        self.lower.device_mut().disarm();
        self.upper.device_mut().disarm();
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::base::tests::floor;
    use drivetrain::runner::Nb;
    use drivetrain::sim::{Controller, Line, MotorConfig, MotorKey, Simulation};
    use drivetrain::time::Duration;

    pub type Simulated<'w> = Robot<Nb<Controller<'w>>, &'w Simulation>;

    pub const WISH: Wish = Wish {
        is_on: Some(true),
        twist: Twist::new(0.5, 0.0, 0.0),
        angle: Angle::from_degrees(90.0),
        order: ShooterOrder::Rest,
        heat: Some(BarrelHeat { heat: 0, limit: 100, cooling_per_s: 20 }), // practice, without a referee
    };

    /// Puts all motors into the world: wheels, yaw, friction wheels, loader.
    pub fn motors(world: &Simulation) -> ([MotorKey; 3], [MotorKey; 4]) {
        let yaw =
            MotorConfig::gm6020_voltage(1).with_rotor_angle(4_096).with_load_inertia_kg_m2(0.005);
        let friction = [MotorConfig::m3508(1), MotorConfig::m3508(2)];
        let loader = MotorConfig::m2006(3).with_load_friction_nm(0.1);
        let upper = [yaw, friction[0], friction[1], loader];
        let wheels = floor(world).unwrap();
        (wheels, upper.map(|config| world.attach(config.with_line(Line::Can2)).unwrap()))
    }

    pub fn robot<'w>(world: &'w Simulation, stop: &'static EmergencyStop) -> Simulated<'w> {
        let controller = |line| Nb(world.controller_on(line));
        Robot::new(controller(Line::Can1), controller(Line::Can2), world.clock(), stop).unwrap()
    }

    /// Lets the robot run for so many milliseconds.
    pub fn run(world: &Simulation, robot: &mut Simulated<'_>, millis: u32, wish: Wish) {
        for _ in 0..millis {
            world.advance(Duration::from_millis(1));
            let rest = Wish { twist: Twist::ZERO, order: ShooterOrder::Rest, ..wish };
            let wish = if robot.lower.is_armed() { wish } else { rest };
            let refusal = robot.step(&wish, |_, _| {});
            assert!(refusal.is_none(), "{refusal:?}");
        }
    }

    #[test]
    fn the_robot_drives_aims_and_shoots_until_it_is_stopped() {
        static STOP: EmergencyStop = EmergencyStop::new();
        let world = Simulation::new(1);
        let (wheels, turret) = motors(&world);
        let mut robot = robot(&world, &STOP);
        run(&world, &mut robot, 100, Wish { is_on: Some(false), ..WISH });
        run(&world, &mut robot, 1_500, Wish { order: ShooterOrder::Spin, ..WISH });
        run(&world, &mut robot, 1_500, Wish { order: ShooterOrder::Fire(3), ..WISH });
        let speed = world.chassis().unwrap().1.vx_m_s;
        let degrees = world.motor(turret[0]).unwrap().position.angle().as_degrees();
        assert!((speed - 0.5).abs() < 0.03, "{speed} m/s");
        assert!((degrees - 90.0).abs() < 1.0, "{degrees}");
        assert_eq!(robot.turret.shooter.shots(), 3);

        STOP.set(); // from an interrupt, for example
        run(&world, &mut robot, 3, WISH);
        let is_at_rest = |motor: &MotorKey| world.motor(*motor).unwrap().command == 0;
        assert_eq!(wheels.iter().chain(&turret).filter(|motor| is_at_rest(motor)).count(), 7);
    }
}
