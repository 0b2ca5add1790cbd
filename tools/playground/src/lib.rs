//! A simulated robot under the hands of somebody who has never seen a CAN bus.
//!
//! ```text
//! page.rs        the functions that JavaScript calls
//!   └─ session.rs    one robot in its world: knobs, faults, time, what the page shows
//!        ├─ robot.rs     the program of the robot, for each layout: the page shows this file
//!        ├─ delay.rs     a driver whose frames arrive late
//!        └─ snapshot.rs  the numbers and frames of one picture
//! ```

mod delay;
#[cfg(target_arch = "wasm32")]
mod page;
mod robot;
mod session;
mod snapshot;
pub mod tour;

pub use robot::{Layout, Watchdogs};
pub use session::{Knob, Session, Setup, Trouble};
