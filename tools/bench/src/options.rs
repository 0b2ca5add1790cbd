//! Options of the command line.

use crate::motors::{self, Spec};
use drivetrain::geometry::Vec2;
use lexopt::prelude::*;

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Command {
    Window,
    Scan,
    Watch,
    Spin,
    Tune,
    Identify,
    Record,
    Replay,
    Get(String),
    Set(String, f32),
    SetId(u8),
}

/// What carries the frames.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Source {
    Simulator,
    Interface(String),
    Serial(String),
    Recording(String),
}

/// What was asked for.
#[derive(Debug, Clone)]
pub(crate) struct Options {
    pub(crate) command: Command,
    pub(crate) source: Source,
    pub(crate) motors: Vec<Spec>,
    pub(crate) rpm: Option<f32>,
    pub(crate) twist: Option<[f32; 3]>,
    /// Wheel radius and place of the front left wheel, in m.
    pub(crate) geometry: (f32, Vec2),
    pub(crate) seconds: Option<f32>,
    pub(crate) arm: bool,
    pub(crate) asks: bool,
    pub(crate) json: bool,
    pub(crate) logs: Vec<(&'static str, String)>,
    pub(crate) output: Option<String>,
    pub(crate) amplitude: Option<f32>,
    pub(crate) hysteresis: Option<f32>,
    /// The way of `identify` to either side.
    pub(crate) turns: Option<f32>,
    pub(crate) seed: u64,
    /// For tests: a millisecond for each line on standard input, answered by a line.
    pub(crate) lock_step: bool,
    /// The simulator stands, and moves on by keys.
    pub(crate) held: bool,
}

/// A run, or the help for one.
#[derive(Debug)]
pub(crate) enum Asked {
    Run(Box<Options>),
    Help,
}

const WHEEL_RADIUS_M: f32 = 0.076;
const FRONT_LEFT_M: Vec2 = Vec2::new(0.20, 0.18);

/// Reads the arguments.
///
/// # Errors
/// Says what makes no sense.
pub(crate) fn parse(arguments: Vec<std::ffi::OsString>) -> Result<Asked, String> {
    let mut parser = lexopt::Parser::from_args(arguments);
    let mut words: Vec<String> = Vec::new();
    let (mut list, mut geometry, mut help) = (None, None, false);
    let mut options = Options {
        command: Command::Window,
        source: Source::Simulator,
        motors: Vec::new(),
        rpm: None,
        twist: None,
        geometry: (WHEEL_RADIUS_M, FRONT_LEFT_M),
        seconds: None,
        arm: false,
        asks: false,
        json: false,
        logs: Vec::new(),
        output: None,
        amplitude: None,
        hysteresis: None,
        turns: None,
        seed: 1,
        lock_step: false,
        held: false,
    };
    while let Some(argument) = parser.next().map_err(text)? {
        match argument {
            Short('h') | Long("help") => help = true,
            Long("arm") => options.arm = true,
            Long("ask") => options.asks = true,
            Long("json") => options.json = true,
            Long("lock-step") => options.lock_step = true,
            Long("held") => options.held = true,
            Long("interface") => options.source = Source::Interface(value(&mut parser)?),
            Long("serial") => options.source = Source::Serial(value(&mut parser)?),
            Long("replay") => options.source = Source::Recording(value(&mut parser)?),
            Long("motors") => list = Some(value(&mut parser)?),
            Long("log") => options.logs.push(("--log", value(&mut parser)?)),
            Long("output") => options.output = Some(value(&mut parser)?),
            Long("rpm") => options.rpm = Some(finite("--rpm", &value(&mut parser)?)?),
            Long("amplitude") => {
                options.amplitude = Some(above_zero("--amplitude", &value(&mut parser)?)?)
            }
            Long("hysteresis") => {
                options.hysteresis = Some(above_zero("--hysteresis", &value(&mut parser)?)?);
            }
            Long("turns") => options.turns = Some(above_zero("--turns", &value(&mut parser)?)?),
            Long("seconds") => {
                options.seconds = Some(above_zero("--seconds", &value(&mut parser)?)?)
            }
            Long("seed") => {
                let text = value(&mut parser)?;
                options.seed = text.parse().map_err(|_| format!("--seed {text}: not a number"))?;
            }
            Long("mecanum") => options.twist = Some(three("--mecanum", &value(&mut parser)?)?),
            Long("geometry") => {
                let [radius_m, half_wheelbase_m, half_track_m] =
                    three("--geometry", &value(&mut parser)?)?;
                geometry = Some((radius_m, Vec2::new(half_wheelbase_m, half_track_m)));
            }
            Value(word) => words.push(
                word.into_string().map_err(|word| format!("the argument {word:?} is not UTF-8"))?,
            ),
            Long(option) => return Err(format!("no option --{option}; --help lists them")),
            Short(option) => return Err(format!("no option -{option}; --help lists them")),
        }
    }
    if help {
        return Ok(Asked::Help);
    }
    options.command = command(&words, &mut options)?;
    if options.turns.is_some() && !matches!(options.command, Command::Identify | Command::Window) {
        return Err("--turns is of identify: nothing else has a limit of the way".into());
    }
    match options.twist {
        Some(_) if options.rpm.is_some() => return Err("--rpm or --mecanum, not both".into()),
        None if geometry.is_some() => return Err("--geometry needs --mecanum".into()),
        _ => {}
    }
    options.geometry = geometry.unwrap_or(options.geometry);
    let usual = match options.source {
        Source::Simulator if options.twist.is_none() => "m3508:1-2,gm6020:5,damiao4310:1",
        _ => "m3508:1-4",
    };
    options.motors = motors::parse(list.as_deref().unwrap_or(usual))?;
    Ok(Asked::Run(Box::new(options)))
}

/// Finds the command among the words.
fn command(words: &[String], options: &mut Options) -> Result<Command, String> {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    Ok(match words.as_slice() {
        [] => Command::Window,
        ["scan"] => Command::Scan,
        ["watch"] => Command::Watch,
        ["spin"] => Command::Spin,
        ["tune"] => Command::Tune,
        ["identify"] => Command::Identify,
        ["record"] if options.output.is_some() => {
            options.logs.extend(options.output.take().map(|path| ("--output", path)));
            Command::Record
        }
        ["record"] => return Err("record needs --output FILE".into()),
        ["replay", file] => {
            options.source = Source::Recording((*file).to_owned());
            Command::Replay
        }
        ["replay"] => return Err("replay needs a file".into()),
        ["get", register] => Command::Get((*register).to_owned()),
        ["set", register, value] => Command::Set((*register).to_owned(), finite("set", value)?),
        ["set-id", id] => {
            Command::SetId(id.parse().map_err(|_| format!("set-id {id}: not an id from 0 to 255"))?)
        }
        [word, ..] => {
            return Err(format!("no command {word} with these arguments; --help lists them"));
        }
    })
}

fn value(parser: &mut lexopt::Parser) -> Result<String, String> {
    parser
        .value()
        .map_err(text)?
        .into_string()
        .map_err(|value| format!("the argument {value:?} is not UTF-8"))
}

/// Neither NaN nor infinity.
fn finite(option: &str, text: &str) -> Result<f32, String> {
    let value: f32 = text.trim().parse().map_err(|_| format!("{option} {text}: not a number"))?;
    if value.is_finite() { Ok(value) } else { Err(format!("{option} {text}: not finite")) }
}

fn above_zero(option: &str, text: &str) -> Result<f32, String> {
    let value = finite(option, text)?;
    if value > 0.0 { Ok(value) } else { Err(format!("{option} {text}: not above zero")) }
}

/// Reads `0.2,0,0`.
fn three(option: &str, text: &str) -> Result<[f32; 3], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|part| finite(option, part)).collect();
    <[f32; 3]>::try_from(numbers?).map_err(|_| format!("{option} takes three numbers"))
}

