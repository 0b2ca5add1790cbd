//! Each family in each of its modes.

use crate::drives::{Damiao, Lk, Odrive, Rmd, RobStride, Vesc};
use crate::station::Station;
use drivetrain::control::PidConfig;
use drivetrain::encoder::GearRatio;
use drivetrain::error::ConfigError;
use drivetrain::motor::{
    Actuator, AngleDrive, DriveProtocol, Impedance, ImpedanceControl, TargetError, VelocityDrive,
};
use drivetrain::sim::{DamiaoDrive, LkDrive, OdriveDrive, RmdDrive, RobStrideDrive, VescDrive};
use drivetrain::time::Duration;
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};

/// The name of a mode, and a motor in it that is driven to a target of the mode.
type Mode = (&'static str, fn() -> Station);

/// A family: its name, and its modes. The first one takes torques.
pub(crate) struct Family {
    pub(crate) name: &'static str,
    pub(crate) modes: &'static [Mode],
    /// Drives of the family that differ in a fault, each driven to a torque.
    pub(crate) others: &'static [Mode],
    /// The mode in which the drive itself follows a position.
    position: &'static str,
    /// The error of an id that the protocol does not have.
    pub(crate) out_of_range: fn() -> ConfigError,
}

impl Family {
    pub(crate) fn station(&self) -> Station {
        self.modes[0].1()
    }

    pub(crate) fn at_position(&self) -> Station {
        self.modes.iter().find(|(mode, _)| *mode == self.position).unwrap().1()
    }
}

pub(crate) const FAMILIES: [Family; 6] = [
    Family {
        name: "damiao",
        position: "position-velocity",
        others: &[],
        out_of_range: || damiao::Motor::new(damiao::Model::J4310, 16, mit(3.0)).unwrap_err(),
        modes: &[
            ("MIT", || damiao_in(mit(3.0), 1.0, torque)),
            ("MIT, angle", || damiao_in(mit(3.0), 1.0, angle)),
            ("MIT, velocity", || damiao_in(mit(3.0), 1.0, velocity)),
            ("MIT, damper", || damiao_in(mit(3.0), 1.0, damper)),
            ("position-velocity", || {
                damiao_in(damiao::Mode::position_velocity(quick()), 2.0, angle)
            }),
            ("velocity", || damiao_in(damiao::Mode::velocity(quick()), 3.0, velocity)),
            ("force-position", || {
                damiao_in(damiao::Mode::force_position(quick(), 2.0), 4.0, angle)
            }),
        ],
    },
    Family {
        name: "robstride",
        position: "position",
        others: &[("CyberGear", || robstride_in(robstride::Model::CYBERGEAR, mit(3.0), torque))],
        out_of_range: || robstride::Motor::new(robstride::Model::RS02, 128, mit(3.0)).unwrap_err(),
        modes: &[
            ("operation", || robstride_in(robstride::Model::RS02, mit(3.0), torque)),
            ("operation, angle", || robstride_in(robstride::Model::RS02, mit(3.0), angle)),
            ("operation, CyberGear", || robstride_in(robstride::Model::CYBERGEAR, mit(3.0), angle)),
            ("velocity", || {
                let mode = robstride::Mode::velocity(quick(), 8.0);
                robstride_in(robstride::Model::RS02, mode, velocity)
            }),
            ("position", || {
                let mode = robstride::Mode::position(quick(), 8.0);
                robstride_in(robstride::Model::RS02, mode, angle)
            }),
            ("current", || {
                let mode = robstride::Mode::current(8.0, 1.0);
                robstride_in(robstride::Model::RS02, mode, torque)
            }),
        ],
    },
    Family {
        name: "vesc",
        position: "position",
        others: &[],
        out_of_range: || vesc::Motor::new(VESC, 254, vesc::Mode::current()).unwrap_err(),
        modes: &[
            ("current", || vesc_in(vesc::Mode::current(), torque)),
            ("current, angle", || {
                let position = PidConfig::new(10.0, 0.0, 0.0).with_output_limit(20.0);
                let mode = vesc::Mode::current_with_loops(position, SPEED).unwrap();
                vesc_in(mode, angle)
            }),
            ("duty", || {
                let speed = PidConfig::new(0.003, 0.0, 0.0);
                vesc_in(vesc::Mode::duty(0.4, speed).unwrap(), velocity)
            }),
            ("velocity", || vesc_in(vesc::Mode::velocity(), velocity)),
            ("position", || vesc_in(vesc::Mode::position(), angle)),
        ],
    },
    Family {
        name: "lk",
        position: "position-velocity",
        others: &[],
        out_of_range: || lk::Motor::new(lk::Model::MF9025_16T, 33, mit(2.0)).unwrap_err(),
        modes: &[
            ("torque", || lk_in(mit(2.0), torque)),
            ("torque, angle", || lk_in(mit(2.0), angle)),
            ("velocity", || lk_in(lk::Mode::velocity_with_torque_limit(quick(), 2.0), velocity)),
            ("position-velocity", || lk_in(lk::Mode::position_velocity(quick()), angle)),
        ],
    },
    Family {
        name: "rmd",
        position: "position-velocity",
        others: &[],
        out_of_range: || rmd::Motor::new(rmd::Model::X8_120, 33, mit(4.0)).unwrap_err(),
        modes: &[
            ("torque", || rmd_in(mit(4.0), torque)),
            ("torque, angle", || rmd_in(mit(4.0), angle)),
            ("velocity", || rmd_in(rmd::Mode::velocity(quick()), velocity)),
            ("position-velocity", || rmd_in(rmd::Mode::position_velocity(quick()), angle)),
        ],
    },
    Family {
        name: "odrive",
        position: "position, 0.6",
        others: &[("0.5", || odrive_in(mit(3.0), odrive::Firmware::V0_5, torque))],
        out_of_range: || {
            odrive::Motor::new(odrive::Model::D6374, odrive::Firmware::V0_6, 63, quick(), mit(3.0))
                .unwrap_err()
        },
        modes: &[
            ("torque, 0.6", || odrive_in(mit(3.0), odrive::Firmware::V0_6, torque)),
            ("torque, 0.5", || odrive_in(mit(3.0), odrive::Firmware::V0_5, torque)),
            ("torque, angle", || odrive_in(mit(3.0), odrive::Firmware::V0_6, angle)),
            ("velocity, 0.5", || {
                odrive_in(odrive::Mode::velocity(3.0), odrive::Firmware::V0_5, velocity)
            }),
            ("velocity, 0.6", || {
                odrive_in(odrive::Mode::velocity(3.0), odrive::Firmware::V0_6, velocity)
            }),
            ("position, 0.5", || {
                odrive_in(odrive::Mode::position(3.0), odrive::Firmware::V0_5, angle)
            }),
            ("position, 0.6", || {
                odrive_in(odrive::Mode::position(3.0), odrive::Firmware::V0_6, angle)
            }),
        ],
    },
];

pub(crate) const VESC: vesc::Model = vesc::Model {
    name: "6374",
    pole_pairs: 7,
    gear: GearRatio::DIRECT,
    torque_constant_nm_per_a: 0.05,
    current_limit_a: 20.0,
    max_velocity: AngularVelocity::from_rad_per_s(300.0),
};

const SPEED: PidConfig = PidConfig::new(0.3, 1.0, 0.0);

/// The numbers that the simulated drive has.
const ENDPOINTS: odrive::Endpoints =
    odrive::Endpoints { control_mode: 1, input_mode: 2, watchdog_timeout: 3, enable_watchdog: 4 };

fn quick() -> AngularVelocity {
    AngularVelocity::from_rad_per_s(20.0)
}

fn mit(torque_nm: f32) -> ImpedanceControl {
    ImpedanceControl::new(torque_nm).unwrap().with_gains(20.0, 0.6).unwrap()
}

fn torque<M: DriveProtocol>(own: &mut Actuator<M>, share: f32) -> Result<(), TargetError> {
    own.set_torque(0.8 * share)
}

fn velocity<M: DriveProtocol>(own: &mut Actuator<M>, share: f32) -> Result<(), TargetError> {
    own.set_velocity((), AngularVelocity::from_rad_per_s(6.0 * share))
}

/// A velocity without a spring.
fn damper<M: DriveProtocol>(own: &mut Actuator<M>, share: f32) -> Result<(), TargetError> {
    let velocity = AngularVelocity::from_rad_per_s(6.0 * share);
    own.set_impedance(Impedance { velocity, damping: 0.6, ..Impedance::FREE })
}

fn angle<M: DriveProtocol>(own: &mut Actuator<M>, share: f32) -> Result<(), TargetError> {
    own.set_angle((), Angle::from_radians(1.5 * share))
}

type Set<M> = crate::station::Set<M>;

fn damiao_in(mode: impl Into<damiao::Mode>, number: f32, set: Set<damiao::Motor>) -> Station {
    let motor = damiao::Motor::new(damiao::Model::J4310, 1, mode).unwrap();
    let drive = DamiaoDrive::of(damiao::Model::J4310, 1).with_register(10, number);
    Station::new(motor, set, Damiao(drive, number < 2.0))
}

fn robstride_in(
    model: robstride::Model,
    mode: impl Into<robstride::Mode>,
    set: Set<robstride::Motor>,
) -> Station {
    let drive = RobStride(RobStrideDrive::of(model, 1));
    Station::new(robstride::Motor::new(model, 1, mode).unwrap(), set, drive)
}

fn vesc_in(mode: vesc::Mode, set: Set<vesc::Motor>) -> Station {
    let drive = Vesc(VescDrive::of(VESC, 23).with_current_max(40.0));
    Station::new(vesc::Motor::new(VESC, 23, mode).unwrap(), set, drive)
}

fn lk_in(mode: impl Into<lk::Mode>, set: Set<lk::Motor>) -> Station {
    let model = lk::Model::MF9025_16T;
    let drive = Lk(LkDrive::of(model, 1));
    Station::new(lk::Motor::new(model, 1, mode).unwrap(), set, drive)
}

fn rmd_in(mode: impl Into<rmd::Mode>, set: Set<rmd::Motor>) -> Station {
    let model = rmd::Model::X8_120;
    let drive = RmdDrive::new(1, model.torque_constant());
    Station::new(rmd::Motor::new(model, 1, mode).unwrap(), set, Rmd(drive))
}

fn odrive_in(
    mode: impl Into<odrive::Mode>,
    firmware: odrive::Firmware,
    set: Set<odrive::Motor>,
) -> Station {
    let model = odrive::Model::D6374;
    let motor = odrive::Motor::new(model, firmware, 3, quick(), mode).unwrap();
    let mut motor = motor.with_gear(5.0).unwrap();
    let is_0_6 = firmware == odrive::Firmware::V0_6;
    if is_0_6 {
        motor = motor.with_endpoints(ENDPOINTS, Duration::from_millis(100)).unwrap();
    }
    let drive = OdriveDrive::new(3, is_0_6, model.torque_constant(), 5.0);
    Station::new(motor, set, Odrive(drive.with_periods(0.1, 0.002), true))
}
