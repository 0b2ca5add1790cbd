//! What the command line asks for.

use drivetrain::geometry::Vec2;

pub(crate) const HELP: &str = "\
usage: socketcan [--interface NAME] [--motors LIST] [--rpm N | --mecanum X,Y,W [--geometry R,L,B]] [--seconds S] [--arm]
                 [--log FILE]

Shows DJI motors on a CAN interface of Linux, and with --arm drives them. Lift the wheels first, and keep the switch of the
battery at hand: nobody sends zeros where this program is killed or halted by force, the PC hangs, the adapter is pulled
out, or the bus takes no frames. Keep the interface's txqueuelen at 10: whether a longer queue sent its last zeros cannot be
told from here.

  --interface NAME  the interface (default: can0); bring it up before:
                    sudo ip link set can0 up type can bitrate 1000000
  --motors LIST     model:ids, models m3508 or c620 (at most 6 A here), m2006 or c610 (3 A), gm6020 (10 V) and
                    gm6020-current (1 A, once it is switched on in the motor); default: m3508:1-4. All of them have to be
                    there for --arm, and when one is lost all stop
  --rpm N           speed of every output shaft (default: 0, they hold still)
  --mecanum X,Y,W   m/s ahead, m/s to the left, rad/s counter-clockwise; needs m3508:1-4 as front right,
                    front left, rear left and rear right
  --geometry R,L,B  radius of the wheels, half of the wheelbase and half of the track in m (default: 0.076,0.2,0.18)
  --seconds S       how long, a whole number (default: 5); Ctrl-C and Ctrl-Z end it as well, with zeros
  --arm             send commands; without it nothing is sent
  --log FILE        every frame in the form of candump -L";

const WHEEL_RADIUS_M: f32 = 0.076;
const FRONT_LEFT_M: Vec2 = Vec2::new(0.20, 0.18);

pub(crate) struct Options {
    pub(crate) interface: String,
    pub(crate) motors: Vec<(String, u8)>,
    pub(crate) rpm: f32,
    pub(crate) twist: Option<[f32; 3]>,
    /// Wheel radius and place of the front left wheel, in m.
    pub(crate) geometry: (f32, Vec2),
    pub(crate) seconds: u64,
    pub(crate) arm: bool,
    /// By `--rpm` or `--mecanum`.
    pub(crate) asks_for_motion: bool,
    pub(crate) log: Option<String>,
    /// For tests: a millisecond for each line on standard input, answered by a line.
    pub(crate) lock_step: bool,
}

fn number<T: std::str::FromStr>(option: &str, text: &str) -> Result<T, String> {
    text.trim().parse().map_err(|_| format!("{option} {text}: not a number that it can be"))
}

/// Neither NaN nor infinity.
fn finite(option: &str, text: &str) -> Result<f32, String> {
    let value: f32 = number(option, text)?;
    if value.is_finite() { Ok(value) } else { Err(format!("{option} {text}: not finite")) }
}

/// Reads `0.2,0,0`.
fn three(option: &str, text: &str) -> Result<[f32; 3], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|part| finite(option, part)).collect();
    <[f32; 3]>::try_from(numbers?).map_err(|_| format!("{option} takes three numbers"))
}

pub(crate) fn parse(
    mut arguments: impl Iterator<Item = String>,
) -> Result<Option<Options>, String> {
    let mut options = Options {
        interface: "can0".into(),
        motors: motors("m3508:1-4")?,
        rpm: 0.0,
        twist: None,
        geometry: (WHEEL_RADIUS_M, FRONT_LEFT_M),
        seconds: 5,
        arm: false,
        asks_for_motion: false,
        log: None,
        lock_step: false,
    };
    let (mut rpm, mut geometry) = (None, None);
    while let Some(option) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{option} needs a value"));
        match option.as_str() {
            "-h" | "--help" => return Ok(None),
            "--arm" => options.arm = true,
            "--lock-step" => options.lock_step = true,
            "--interface" => options.interface = value()?,
            "--log" => options.log = Some(value()?),
            "--motors" => options.motors = motors(&value()?)?,
            "--rpm" => rpm = Some(finite("--rpm", &value()?)?),
            "--seconds" => options.seconds = number("--seconds", &value()?)?,
            "--mecanum" => options.twist = Some(three("--mecanum", &value()?)?),
            "--geometry" => {
                let [wheel_radius_m, half_wheelbase_m, half_track_m] =
                    three("--geometry", &value()?)?;
                geometry = Some((wheel_radius_m, Vec2::new(half_wheelbase_m, half_track_m)));
            }
            _ => return Err(format!("no option {option}; --help lists them")),
        }
    }
    match options.twist {
        Some(_) if rpm.is_some() => return Err("--rpm or --mecanum, not both".into()),
        None if geometry.is_some() => return Err("--geometry needs --mecanum".into()),
        _ => {}
    }
    options.asks_for_motion = rpm.is_some() || options.twist.is_some();
    options.rpm = rpm.unwrap_or(options.rpm);
    options.geometry = geometry.unwrap_or(options.geometry);
    Ok(Some(options))
}

/// Reads `m3508:1-4,gm6020:5`.
fn motors(list: &str) -> Result<Vec<(String, u8)>, String> {
    let mut motors = Vec::new();
    for item in list.split(',') {
        let refused =
            || format!("--motors {item}: not model:id or model:first-last, as in m3508:1-4");
        let (model, ids) = item.split_once(':').ok_or_else(refused)?;
        let (first, last) = ids.split_once('-').unwrap_or((ids, ids));
        let id = |text: &str| text.trim().parse::<u8>().map_err(|_| refused());
        let (first, last) = (id(first)?, id(last)?);
        if first > last {
            return Err(refused());
        }
        let model = match model.trim().to_ascii_lowercase().as_str() {
            "c620" => "m3508".to_string(),
            "c610" => "m2006".to_string(),
            model => model.to_string(),
        };
        motors.extend((first..=last).map(|id| (model.clone(), id)));
    }
    Ok(motors)
}
