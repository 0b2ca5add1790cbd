//! A motor of each family whose drives have frames of their own: for the bench and the example `socketcan`.

use drivetrain::motor::Actuator;
use drivetrain::{damiao, lk, odrive, rmd, robstride, vesc};

/// The motor as a device.
#[derive(Debug)]
pub(crate) enum Kind {
    Damiao(Actuator<damiao::Motor>),
    Lk(Actuator<lk::Motor>),
    Rmd(Actuator<rmd::Motor>),
    RobStride(Actuator<robstride::Motor>),
    Odrive(Actuator<odrive::Motor>),
    Vesc(Actuator<vesc::Motor>),
}

/// Does the same with a motor of whatever family, or with whatever the `Kind` of the caller has for each family.
macro_rules! each {
    ($kind:expr, $own:ident => $work:expr) => {
        match $kind {
            Kind::Damiao($own) => $work,
            Kind::Lk($own) => $work,
            Kind::Rmd($own) => $work,
            Kind::RobStride($own) => $work,
            Kind::Odrive($own) => $work,
            Kind::Vesc($own) => $work,
        }
    };
}

pub(crate) use each;
