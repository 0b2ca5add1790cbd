//! The motors that a command line names, as in `m3508:1-4,damiao4310:1:0x11`: one syntax for the examples and the bench.

use drivetrain::odrive::Firmware;
use drivetrain::{damiao, lk, rmd, robstride};

/// The models, for the help of a program.
pub(crate) const MODELS: &str = "\
m2006 or c610, m3508 or c620, gm6020, gm6020-current; damiao and the number of the model, as in
                    damiao4310:1-4; mf9025-16t, mf9025-35t, mg4005e-i10, mg5010e-i10; rmd-x8-90 and others of MyActuator;
                    rs00 to rs06, cybergear; odrive0.5, odrive0.6; vesc and the number of pole pairs, as in vesc7:23; the
                    shaft of the two last is that of the motor. A third part is the master id of a Damiao (default: that
                    of the motor and 0x10) or the host id of a RobStride (default: 0xFD), as in damiao4310:1:0x11";

/// The model of a motor, by its family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Model {
    M3508,
    M2006,
    Gm6020,
    Gm6020Current,
    Damiao(damiao::Model),
    Lk(lk::Model),
    Rmd(rmd::Model),
    RobStride(robstride::Model),
    Odrive(Firmware),
    /// A VESC, by the pole pairs of its motor.
    Vesc(u8),
}

/// A motor as the command line names it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spec {
    pub(crate) model: Model,
    pub(crate) id: u8,
    /// The master id of a Damiao, or the host id of a RobStride, if it is named.
    pub(crate) host: Option<u16>,
}

impl Model {
    /// Finds the model that is called `name`.
    fn named(name: &str) -> Option<Self> {
        let is = |other: &str| other.eq_ignore_ascii_case(name);
        Some(match name {
            "m2006" | "c610" => Self::M2006,
            "m3508" | "c620" => Self::M3508,
            "gm6020" | "gm6020-voltage" => Self::Gm6020,
            "gm6020-current" => Self::Gm6020Current,
            "odrive0.5" => Self::Odrive(Firmware::V0_5),
            "odrive0.6" => Self::Odrive(Firmware::V0_6),
            _ => {
                let vesc = name.strip_prefix("vesc").and_then(|poles| poles.parse().ok());
                let lk = || lk::Model::ALL.iter().find(|model| is(model.name()));
                let rmd = || rmd::Model::ALL.iter().find(|model| is(model.name()));
                let robstride = || robstride::Model::ALL.iter().find(|model| is(model.name()));
                return (vesc.map(Self::Vesc))
                    .or_else(|| damiao(name).map(Self::Damiao))
                    .or_else(|| lk().copied().map(Self::Lk))
                    .or_else(|| rmd().copied().map(Self::Rmd))
                    .or_else(|| robstride().copied().map(Self::RobStride));
            }
        })
    }
}

/// Finds a model of Damiao by a name such as `damiao4310` or `damiaoh6215`.
fn damiao(name: &str) -> Option<damiao::Model> {
    let number = name.strip_prefix("damiao")?.to_ascii_uppercase();
    let is_called = |model: &&damiao::Model| {
        let name = model.name().trim_start_matches("DM-");
        name == number || name.trim_start_matches('J') == number
    };
    damiao::Model::ALL.iter().find(is_called).copied()
}

/// Reads a list such as `m3508:1-4,damiao4310:1:0x11`.
///
/// # Errors
/// Names the item and its fault.
pub(crate) fn parse(list: &str) -> Result<Vec<Spec>, String> {
    let mut motors = Vec::new();
    for item in list.split(',').map(str::trim) {
        motors.extend(specs(item).map_err(|error| format!("--motors {item}: {error}"))?);
    }
    Ok(motors)
}

/// Reads one item of the list.
fn specs(item: &str) -> Result<impl Iterator<Item = Spec>, String> {
    const EXAMPLE: &str = "as in m3508:1-4";
    let (name, ids) = item.split_once(':').ok_or(format!("not model:ids, {EXAMPLE}"))?;
    let (ids, host) = match ids.split_once(':') {
        Some((ids, host)) => (ids, Some(host)),
        None => (ids, None),
    };
    let (first, last) = ids.split_once('-').unwrap_or((ids, ids));
    let id = |text| number(text).and_then(|id| u8::try_from(id).ok());
    let (first, last) = (id(first).zip(id(last)))
        .filter(|(first, last)| first <= last)
        .ok_or(format!("{ids} is no id or range of ids, {EXAMPLE}"))?;
    let name = name.trim().to_ascii_lowercase();
    let model = Model::named(&name).ok_or(format!("no model {name}; --help lists them"))?;
    let host = match (host, model) {
        (None, _) => None,
        (Some(text), Model::Damiao(_) | Model::RobStride(_)) => Some(
            number(text).ok_or(format!("{text} is no id of a host, as in damiao4310:1:0x11"))?,
        ),
        (Some(text), _) => return Err(format!("{name} has no host id: what is {text}?")),
    };
    Ok((first..=last).map(move |id| Spec { model, id, host }))
}

/// Reads a number in decimal or, with `0x`, in hexadecimal digits.
fn number(text: &str) -> Option<u16> {
    let text = text.trim();
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u16::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_names_families_ids_and_hosts() {
        let motors =
            parse("c620:1-2, damiao4310:0x1:0x11,rs02:7:0xFE,vesc7:23,rmd-x8-90:3").unwrap();
        let spec = |model, id, host| Spec { model, id, host };
        assert_eq!(
            motors,
            [
                spec(Model::M3508, 1, None),
                spec(Model::M3508, 2, None),
                spec(Model::Damiao(damiao::Model::J4310), 1, Some(0x11)),
                spec(Model::RobStride(robstride::Model::RS02), 7, Some(0xFE)),
                spec(Model::Vesc(7), 23, None),
                spec(Model::Rmd(rmd::Model::X8_90), 3, None),
            ]
        );
    }

    #[test]
    fn a_wrong_list_says_which_item_and_why() {
        for (list, message) in [
            ("m3508:1,m3508", "--motors m3508: not model:ids"),
            ("m3508:4-1", "--motors m3508:4-1: 4-1 is no id or range of ids"),
            ("m3508:1-300", "1-300 is no id"),
            ("servo:1", "no model servo"),
            ("m3508:1:0x11", "m3508 has no host id: what is 0x11?"),
            ("damiao4310:1:0x1G", "0x1G is no id of a host"),
        ] {
            let error = parse(list).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
