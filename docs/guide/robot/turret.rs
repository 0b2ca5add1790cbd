use crate::base::SetupError;
use crate::yaw::yaw;
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M2006, M3508};
use drivetrain::encoder::Position;
use drivetrain::motor::VelocityDrive;
use drivetrain::shooter::{Shooter, ShooterFeedback, ShooterOrder};
use drivetrain::time::Tick;
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::referee::BarrelHeat;

/// A per rad/s, A per rad.
const FRICTION: PidConfig = PidConfig::new(2.0, 20.0, 0.0);
const LOADER: PidConfig = PidConfig::new(1.0, 10.0, 0.0);

/// The mark of the bus of the turret.
#[derive(Debug)]
pub struct Upper;

/// A gimbal that turns, two friction wheels, and a loader with 8 chambers.
#[derive(Debug)]
pub struct Turret {
    pub yaw: Handle<Gm6020Voltage, Upper>,
    friction: [Handle<M3508, Upper>; 2],
    loader: Handle<M2006, Upper>,
    pub shooter: Shooter,
}

impl Turret {
    /// Attaches the yaw motor, the friction wheels 1 and 2, and the loader 3.
    pub fn new(bus: &mut Bus<Upper>) -> Result<Self, SetupError> {
        let left = Config::<M3508>::new(1).speed_loop(FRICTION);
        let right = Config::<M3508>::new(2).speed_loop(FRICTION).reversed();
        let loader = Config::<M2006>::new(3).speed_loop(LOADER);
        let shooter = Shooter::new(AngularVelocity::from_rpm(400.0), 8, 10.0)?; // 10 shots in 1 s
        Ok(Self {
            yaw: bus.attach(yaw())?,
            friction: bus.attach_all([left, right])?,
            loader: bus.attach(loader)?,
            shooter,
        })
    }

    /// Sets the targets: the angle of the gimbal, and those of the shooter for order and heat.
    pub fn drive(
        &mut self,
        bus: &mut Bus<Upper>,
        (angle, order, heat): (Angle, ShooterOrder, Option<BarrelHeat>),
        tick: Tick,
    ) {
        let fresh = bus.velocity(self.loader).and_then(|_| bus.state(self.loader));
        let feedback = ShooterFeedback {
            is_armed: bus.is_armed(),
            wheels: self.friction.map(|wheel| bus.velocity(wheel)),
            loader: fresh
                .map(|state| (state.position, state.velocity)),
            heat,
        };
        let targets = self.shooter.update(order, &feedback, tick);
        for wheel in self.friction {
            _ = bus.set_velocity(wheel, targets.wheels);
        }
        _ = bus.set_velocity(self.loader, targets.loader);
        _ = bus.set_position(self.yaw, Position::from_angle(angle));
    }
}

#[test]
fn the_motors_of_the_turret_load_their_bus_by_less_than_85_percent() {
    let mut bus = Bus::branded().with_load_ceiling(0.85);
    assert!(Turret::new(&mut bus).is_ok());
    assert_eq!(bus.motors().count(), 4);
    let refusal = Turret::new(&mut Bus::branded().with_load_ceiling(0.5)).unwrap_err();
    assert!(refusal.to_string().starts_with("M3508 #1: the bus load of up to 54 %"), "{refusal}");
}
