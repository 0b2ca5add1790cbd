//! Listens to the motors, or drives them.

use crate::adapter::Adapter;
use crate::arguments;
use crate::console;
use crate::options::{HELP, Options, parse};
use crate::outlet::Outlet;
use drivetrain::chassis::{Mecanum, MecanumWheels};
use drivetrain::control::PidConfig;
use drivetrain::dji::{
    AnyHandle, AttachError, Bus, Config, Gm6020Current, Gm6020Voltage, M2006, M3508,
};
use drivetrain::geometry::Twist;
use drivetrain::motor::{ArmError, Condition, Link, VelocityDrive};
use drivetrain::runner::{Nb, Runner};
use drivetrain::time::{Clock, Duration, Instant, ManualClock, Tick};
use drivetrain::units::AngularVelocity;
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGTERM, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1,
    SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use std::error::Error;
use std::fs::File;
use std::io::{self, BufRead};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Gentle limits for a first try: amperes of M3508 and M2006, volts of GM6020.
const M3508_SPEED: PidConfig = PidConfig::new(1.9, 2.4, 0.0).with_output_limit(6.0);
const M2006_SPEED: PidConfig = PidConfig::new(0.15, 1.5, 0.0).with_output_limit(3.0);
const GM6020_SPEED: PidConfig = PidConfig::new(1.0, 5.0, 0.0).with_output_limit(10.0);
const GM6020_CURRENT_SPEED: PidConfig = PidConfig::new(0.1, 1.0, 0.0).with_output_limit(1.0);

/// What is usually sent to a program and would end it or halt it, and the last current would stand. SIGHUP is that of a
/// terminal which is closed (`nohup` does not help against it), SIGTSTP is Ctrl-Z, SIGTTOU of a terminal that takes nothing
/// from the background.
const SIGNALS: [i32; 14] = [
    SIGINT, SIGTERM, SIGQUIT, SIGHUP, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGALRM,
    SIGVTALRM, SIGPROF, SIGIO, SIGXCPU,
];

/// When all is over, it may take this long until the motors are seen to have their zeros.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(5);

/// Texts that wait for a reader.
const ROOM: usize = 64;

/// Attaches all of them. In a chassis the motors on the right side are reversed.
fn attach(bus: &mut Bus, options: &Options) -> Result<Vec<AnyHandle>, Box<dyn Error>> {
    let attached = options.motors.iter().map(|(model, id)| {
        let right = options.twist.is_some() && matches!(id, 1 | 4);
        let done: Result<AnyHandle, AttachError> = match model.as_str() {
            "m3508" => {
                let config = Config::<M3508>::new(*id).speed_loop(M3508_SPEED);
                bus.attach(if right { config.reversed() } else { config }).map(Into::into)
            }
            "m2006" => {
                bus.attach(Config::<M2006>::new(*id).speed_loop(M2006_SPEED)).map(Into::into)
            }
            "gm6020" => bus
                .attach(Config::<Gm6020Voltage>::new(*id).speed_loop(GM6020_SPEED))
                .map(Into::into),
            "gm6020-current" => bus
                .attach(Config::<Gm6020Current>::new(*id).speed_loop(GM6020_CURRENT_SPEED))
                .map(Into::into),
            other => return Err(format!("no model {other}; --help lists them").into()),
        };
        Ok(done?)
    });
    attached.collect()
}

/// The speed of every motor.
fn speeds(options: &Options, motors: &[AnyHandle]) -> Result<Vec<AngularVelocity>, Box<dyn Error>> {
    let Some([x, y, w]) = options.twist else {
        return Ok(vec![AngularVelocity::from_rpm(options.rpm); motors.len()]);
    };
    let wheels = (1..=4).map(|id| ("m3508".to_string(), id));
    if !wheels.eq(options.motors.iter().cloned()) {
        return Err("--mecanum needs --motors m3508:1-4".into());
    }
    let (wheel_radius_m, front_left_m) = options.geometry;
    let speeds = Mecanum::new(wheel_radius_m, front_left_m)?.inverse(Twist::new(x, y, w));
    let MecanumWheels { front_left, front_right, rear_left, rear_right } = speeds;
    // Ids 1 to 4, as DJI counts them: from the front right, counter-clockwise.
    Ok(vec![front_right, front_left, rear_left, rear_right])
}

