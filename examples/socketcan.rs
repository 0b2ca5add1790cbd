//! DJI motors or a mecanum chassis from a PC, with any CAN adapter that Linux knows (SocketCAN). Nothing is sent without
//! `--arm`.
//!
//! ```text
//! sudo ip link set can0 up type can bitrate 1000000
//! cargo run --release --example socketcan -- --interface can0 --motors m3508:1-4
//! cargo run --release --example socketcan -- --interface can0 --motors m3508:1 --rpm 30 --seconds 5 --arm
//! ```
//!
//! The interface's queue is short and the kernel says so with an error of its own: [`linux::Adapter`] is what that takes.

#[cfg(not(target_os = "linux"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    Err("SocketCAN is a part of Linux: this example does nothing elsewhere".into())
}

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    linux::main()
}

#[cfg(target_os = "linux")]
mod linux {
    use drivetrain::chassis::{Mecanum, MecanumGeometry, MecanumWheels};
    use drivetrain::control::PidConfig;
    use drivetrain::dji::{AnyHandle, AttachError, Bus, Config, Gm6020Voltage, M2006, M3508};
    use drivetrain::geometry::Twist;
    use drivetrain::motor::{CanDevice, VelocityDrive};
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::time::{Clock, Duration, Instant, ManualClock, Tick};
    use drivetrain::units::AngularVelocity;
    use signal_hook::consts::{SIGINT, SIGTERM};
    use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Frame, Socket, SocketOptions};
    use std::error::Error;
    use std::fs::File;
    use std::io::{self, BufRead, BufWriter, Write};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    const HELP: &str = "\
usage: socketcan [--interface NAME] [--motors LIST] [--rpm N | --mecanum X,Y,W] [--seconds S] [--arm] [--log FILE]

