// A link of the README that leads to a page on the web page of the repository, and here to a module.
#![cfg_attr(doc, doc = "[guide]: guide")]
#![doc = include_str!("../README.md")]
#![no_std]
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(any(test, feature = "std"))]
extern crate std;

/// The examples of the pages in `docs/`, and of the Chinese ones.
#[cfg(doctest)]
mod pages {
    #[doc = include_str!("../README.zh-CN.md")]
    mod chinese {}
    #[doc = include_str!("../docs/coming-from.md")]
    mod coming_from {}
    #[doc = include_str!("../docs/coming-from.zh-CN.md")]
    mod coming_from_chinese {}
    #[doc = include_str!("../docs/gains.md")]
    mod gains {}
    #[doc = include_str!("../docs/motors.md")]
    mod motors {}
    #[doc = include_str!("../docs/robot.md")]
    mod robot {}
}

#[cfg(any(doc, doctest))]
pub mod guide;

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
