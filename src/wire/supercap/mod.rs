//! Controllers of super-capacitors: the payload of their CAN frames.
//!
//! A controller stands between the supply of the referee system and the chassis. The controller draws the commanded power from
//! the supply: surplus power charges the capacitor, and missing power comes from the capacitor.
//!
//! | module | controller | told | tells |
//! |---|---|---|---|
//! | [`hkust`] | HKUST Enterprize, 2024 | switch, power limit, buffer energy | energy, errors, power of the chassis |
//! | [`pacific_spirit`] | Pacific Spirit (UBC), 2024 | power to take from the supply | energy, state, power of the supply |
//!
//! Teams assign ids of their own, so these modules only name the usual ids, which collide with no motor of [`dji`](crate::dji)
//! (`0x1FE` to `0x20B`, `0x2FE`, `0x2FF`). No frame has a checksum except the CRC of CAN. Keep each state with its time of
//! arrival, and give [`chassis::CapacitorPlan`](crate::chassis::CapacitorPlan) no energy when the state is too old:
//!
//! ```
//! use drivetrain::chassis::CapacitorPlan;
//! use drivetrain::frame::CanFrame;
//! use drivetrain::time::{Duration, Instant};
//! use drivetrain::wire::supercap::hkust;
//!
//! let ms = |ms| Instant::START + Duration::from_millis(ms);
//! // From the CAN driver: no error, 55 W, 180 W allowed, 204/255 of the energy.
//! let frame = CanFrame::standard(0x051, [0, 0, 0, 0x5C, 0x42, 180, 0, 204]).ok_or("no id")?;
//! let mut heard = None;
//! if let Some(state) = hkust::decode(&frame) {
//!     heard = Some((state, ms(0)));
//! }
//! let energy = |now: Instant| {
//!     let fresh = heard.filter(|(_, at)| now.since(*at) <= Duration::from_millis(100));
//!     fresh.and_then(|(state, _)| state.energy())
//! };
//! assert!(energy(ms(100)).is_some_and(|share| (share - 0.8).abs() < 1e-6));
//!
//! let plan = CapacitorPlan::new(2_000.0, 600.0)?.with_most_w(150.0)?; // J, J, W
//! assert_eq!(plan.allowance_w(80.0, energy(ms(100)), true), 230.0);
//! assert_eq!(plan.allowance_w(80.0, energy(ms(101)), true), 80.0); // too old
//!
//! let command = hkust::command(true, 80, 60);
//! assert_eq!(command, [1, 80, 0, 60, 0, 0, 0, 0]); // to 0x061
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

pub mod hkust;
pub mod pacific_spirit;
