use crate::base::SetupError;
use crate::pilot::Pilot;
use crate::robot::Robot;
use drivetrain::runner::{EmergencyStop, Nb};
use drivetrain::time::Clock;
use embedded_can::nb::Can;

/// The rest of a board.
pub trait Board {
    /// Waits for 250 µs, or for an interrupt. `false` ends the program: a real board never does.
    fn wait(&mut self) -> bool;
    /// Bytes that the serial port of the remote control received since the last call.
    fn remote(&mut self) -> &[u8];
    /// The same of the referee system.
    fn referee(&mut self) -> &[u8];
    /// Feeds the hardware watchdog, whose time-out is some milliseconds.
    fn feed(&mut self);
    /// Writes a line into the log.
    fn log(&mut self, line: core::fmt::Arguments<'_>);
}

/// The program: two drivers, a clock, and the rest of the board.
pub fn program<C: Can>(
    (lower, upper): (C, C),
    mut clock: impl Clock + Copy,
    stop: &'static EmergencyStop,
    board: &mut impl Board,
) -> Result<(), SetupError> {
    let mut robot = Robot::new(Nb(lower), Nb(upper), clock, stop)?;
    let mut pilot = Pilot::new()?;
    let wheels = robot.base.wheels;
    let mut fed = (0, 0);
    while board.wait() {
        let now = clock.now();
        pilot.hear_remote(board.remote(), now);
        pilot.hear_referee(board.referee(), now);
        let wish = pilot.wish(now);
        if let Some(why) = robot.step(&wish, |bus, tick| pilot.limit(bus, wheels, tick)) {
            board.log(format_args!("not armed: {why}"));
        }
        while let Some(edge) = robot.lower.device_mut().next_edge() {
            board.log(format_args!("wheels: {edge}"));
        }
        while let Some(edge) = robot.upper.device_mut().next_edge() {
            board.log(format_args!("turret: {edge}"));
        }
        // Both loops run, or the watchdog bites.
        let beats = (robot.lower.heartbeat(), robot.upper.heartbeat());
        if beats.0 != fed.0 && beats.1 != fed.1 {
            fed = beats;
            board.feed();
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::tests::motors;
    use drivetrain::sim::{Line, Simulation};
    use drivetrain::time::Duration;

    struct Simulated<'w> {
        world: &'w Simulation,
        steps: u32,
        fed: u32,
    }

    impl Board for Simulated<'_> {
        fn wait(&mut self) -> bool {
            self.world.advance(Duration::from_micros(250));
            self.steps += 1;
            self.steps <= 4_000
        }
        fn remote(&mut self) -> &[u8] {
            &[]
        }
        fn referee(&mut self) -> &[u8] {
            &[]
        }
        fn feed(&mut self) {
            self.fed += 1;
        }
        fn log(&mut self, line: core::fmt::Arguments<'_>) {
            println!("{line}");
        }
    }

    #[test]
    fn in_a_second_the_program_feeds_the_watchdog_a_thousand_times() {
        static STOP: EmergencyStop = EmergencyStop::new();
        let world = Simulation::new(1);
        motors(&world);
        let drivers = (world.controller_on(Line::Can1), world.controller_on(Line::Can2));
        let mut board = Simulated { world: &world, steps: 0, fed: 0 };
        program(drivers, world.clock(), &STOP, &mut board).unwrap();
        assert!((995..=1_000).contains(&board.fed), "{}", board.fed);
    }
}
