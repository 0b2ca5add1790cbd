//! A motor of DJI from a PC, with any CAN adapter that Linux knows (SocketCAN). Lift the wheel first.
//!
//! ```text
//! sudo ip link set can0 up type can bitrate 1000000
//! cargo run --release --example socketcan -- can0
//! ```
//!
//! It turns an M3508 with id 1 at 30 rpm for 5 s, by a current of at most 3 A. The smallest whole program: zeros also where it is
//! halted, a full queue, other motors and a record are what the bench does (`cargo run --release -p drivetrain-bench`).

#[cfg(target_os = "linux")]
#[path = "../arguments/mod.rs"]
mod arguments;
#[cfg(target_os = "linux")]
#[path = "../console/mod.rs"]
mod console;

#[cfg(not(target_os = "linux"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    Err("SocketCAN is a part of Linux: this example does nothing elsewhere".into())
}

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use drivetrain::control::PidConfig;
    use drivetrain::dji::{Bus, Config, M3508};
    use drivetrain::runner::{Nb, Runner};
    use drivetrain::time::{Duration, Instant};
    use drivetrain::units::AngularVelocity;
    use lexopt::Arg::{Long, Short, Value};
    use socketcan::{CanSocket, Socket};

    const USAGE: &str = "usage: socketcan INTERFACE";
    let mut arguments = arguments::of("socketcan");
    let interface = match arguments.next() {
        Ok(Some(Value(interface))) => interface.to_string_lossy().into_owned(),
        Ok(Some(Short('h') | Long("help"))) => {
            console::line(format_args!("{USAGE}"));
            return Ok(());
        }
        _ => arguments::refuse("socketcan", USAGE),
    };
    if !matches!(arguments.next(), Ok(None)) {
        arguments::refuse("socketcan", USAGE);
    }
    let end = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    for signal in
        [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM, signal_hook::consts::SIGHUP]
    {
        signal_hook::flag::register(signal, end.clone())?;
    }
    let socket = CanSocket::open(&interface)?;
    socket.set_nonblocking(true)?;
    let mut bus = Bus::new();
    let speed = PidConfig::new(1.9, 2.4, 0.0).with_output_limit(3.0);
    let wheel = bus.attach(Config::<M3508>::new(1).speed_loop(speed))?;
    let start = std::time::Instant::now();
    let clock = move || Instant::START + Duration::from(start.elapsed());
    let mut runner = Runner::new(Nb(socket), clock, bus);
    let (mut is_armed, mut zeros) = (false, 0);
    while zeros < 500 {
        std::thread::sleep(std::time::Duration::from_micros(200));
        runner.poll(64);
        let Some(tick) = runner.due() else { continue };
        let is_asked = end.load(std::sync::atomic::Ordering::Relaxed);
        let is_lost = is_armed && !runner.is_armed();
        if is_asked || is_lost || zeros > 0 || start.elapsed().as_secs() >= 5 {
            runner.device_mut().disarm();
            zeros += 1;
        } else if !is_armed {
            is_armed = runner.arm(tick).is_ok();
        }
        _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rpm(30.0));
        runner.tick(tick);
    }
    match runner.device().state(wheel) {
        Some(state) => console::line(format_args!(
            "{:.1} rpm, {:.2} A",
            state.velocity.as_rpm(),
            state.current.as_amperes()
        )),
        None => return Err("no M3508 with id 1 is heard".into()),
    }
    Ok(())
}