pub(crate) fn main() -> Result<ExitCode, Box<dyn Error>> {
    let options = parse(arguments::of("socketcan"));
    let Some(options) = options.unwrap_or_else(|message| arguments::refuse("socketcan", message))
    else {
        console::line(format_args!("{HELP}"));
        return Ok(ExitCode::SUCCESS);
    };
    let end = End::new()?;
    if options.lock_step {
        let clock = ManualClock::new(Instant::from_micros(1_000_000));
        let mut steps = io::stdin().lock();
        let pause = || clock.advance(Duration::from_millis(1));
        let next = || matches!(steps.skip_until(b'\n'), Ok(1..));
        return Session::new(&options, &clock)?.run(&options, &end, next, pause);
    }
    let start = std::time::Instant::now();
    let clock = move || Instant::START + Duration::from(start.elapsed());
    let pause = || std::thread::sleep(std::time::Duration::from_micros(200));
    let next = || start.elapsed().as_secs() < options.seconds;
    Session::new(&options, clock)?.run(&options, &end, next, pause)
}

/// A signal asks for an end with zeros; where nothing may move, it does what it does to any program.
struct End {
    is_asked_for: Arc<AtomicBool>,
    is_safe: Arc<AtomicBool>,
}

impl End {
    fn new() -> io::Result<Self> {
        let end = Self { is_asked_for: Arc::default(), is_safe: Arc::new(true.into()) };
        for signal in SIGNALS {
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&end.is_safe))?;
            signal_hook::flag::register(signal, Arc::clone(&end.is_asked_for))?;
        }
        // A file that may grow no more is an error of its writer's then.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        Ok(end)
    }

    fn is_safe(&self, is_safe: bool) {
        self.is_safe.store(is_safe, Ordering::Relaxed);
    }
}

struct Session<K> {
    runner: Runner<Nb<Adapter>, K, Bus>,
    motors: Vec<AnyHandle>,
    speeds: Vec<AngularVelocity>,
    armed_once: bool,
    /// Why it is not armed yet.
    refusal: Option<ArmError>,
    /// Standard error: each thing is said at once.
    errors: Outlet,
    has_failed: bool,
}

impl<K: Clock> Session<K> {
    fn new(options: &Options, clock: K) -> Result<Self, Box<dyn Error>> {
        let mut bus = Bus::new();
        let motors = attach(&mut bus, options)?;
        let speeds = speeds(options, &motors)?;
        let log = options
            .log
            .as_ref()
            .map(|file| File::create(file).map_err(|error| format!("--log {file}: {error}")));
        let port = Adapter::open(options, log.transpose()?).map_err(|error| {
            let interface = &options.interface;
            format!(
                "cannot open {interface}: {error}; does `ip link` show it, and is it up? See --help"
            )
        })?;
        Ok(Self {
            runner: Runner::new(Nb(port), clock, bus),
            motors,
            speeds,
            armed_once: false,
            refusal: None,
            errors: Outlet::new("standard error", io::stderr(), ROOM)?,
            has_failed: false,
        })
    }

