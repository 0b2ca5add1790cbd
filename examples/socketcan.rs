//! A motor of DJI from a PC, with any CAN adapter that Linux knows (SocketCAN). Lift the wheel first.
//!
//! ```text
//! sudo ip link set can0 up type can bitrate 1000000
//! cargo run --release --example socketcan -- can0
//! ```
//!
//! It turns an M3508 with id 1 at 30 rpm for 5 s, by a current of at most 3 A. The smallest whole program: zeros also where it is
//! halted, a full queue, other motors and a record are what the bench does (`cargo run --release -p drivetrain-bench`).

#[cfg(not(target_os = "linux"))]
fn main() {}

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use drivetrain::{control::PidConfig, dji, runner, time, units::AngularVelocity};
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use socketcan::{CanSocket, Socket as _};
    use std::io::Write as _;
    use std::sync::{Arc, atomic::AtomicBool, atomic::Ordering::Relaxed};

    let interface = std::env::args_os().nth(1).ok_or("usage: socketcan INTERFACE")?;
    let socket = CanSocket::open(&interface.to_string_lossy())?;
    socket.set_nonblocking(true)?;
    let end = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, end.clone())?;
    }
    let mut bus = dji::Bus::new();
    let speed = PidConfig::new(1.9, 2.4, 0.0).with_output_limit(3.0);
    let wheel = bus.attach(dji::Config::<dji::M3508>::new(1).speed_loop(speed))?;
    let start = std::time::Instant::now();
    let clock = move || time::Instant::START + time::Duration::from(start.elapsed());
    let mut runner = runner::Runner::new(runner::Nb(socket), clock, bus);
    let (mut is_armed, mut zeros) = (false, 0);
    while zeros < 500 {
        std::thread::sleep(std::time::Duration::from_micros(200));
        runner.poll(64);
        let Some(tick) = runner.due() else { continue };
        let is_lost = is_armed && !runner.is_armed();
        if zeros > 0 || is_lost || end.load(Relaxed) || start.elapsed().as_secs() >= 5 {
            runner.device_mut().disarm();
            zeros += 1;
        } else if !is_armed {
            is_armed = runner.arm(tick).is_ok();
        }
        _ = runner.device_mut().set_velocity(wheel, AngularVelocity::from_rpm(30.0));
        runner.tick(tick);
    }
    let state = runner.device().state(wheel).ok_or("no M3508 with id 1 is heard")?;
    writeln!(std::io::stdout(), "{:.1} rpm", state.velocity.as_rpm())?;
    Ok(())
}
