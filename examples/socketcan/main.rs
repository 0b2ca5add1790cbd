//! DJI motors or a mecanum chassis from a PC, with any CAN adapter that Linux knows (SocketCAN). Nothing is sent without
//! `--arm`.
//!
//! ```text
//! sudo ip link set can0 up type can bitrate 1000000
//! cargo run --release --example socketcan -- --interface can0 --motors m3508:1-4
//! cargo run --release --example socketcan -- --interface can0 --motors m3508:1 --rpm 30 --seconds 5 --arm
//! ```
//!
//! The interface's queue is short and the kernel says so with an error of its own: [`adapter`] is what that takes.

#[cfg(target_os = "linux")]
mod adapter;
#[cfg(target_os = "linux")]
#[path = "../arguments/mod.rs"]
mod arguments;
#[cfg(target_os = "linux")]
#[path = "../console/mod.rs"]
mod console;
#[cfg(target_os = "linux")]
mod options;
#[cfg(target_os = "linux")]
mod outlet;
#[cfg(target_os = "linux")]
mod session;

#[cfg(not(target_os = "linux"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    Err("SocketCAN is a part of Linux: this example does nothing elsewhere".into())
}

#[cfg(target_os = "linux")]
fn main() -> std::process::ExitCode {
    use std::io::Write;

    match session::main() {
        Ok(code) => code,
        Err(error) => {
            _ = writeln!(std::io::stderr(), "socketcan: {error}");
            std::process::ExitCode::FAILURE
        }
    }
}