    /// Runs until `next` or a signal ends it, a motor is lost, or the reader of what it says is gone, and ends with zeros. In each
    /// `pause` some time passes.
    fn run(
        mut self,
        options: &Options,
        end: &End,
        mut next: impl FnMut() -> bool,
        mut pause: impl FnMut(),
    ) -> Result<ExitCode, Box<dyn Error>> {
        let mut out = Outlet::new("standard output", io::stdout(), ROOM)?;
        end.is_safe(false);
        let (mut ticks, mut goes_on) = (0_u64, true);
        while goes_on && next() && !end.is_asked_for.load(Ordering::Relaxed) {
            pause();
            while self.runner.poll(64) == 64 {}
            let Some(tick) = self.runner.due() else { continue };
            ticks += 1;
            if options.arm {
                goes_on = self.drive(tick);
            } else {
                self.listen(tick);
            }
            if options.lock_step {
                goes_on &= out.offer(".\n".into());
            } else if ticks.is_multiple_of(500) {
                goes_on &= out.offer(self.state(options));
            }
        }
        if options.arm {
            self.relax(options, end, pause);
        }
        end.is_safe(true);
        let report = self.state(options) + &self.report(out.lost());
        let Self { runner, mut errors, mut has_failed, .. } = self;
        let (Nb(port), ..) = runner.into_parts();
        let mut say = |text| say(&mut errors, text);
        let (said, logged) = (out.finish(report, &mut say), port.finish(&mut say));
        for error in [said, logged].into_iter().filter_map(Result::err) {
            say(error);
            has_failed = true;
        }
        errors.finish(String::new(), |_| {})?;
        Ok(if has_failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
    }

    fn fail(&mut self, text: String) {
        say(&mut self.errors, text);
        self.has_failed = true;
    }

    /// Arms once, when all motors are heard, and returns whether that lasts: what was lost stays relaxed, and one wheel that was
    /// lost stops them all.
    fn drive(&mut self, tick: Tick) -> bool {
        if !self.armed_once {
            self.refusal = self.runner.arm(tick).err();
            self.armed_once = self.refusal.is_none();
        }
        for (motor, speed) in self.motors.iter().zip(&self.speeds) {
            _ = self.runner.device_mut().drive([(*motor, *speed)]);
        }
        self.runner.tick(tick);
        let mut changes = Vec::new();
        while let Some(edge) = self.runner.device_mut().next_edge() {
            if edge.began && edge.condition == Condition::SecondMaster {
                say(&mut self.errors, format!("{edge}: another program or board commands it too"));
            }
            changes.push(edge.to_string());
        }
        changes.extend(self.runner.edges().map(|edge| edge.to_string()));
        let is_lost = self.armed_once && !self.runner.is_armed();
        if is_lost {
            self.fail(format!("all stop: {}", changes.join(", ")));
        }
        !is_lost
    }

    /// Keeps the state up to date and sends nothing.
    fn listen(&mut self, tick: Tick) {
        self.runner.device_mut().update(tick);
        while self.runner.device_mut().next_frame().is_some() {}
    }

    /// Zeros at once, and then as keep-alives, each 10 ms, in case some are lost; waits where they may not have arrived.
    fn relax(&mut self, options: &Options, end: &End, mut pause: impl FnMut()) {
        let begun = std::time::Instant::now();
        self.runner.device_mut().disarm();
        let (mut good, mut bad) = (0, 0);
        while good < 30 {
            pause();
            while self.runner.poll(64) == 64 {}
            let Some(tick) = self.runner.due() else { continue };
            self.runner.tick(tick);
            let Some(doubt) = self.doubt(options) else {
                good += 1;
                continue;
            };
            good = 0;
            bad += 1;
            if bad == 30 {
                say(&mut self.errors, format!("{doubt}: cut the battery"));
            }
            if bad == 300 {
                end.is_safe(true);
            }
            if begun.elapsed() > PATIENCE {
                return self.fail(format!(
                    "{doubt}, and the last command may stand. Cut the battery, and have `ip link set {} down` empty \
                     the queue before it is back",
                    options.interface
                ));
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    /// Why some motor may not have its zero. Who is not heard may not have it; who is heard may still not, where only sending
    /// fails. Step by step nobody is heard, as no more steps come.
    fn doubt(&mut self, options: &Options) -> Option<String> {
        if !self.runner.port_mut().0.is_at_zero() {
            return Some(format!("{} takes no zeros", options.interface));
        }
        let is_asked = self.armed_once && !options.lock_step;
        let bus = self.runner.device();
        let is_heard = |motor| bus.state(motor).is_some_and(|state| state.link == Link::Online);
        let (_, name) = bus.motors().find(|(motor, _)| is_asked && !is_heard(*motor))?;
        Some(format!("{name} is not heard"))
    }

    fn state(&self, options: &Options) -> String {
        let bus = self.runner.device();
        let motors = bus.motors().map(|(motor, name)| match bus.state(motor) {
            Some(state) => format!(
                "{} {:?}: {:8.1} rpm, {:6.2} A, position {:.3} turns, {}\n",
                state.motor,
                state.link,
                state.velocity.as_rpm(),
                state.current.as_amperes(),
                state.position.as_turns(),
                state.error.map_or("no error".to_string(), |error| error.to_string())
            ),
            None => format!("{name} is not heard\n"),
        });
        let why = match self.refusal {
            Some(refusal) => format!("not armed: {refusal}\n"),
            None if options.asks_for_motion && !options.arm => {
                "nothing is sent without --arm\n".into()
            }
            None => String::new(),
        };
        motors.chain([why]).collect()
    }

    fn report(&mut self, unread: u32) -> String {
        let (s, bus) = (self.runner.statistics(), self.runner.device().counters());
        let counts = [
            ("received", s.received),
            ("taken", s.taken),
            ("unrelated", s.unrelated),
            ("malformed", s.malformed),
            ("receive_errors", s.receive_errors.total()),
            ("bad_length", bus.bad_length),
            ("bad_field", bus.bad_field),
            ("unattached", bus.unattached),
            ("packed", bus.packed),
            ("superseded", s.superseded),
            ("offered", s.offered),
            ("sent", s.sent),
            ("refused", s.refused),
            ("send_errors", s.send_errors.total()),
            ("bus_losses", s.bus_losses),
            ("unread", unread),
        ];
        counts.iter().map(|(name, count)| format!("{name} {count}\n")).collect()
    }
}

fn say(errors: &mut Outlet, text: String) {
    _ = errors.offer(format!("socketcan: {text}\n"));
}
