// Where the links of the page lead on a documentation site: see `pages`.
#![cfg_attr(all(doc, not(doctest)), doc = include_str!("../docs/site.txt"))]
#![doc = include_str!("../README.md")]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(any(test, feature = "std"))]
extern crate std;

#[cfg(any(doc, doctest))]
pub mod guide;
#[cfg(any(doc, doctest))]
pub mod pages;

// F0: vocabulary
pub mod error;
pub mod frame;
pub mod math;
pub mod time;
pub mod units;

// F1: pure algorithms
pub mod control;
pub mod encoder;
pub mod geometry;
pub mod manipulator;

// F2: what every motor, every chassis and every shooter has in common; byte protocols
pub mod chassis;
pub mod motor;
pub mod shooter;
pub mod wire;

// F3: device families and their simulation
pub mod damiao;
pub mod dji;
pub mod lk;
pub mod odrive;
#[cfg(feature = "hal")]
pub mod pwm;
pub mod rmd;
pub mod robstride;
#[cfg(feature = "sim")]
pub mod sim;
pub mod snake;
pub mod vesc;

// F4: the only part that does I/O
pub mod runner;