Shows DJI motors on a CAN interface of Linux, and with --arm drives them. Lift the wheels first.

  --interface NAME  the interface (default: can0); bring it up before:
                    sudo ip link set can0 up type can bitrate 1000000
  --motors LIST     model:ids, models m3508, m2006 and gm6020 (default: m3508:1-4)
  --rpm N           speed of every output shaft (default: 0, they hold still)
  --mecanum X,Y,W   m/s ahead, m/s to the left, rad/s counter-clockwise; needs m3508:1-4 as front right,
                    front left, rear left and rear right
  --seconds S       how long (default: 5); Ctrl-C ends it as well, with zeros
  --arm             send commands; without it nothing is sent
  --log FILE        every frame in the form of candump -L
  --lock-step       for tests: a millisecond for each line on standard input, answered by a line";

    /// Gentle limits for a first try: amperes of M3508 and M2006, volts of GM6020.
    const M3508_SPEED: PidConfig = PidConfig::new(0.6, 6.0, 0.0).with_output_limit(6.0);
    const M2006_SPEED: PidConfig = PidConfig::new(0.15, 1.5, 0.0).with_output_limit(3.0);
    const GM6020_SPEED: PidConfig = PidConfig::new(1.0, 5.0, 0.0).with_output_limit(10.0);
    /// Yours will differ.
    const GEOMETRY: MecanumGeometry =
        MecanumGeometry { wheel_radius_m: 0.076, half_wheelbase_m: 0.20, half_track_m: 0.18 };

    /// A SocketCAN socket as the crate wants a driver.
    ///
    /// The socket's own implementation of `embedded-can` takes a full queue (`ENOBUFS`) for a failure; here it is a refusal,
    /// and the newest command is offered again. It also writes the log.
    pub(crate) struct Adapter {
        socket: CanSocket,
        interface: String,
        log: Option<BufWriter<File>>,
        start: std::time::Instant,
    }

    impl Adapter {
        fn open(options: &Options) -> io::Result<Self> {
            let socket = CanSocket::open(&options.interface)?;
            socket.set_nonblocking(true)?;
            // Bus errors are counted by kind.
            socket.set_error_filter_accept_all()?;
            let log = options.log.as_ref().map(File::create).transpose()?.map(BufWriter::new);
            let start = std::time::Instant::now();
            Ok(Self { socket, interface: options.interface.clone(), log, start })
        }

        /// The form of `candump -L`.
        fn record(&mut self, frame: &CanFrame) -> io::Result<()> {
            let Some(log) = &mut self.log else { return Ok(()) };
            write!(log, "({:.6}) {} ", self.start.elapsed().as_secs_f64(), self.interface)?;
            match frame {
                CanFrame::Error(_) => write!(log, "{:08X}#", frame.id_word())?,
                _ if frame.is_extended() => write!(log, "{:08X}#", frame.raw_id())?,
                _ => write!(log, "{:03X}#", frame.raw_id())?,
            }
            if frame.is_remote_frame() {
                return match frame.dlc() {
                    0 => writeln!(log, "R"),
                    length => writeln!(log, "R{length}"),
                };
            }
            frame.data().iter().try_for_each(|byte| write!(log, "{byte:02X}"))?;
            writeln!(log)
        }
    }

    impl embedded_can::nb::Can for Adapter {
        type Frame = CanFrame;
        type Error = socketcan::Error;

        fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, socketcan::Error> {
            const ENOBUFS: i32 = 105;
            match self.socket.write_frame(frame) {
                Ok(()) => {
                    self.record(frame).map_err(socketcan::Error::from)?;
                    Ok(None)
                }
                Err(error) if error.raw_os_error() == Some(ENOBUFS) => Err(nb::Error::WouldBlock),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    Err(nb::Error::WouldBlock)
                }
                Err(error) => Err(nb::Error::Other(error.into())),
            }
        }

        fn receive(&mut self) -> nb::Result<CanFrame, socketcan::Error> {
            let frame = match self.socket.read_frame() {
                Ok(frame) => frame,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    return Err(nb::Error::WouldBlock);
                }
                Err(error) => return Err(nb::Error::Other(error.into())),
            };
            self.record(&frame).map_err(socketcan::Error::from)?;
            match frame {
                CanFrame::Error(frame) => Err(nb::Error::Other(frame.into())),
                frame => Ok(frame),
            }
        }
    }

    struct Options {
        interface: String,
        motors: Vec<(String, u8)>,
        rpm: f32,
        twist: Option<[f32; 3]>,
        seconds: u64,
        arm: bool,
        log: Option<String>,
        lock_step: bool,
    }

    fn number<T: std::str::FromStr>(option: &str, text: &str) -> Result<T, String> {
        text.trim().parse().map_err(|_| format!("{option} {text}: not a number"))
    }

    fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Option<Options>, String> {
        let mut options = Options {
            interface: "can0".into(),
            motors: motors("m3508:1-4")?,
            rpm: 0.0,
            twist: None,
            seconds: 5,
            arm: false,
            log: None,
            lock_step: false,
        };
        while let Some(option) = arguments.next() {
            let mut value = || arguments.next().ok_or(format!("{option} needs a value"));
            match option.as_str() {
                "-h" | "--help" => return Ok(None),
                "--arm" => options.arm = true,
                "--lock-step" => options.lock_step = true,
                "--interface" => options.interface = value()?,
                "--log" => options.log = Some(value()?),
                "--motors" => options.motors = motors(&value()?)?,
                "--rpm" => options.rpm = number("--rpm", &value()?)?,
                "--seconds" => options.seconds = number("--seconds", &value()?)?,
                "--mecanum" => {
                    let text = value()?;
                    let parts: Result<Vec<f32>, _> =
                        text.split(',').map(|part| number("--mecanum", part)).collect();
                    let parts = <[f32; 3]>::try_from(parts?);
                    options.twist = Some(parts.map_err(|_| "--mecanum takes X,Y,W".to_string())?);
                }
                _ => return Err(format!("no option {option}; --help lists them")),
            }
        }
        Ok(Some(options))
    }

    /// Reads `m3508:1-4,gm6020:5`.
    fn motors(list: &str) -> Result<Vec<(String, u8)>, String> {
        let mut motors = Vec::new();
        for item in list.split(',') {
            let (model, ids) =
                item.split_once(':').ok_or(format!("--motors {item}: not model:ids"))?;
            let (first, last) = ids.split_once('-').unwrap_or((ids, ids));
            for id in number::<u8>("--motors", first)?..=number("--motors", last)? {
                motors.push((model.trim().to_ascii_lowercase(), id));
            }
        }
        Ok(motors)
    }

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
                other => return Err(format!("no model {other}: m3508, m2006, gm6020").into()),
            };
            Ok(done?)
        });
        attached.collect()
    }

    /// The speed of every motor.
    fn speeds(
        options: &Options,
        motors: &[AnyHandle],
    ) -> Result<Vec<AngularVelocity>, Box<dyn Error>> {
        let Some([x, y, w]) = options.twist else {
            return Ok(vec![AngularVelocity::from_rpm(options.rpm); motors.len()]);
        };
        let wheels = (1..=4).map(|id| ("m3508".to_string(), id));
        if !wheels.eq(options.motors.iter().cloned()) {
            return Err("--mecanum needs --motors m3508:1-4".into());
        }
        let speeds = Mecanum::new(GEOMETRY)?.inverse(Twist::new(x, y, w));
        let MecanumWheels { front_left, front_right, rear_left, rear_right } = speeds;
        // Ids 1 to 4, as DJI counts them: from the front right, counter-clockwise.
        Ok(vec![front_right, front_left, rear_left, rear_right])
    }

    pub(crate) fn main() -> Result<(), Box<dyn Error>> {
        let Some(options) = parse(std::env::args().skip(1))? else {
            println!("{HELP}");
            return Ok(());
        };
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&stop))?;
        }
        if options.lock_step {
            let clock = ManualClock::new(Instant::from_micros(1_000_000));
            let mut lines = io::stdin().lock().lines();
            let pause = || clock.advance(Duration::from_millis(1));
            let next = || lines.next().is_some();
            return Session::new(&options, &clock)?.run(&options, &stop, next, pause);
        }
        let start = std::time::Instant::now();
        let clock = move || Instant::START + Duration::from(start.elapsed());
        let pause = || std::thread::sleep(std::time::Duration::from_micros(200));
        let next = || start.elapsed().as_secs() < options.seconds;
        Session::new(&options, clock)?.run(&options, &stop, next, pause)
    }

    struct Session<K> {
        runner: Runner<Nb<Adapter>, K, Bus>,
        motors: Vec<AnyHandle>,
        speeds: Vec<AngularVelocity>,
        armed_once: bool,
    }

    impl<K: Clock> Session<K> {
        fn new(options: &Options, clock: K) -> Result<Self, Box<dyn Error>> {
            let mut bus = Bus::new();
            let motors = attach(&mut bus, options)?;
            let speeds = speeds(options, &motors)?;
            let port = Adapter::open(options).map_err(|error| {
                format!("cannot open {}: {error}; is it up? See --help", options.interface)
            })?;
            Ok(Self {
                runner: Runner::new(Nb(port), clock, bus),
                motors,
                speeds,
                armed_once: false,
            })
        }

        /// Runs until `next` or a signal ends it, and ends with zeros. In each `pause` some time passes.
        fn run(
            mut self,
            options: &Options,
            stop: &AtomicBool,
            mut next: impl FnMut() -> bool,
            mut pause: impl FnMut(),
        ) -> Result<(), Box<dyn Error>> {
            let mut ticks: u64 = 0;
            while next() && !stop.load(Ordering::Relaxed) {
                pause();
                while self.runner.poll(64) == 64 {}
                let Some(tick) = self.runner.due() else { continue };
                ticks += 1;
                if options.arm {
                    self.drive(tick);
                } else {
                    self.listen(tick);
                }
                if options.lock_step {
                    println!(".");
                    io::stdout().flush()?;
                } else if ticks.is_multiple_of(500) {
                    self.show();
                }
            }
            if options.arm {
                self.end(pause);
            }
            self.show();
            self.report();
            let (Nb(mut port), ..) = self.runner.into_parts();
            if let Some(log) = &mut port.log {
                log.flush()?;
            }
            Ok(())
        }

        /// Arms once, when all motors are heard: what was lost stays relaxed.
        fn drive(&mut self, tick: Tick) {
            if !self.armed_once {
                self.armed_once = self.runner.arm(tick).is_ok();
            }
            // One wheel that was lost stops them all.
            let armed = self.runner.is_armed();
            for (motor, speed) in self.motors.iter().zip(&self.speeds) {
                let speed = if armed { *speed } else { AngularVelocity::ZERO };
                _ = self.runner.device_mut().drive([(*motor, speed)]);
            }
            self.runner.tick(tick);
        }

        /// Keeps the state up to date and sends nothing.
        fn listen(&mut self, tick: Tick) {
            self.runner.device_mut().update(tick);
            while self.runner.device_mut().next_frame().is_some() {}
        }

        /// Zeros at once, and then as keep-alives, each 10 ms, in case some are lost.
        fn end(&mut self, mut pause: impl FnMut()) {
            self.runner.device_mut().disarm();
            let mut ticks = 0;
            while ticks < 30 {
                pause();
                let Some(tick) = self.runner.due() else { continue };
                self.runner.tick(tick);
                ticks += 1;
            }
        }

        fn show(&self) {
            for motor in &self.motors {
                match self.runner.device().state(*motor) {
                    Some(state) => println!(
                        "{} {:?}: {:8.1} rpm, {:6.2} A, position {:.3} turns, {}",
                        state.motor,
                        state.link,
                        state.velocity.as_rpm(),
                        state.current.as_amperes(),
                        state.position.as_turns(),
                        state.error.map_or("no error".to_string(), |error| error.to_string())
                    ),
                    None => println!("{motor:?} is not heard"),
                }
            }
        }

        fn report(&self) {
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
            ];
            counts.iter().for_each(|(name, count)| println!("{name} {count}"));
        }
    }
}
