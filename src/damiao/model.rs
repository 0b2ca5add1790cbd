//! Facts of the models, as a table open to further models.

use crate::error::ConfigError;
use crate::motor::{mit_model, models};
use crate::wire::mit::Ranges;

/// A model of motor: its name and the ranges of its fields, registers of the drive.
///
/// The torques and speeds of the ranges belong to the protocol, not to the motor: a program states the
/// limit of the motor with its mode.
///
/// | model | PMAX rad | VMAX rad/s | TMAX Nm | seen in |
/// |---|--:|--:|--:|---|
/// | [`J3507`](Self::J3507) | 12.566 | 50 | 5 | damiao-motor, Seeed |
/// | [`J4310`](Self::J4310) | 12.5 | 30 | 10 | damiao-motor, reBot, Seeed |
/// | [`J4310P`](Self::J4310P) | 12.5 | 50 | 10 | damiao-motor |
/// | [`J4340`](Self::J4340) | 12.5 | 10 | 28 | damiao-motor, motorbridge, can-motor-control; Seeed has 8 rad/s |
/// | [`J4340P`](Self::J4340P) | 12.5 | 10 | 28 | damiao-motor, reBot |
/// | [`J6006`](Self::J6006) | 12.5 | 45 | 20 | damiao-motor, Seeed |
/// | [`J8006`](Self::J8006) | 12.5 | 45 | 40 | damiao-motor, Seeed |
/// | [`J8009`](Self::J8009) | 12.5 | 45 | 54 | damiao-motor, Seeed |
/// | [`J10010`](Self::J10010) | 12.5 | 20 | 200 | damiao-motor, Seeed |
/// | [`J10010L`](Self::J10010L) | 12.5 | 25 | 200 | damiao-motor, Seeed |
/// | [`H3510`](Self::H3510) | 12.5 | 280 | 1 | damiao-motor |
/// | [`H6215`](Self::H6215) | 12.5 | 45 | 10 | damiao-motor, as G6215 |
///
/// The table has the values at delivery. A drive may have other settings, so a motor reads its registers before arming, and is not
/// armed where they differ: a torque would be wrong by the quotient.
///
/// # Examples
/// ```
/// use drivetrain::error::ConfigError;
/// use drivetrain::damiao::Model;
///
/// assert_eq!((Model::J8009.name(), Model::J8009.tmax_nm()), ("DM-J8009", 54.0));
/// let mine = Model::new("DM-S2325", 12.5, 200.0, 10.0)?;
/// assert_eq!(mine.vmax_rad_per_s(), 200.0);
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Model {
    name: &'static str,
    ranges: Ranges,
}

models! {
    J3507 "DM-J3507" 12.566 50.0 5.0;
    J4310 "DM-J4310" 12.5 30.0 10.0;
    J4310P "DM-J4310P" 12.5 50.0 10.0;
    J4340 "DM-J4340" 12.5 10.0 28.0;
    J4340P "DM-J4340P" 12.5 10.0 28.0;
    J6006 "DM-J6006" 12.5 45.0 20.0;
    J8006 "DM-J8006" 12.5 45.0 40.0;
    J8009 "DM-J8009" 12.5 45.0 54.0;
    J10010 "DM-J10010" 12.5 20.0 200.0;
    J10010L "DM-J10010L" 12.5 25.0 200.0;
    H3510 "DM-H3510" 12.5 280.0 1.0;
    H6215 "DM-H6215" 12.5 45.0 10.0;
}

mit_model!(4_095);

impl Model {
    /// Describes a model missing from the table, or a drive with other settings: its registers PMAX in rad, VMAX in rad/s
    /// and TMAX in Nm.
    ///
    /// # Errors
    /// [`ConfigError::Range`] names the first range not between 0.001 and 1000000.
    pub const fn new(
        name: &'static str,
        pmax_rad: f32,
        vmax_rad_per_s: f32,
        tmax_nm: f32,
    ) -> Result<Self, ConfigError> {
        match Ranges::new(pmax_rad, vmax_rad_per_s, tmax_nm) {
            Ok(ranges) => Ok(Self { name, ranges }),
            Err(error) => Err(error),
        }
    }

    const fn known(name: &'static str, pmax: f32, vmax: f32, tmax: f32) -> Self {
        Self { name, ranges: Ranges::of([pmax, vmax, tmax], [500.0, 5.0]) }
    }
}