fn text(error: impl ToString) -> String {
    error.to_string()
}

/// Returns the options of a call without arguments.
#[cfg(test)]
pub(crate) fn usual() -> Options {
    match parse(Vec::new()) {
        Ok(Asked::Run(options)) => *options,
        other => panic!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(line: &str) -> Result<Options, String> {
        match parse(line.split_whitespace().map(Into::into).collect())? {
            Asked::Run(options) => Ok(*options),
            Asked::Help => Err("the help".into()),
        }
    }

    #[test]
    fn without_arguments_a_simulated_robot_is_shown() {
        let options = parsed("").unwrap();
        assert_eq!((options.command, options.source), (Command::Window, Source::Simulator));
        assert_eq!(options.motors.len(), 4);
        assert!(!options.arm);
    }

    #[test]
    fn options_take_a_value_with_and_without_an_equals_sign() {
        for line in ["spin --seconds=2.5 --rpm=-30", "spin --seconds 2.5 --rpm -30"] {
            let options = parsed(line).unwrap();
            assert_eq!((options.seconds, options.rpm), (Some(2.5), Some(-30.0)), "{line}");
        }
        let options = parsed("--interface can1 watch").unwrap();
        assert_eq!(options.source, Source::Interface("can1".into()));
        assert_eq!((options.command, options.motors.len()), (Command::Watch, 4));
    }

    #[test]
    fn each_option_with_a_value_takes_it_in_both_ways() {
        for (option, value) in [
            ("--interface", "can1"),
            ("--serial", "/dev/ttyACM0"),
            ("--replay", "a.log"),
            ("--motors", "m2006:3"),
            ("--log", "a.mcap"),
            ("--output", "a.log"),
            ("--rpm", "-30"),
            ("--amplitude", "2"),
            ("--hysteresis", "0.3"),
            ("--turns", "0.5"),
            ("--seconds", "5"),
            ("--seed", "7"),
            ("--mecanum", "0.2,0,0"),
        ] {
            let [apart, together] = [' ', '='].map(|sign| {
                let options = parsed(&format!("{option}{sign}{value}")).unwrap();
                format!("{options:?}")
            });
            assert_eq!(apart, together);
            assert_ne!(apart, format!("{:?}", usual()), "{option} changes nothing");
            assert!(crate::help::text().contains(option), "{option} is not in the help");
        }
    }

    #[test]
    fn what_makes_no_sense_is_said() {
        for (line, message) in [
            ("spin --rpm 9 --mecanum 1,0,0", "--rpm or --mecanum, not both"),
            ("spin --geometry 1,1,1", "--geometry needs --mecanum"),
            ("spin --rpm NaN", "--rpm NaN: not finite"),
            ("spin --seconds 0", "--seconds 0: not above zero"),
            ("identify --turns 0", "--turns 0: not above zero"),
            ("spin --turns 1", "--turns is of identify: nothing else has a limit of the way"),
            ("spin --mecanum 1,0", "--mecanum takes three numbers"),
            ("spin --motors servo:1", "no model servo"),
            ("dance", "no command dance"),
            ("record", "record needs --output FILE"),
            ("set-id 300", "set-id 300: not an id"),
            ("--fast", "no option --fast"),
            ("--interface", "missing argument"),
            ("tune --help", "the help"),
        ] {
            let error = parsed(line).unwrap_err();
            assert!(error.contains(message), "{line}: {error}");
        }
    }
}
