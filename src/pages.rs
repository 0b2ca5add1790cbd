#![doc = "The pages of the repository: design, faults, motors, tools and others. The guide is in [`guide`](crate::guide)."]

/// A module without items for each page. The first definition of a label counts: `docs/site.txt` leads to modules, and the
/// definitions at the end of a page, for the web page of a repository, lead to files. Names and lines of doctests are those of the page.
macro_rules! modules {
    ($($name:ident: $path:literal,)*) => {$(
        #[cfg_attr(not(doctest), doc = include_str!("../docs/site.txt"))]
        #[doc = include_str!($path)]
        pub mod $name {}
    )*};
}
pub(crate) use modules;

modules! {
    adding_a_family: "../docs/adding-a-family.md",
    checks: "../docs/checks.md",
    coming_from: "../docs/coming-from.md",
    contributing: "../CONTRIBUTING.md",
    design: "../DESIGN.md",
    faults: "../docs/faults.md",
    figures: "../docs/figures.md",
    gains: "../docs/gains.md",
    judged: "../docs/judged.md",
    messages: "../docs/messages.md",
    motors: "../docs/motors.md",
    porting: "../docs/porting.md",
    robot: "../docs/robot.md",
    safety: "../docs/safety.md",
    tools: "../docs/tools.md",
    virtual_board: "../docs/virtual-board.md",
}

#[cfg_attr(not(doctest), doc = include_str!("../docs/site.txt"))]
#[doc = include_str!("../README.zh-CN.md")]
pub mod chinese {
    use super::modules;

    modules! {
        coming_from: "../docs/coming-from.zh-CN.md",
        manual: "../docs/guide.zh-CN.md",
    }
}
