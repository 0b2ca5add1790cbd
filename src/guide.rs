#![cfg_attr(not(doctest), doc = include_str!("../docs/site.txt"))]
#![doc = include_str!("../docs/guide/README.md")]

use crate::pages::modules;

modules! {
    first_motor: "../docs/guide/1-first-motor.md",
    angle: "../docs/guide/2-angle.md",
    chassis: "../docs/guide/3-chassis.md",
    two_buses: "../docs/guide/4-two-buses.md",
    faults: "../docs/guide/5-faults.md",
    pilot: "../docs/guide/6-pilot.md",
    board: "../docs/guide/7-board.md",
}

#[cfg_attr(not(doctest), doc = include_str!("../docs/site.txt"))]
#[doc = include_str!("../docs/guide/zh-CN/README.md")]
pub mod chinese {
    use crate::pages::modules;

    modules! {
        first_motor: "../docs/guide/zh-CN/1-first-motor.md",
        angle: "../docs/guide/zh-CN/2-angle.md",
        chassis: "../docs/guide/zh-CN/3-chassis.md",
        two_buses: "../docs/guide/zh-CN/4-two-buses.md",
        faults: "../docs/guide/zh-CN/5-faults.md",
        pilot: "../docs/guide/zh-CN/6-pilot.md",
        board: "../docs/guide/zh-CN/7-board.md",
    }
}
