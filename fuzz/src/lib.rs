//! What the fuzz targets share: the oracle, and how bytes become input.

mod alone;
mod clock;
mod controllers;
mod drive;
mod gesture;
mod input;
mod motors;
mod split;
mod watched;

pub use alone::words;
pub use clock::Clock;
pub use controllers::Observed;
pub use drive::Drive;
pub use gesture::Gesture;
pub use input::Input;
pub use motors::{COUNT, Target};
pub use split::{any_split_gives_the_same, refuses_a_flipped_bit};
pub use watched::Watched;
