// On the web page of the repository the links of a chapter lead to pages, here to modules: of two definitions the first counts.
#![doc = "[1]: first_motor"]
#![doc = "[2]: angle"]
#![doc = "[3]: chassis"]
#![doc = "[4]: two_buses"]
#![doc = "[5]: faults"]
#![doc = "[6]: pilot"]
#![doc = "[7]: board"]
#![doc = include_str!("../docs/guide/README.md")]

#[doc = "[2]: angle"]
#[doc = include_str!("../docs/guide/1-first-motor.md")]
pub mod first_motor {}

#[doc = "[3]: chassis"]
#[doc = include_str!("../docs/guide/2-angle.md")]
pub mod angle {}

#[doc = "[4]: two_buses"]
#[doc = "[5]: faults"]
#[doc = include_str!("../docs/guide/3-chassis.md")]
pub mod chassis {}

#[doc = "[5]: faults"]
#[doc = include_str!("../docs/guide/4-two-buses.md")]
pub mod two_buses {}

#[doc = "[1]: first_motor"]
#[doc = "[4]: two_buses"]
#[doc = "[6]: pilot"]
#[doc = include_str!("../docs/guide/5-faults.md")]
pub mod faults {}

#[doc = "[4]: two_buses"]
#[doc = "[7]: board"]
#[doc = include_str!("../docs/guide/6-pilot.md")]
pub mod pilot {}

#[doc = "[3]: chassis"]
#[doc = "[5]: faults"]
#[doc = include_str!("../docs/guide/7-board.md")]
pub mod board {}

pub mod chinese {
    #![doc = "[1]: first_motor"]
    #![doc = "[2]: angle"]
    #![doc = "[3]: chassis"]
    #![doc = "[4]: two_buses"]
    #![doc = "[5]: faults"]
    #![doc = "[6]: pilot"]
    #![doc = "[7]: board"]
    #![doc = include_str!("../docs/guide/zh-CN/README.md")]

    #[doc = "[2]: angle"]
    #[doc = include_str!("../docs/guide/zh-CN/1-first-motor.md")]
    pub mod first_motor {}

    #[doc = "[3]: chassis"]
    #[doc = include_str!("../docs/guide/zh-CN/2-angle.md")]
    pub mod angle {}

    #[doc = "[4]: two_buses"]
    #[doc = "[5]: faults"]
    #[doc = include_str!("../docs/guide/zh-CN/3-chassis.md")]
    pub mod chassis {}

    #[doc = "[5]: faults"]
    #[doc = include_str!("../docs/guide/zh-CN/4-two-buses.md")]
    pub mod two_buses {}

    #[doc = "[1]: first_motor"]
    #[doc = "[4]: two_buses"]
    #[doc = "[6]: pilot"]
    #[doc = include_str!("../docs/guide/zh-CN/5-faults.md")]
    pub mod faults {}

    #[doc = "[4]: two_buses"]
    #[doc = "[7]: board"]
    #[doc = include_str!("../docs/guide/zh-CN/6-pilot.md")]
    pub mod pilot {}

    #[doc = "[3]: chassis"]
    #[doc = "[5]: faults"]
    #[doc = include_str!("../docs/guide/zh-CN/7-board.md")]
    pub mod board {}
}
