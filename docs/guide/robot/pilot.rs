use crate::base::Lower;
use crate::robot::Wish;
use drivetrain::chassis::{PowerBuffer, PowerModel};
use drivetrain::control::PidConfig;
use drivetrain::dji::{Bus, Handle, M3508};
use drivetrain::error::ConfigError;
use drivetrain::geometry::Twist;
use drivetrain::shooter::ShooterOrder;
use drivetrain::time::{Instant, Tick};
use drivetrain::units::{Angle, AngularVelocity};
use drivetrain::wire::dbus::{Dbus, Switch};
use drivetrain::wire::referee::Referee;

/// Remote control, referee system and power limit.
#[derive(Debug)]
pub struct Pilot {
    remote: Dbus,
    referee: Referee,
    model: PowerModel,
    buffer: PowerBuffer,
}

impl Pilot {
    pub fn new() -> Result<Self, ConfigError> {
        let spend = PidConfig::new(2.0, 0.5, 0.0).with_output_limit(120.0); // W per J
        Ok(Self {
            remote: Dbus::new(),
            referee: Referee::new(45), // W, while the referee system is silent
            // W per A and rad/s, W per A²: M3508 at 24 V
            model: PowerModel::new(0.0, 0.475, 0.065, 0.0)?,
            buffer: PowerBuffer::new(20.0, spend)?, // J
        })
    }

    /// Takes bytes of the receiver's serial port, soon after they arrived.
    pub fn hear_remote(&mut self, mut bytes: &[u8], now: Instant) {
        while self.remote.read(&mut bytes, now).is_some() {}
    }

    /// Takes bytes of the referee system's serial port.
    pub fn hear_referee(&mut self, mut bytes: &[u8], now: Instant) {
        while self.referee.read(&mut bytes, now).is_some() {}
    }

    /// Right switch up: on. Left switch: down is rest, middle spins the wheels, up shoots. Without a signal, the switch is not known.
    pub fn wish(&self, now: Instant) -> Wish {
        let remote = self.remote.remote(now);
        Wish {
            is_on: remote.right_switch.is_at(Switch::Up),
            twist: Twist::new(2.0 * remote.right_y, -2.0 * remote.right_x, -4.0 * remote.left_x),
            angle: Angle::from_degrees(180.0 - 120.0 * remote.dial),
            order: match remote.left_switch {
                Switch::Up => ShooterOrder::Fire(255),
                Switch::Middle => ShooterOrder::Spin,
                Switch::Down | Switch::Absent => ShooterOrder::Rest,
            },
            heat: self.referee.heat_17mm(now),
        }
    }

    /// Scales the currents of the wheels to the power that the referee system allows.
    pub fn limit(&mut self, bus: &mut Bus<Lower>, wheels: [Handle<M3508, Lower>; 3], tick: Tick) {
        let limit_w = self.referee.power_limit_w(tick.now());
        let charge_j = self.referee.buffer_energy_j(tick.now());
        let allowed_w = self.buffer.allowance_w(limit_w, charge_j, tick.dt_s());
        let loads = wheels.map(|wheel| {
            let current = bus.commanded_current(wheel).map_or(0.0, |current| current.as_amperes());
            (current, bus.state(wheel).map_or(AngularVelocity::ZERO, |state| state.velocity))
        });
        bus.scale_outputs(wheels, self.model.cut(loads, allowed_w).0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::tests::{motors, robot};
    use drivetrain::runner::EmergencyStop;
    use drivetrain::sim::Simulation;
    use drivetrain::time::Duration;
    use drivetrain::wire::referee::encode;

    const UP: u64 = 1;
    const DOWN: u64 = 2;
    const MIDDLE: u64 = 3;

    /// A frame of the remote control: right stick along, right and left switch.
    fn remote(along: u64, right: u64, left: u64) -> [u8; 18] {
        let bits = 1_024 | along << 11 | 1_024 << 22 | 1_024 << 33 | right << 44 | left << 46;
        let mut frame = [0; 18];
        frame[..6].copy_from_slice(&bits.to_le_bytes()[..6]);
        frame
    }

    #[test]
    fn the_pilot_drives_at_60_w_shoots_below_the_heat_limit_and_is_lost() {
        static STOP: EmergencyStop = EmergencyStop::new();
        let world = Simulation::new(1);
        let (wheels, _) = motors(&world);
        world.push_chassis(-80.0, 0.0, 0.0); // N: a hill
        let (mut robot, mut pilot) = (robot(&world, &STOP), Pilot::new().unwrap());
        let (mut buffer_j, mut heat, mut hottest, mut energy_j, mut shots) =
            (60.0, 0.0, 0.0_f32, 0.0, 0);
        for ms in 0..9_400 {
            world.advance(Duration::from_millis(1));
            let now = world.now();
            // The referee system measures, and reports ten times a second: 60 W, a heat limit of 50.
            let power = wheels.map(|wheel| world.motor(wheel).unwrap().power_w);
            let power_w: f32 = power.iter().sum();
            buffer_j = (buffer_j + (60.0 - power_w) * 0.001_f32).clamp(0.0, 60.0);
            let fired = robot.turret.shooter.shots() - shots;
            shots += fired;
            heat = (heat - 0.02 + 10.0 * fired as f32).max(0.0_f32); // cools by 20 in 1 s
            hottest = hottest.max(heat);
            if ms % 100 == 0 {
                let state = [3, 1, 200, 0, 200, 0, 20, 0, 50, 0, 60, 0, 0b111];
                let power = [0, 0, 0, 0, 0, 0, 0, 0, buffer_j as u8, 0, heat as u8, 0, 0, 0];
                pilot.hear_referee(encode(0x0201, 0, &state, &mut [0; 32]).unwrap(), now);
                pilot.hear_referee(encode(0x0202, 0, &power, &mut [0; 32]).unwrap(), now);
            }
            // The remote control sends every 14 ms, and is not heard from 8 s to 8.3 s.
            if ms % 14 == 0 && !(8_000..8_300).contains(&ms) {
                let frame = match ms {
                    ..100 => remote(1_024, DOWN, DOWN),
                    100..200 => remote(1_024, UP, DOWN),
                    200..2_000 => remote(1_684, UP, MIDDLE),
                    _ => remote(1_684, UP, UP),
                };
                pilot.hear_remote(&frame, now);
            }
            let (wish, motors) = (pilot.wish(now), robot.base.wheels);
            let refusal = robot.step(&wish, |bus, tick| pilot.limit(bus, motors, tick));
            assert!(refusal.is_none(), "{refusal:?}");
            if (5_000..8_000).contains(&ms) {
                energy_j += power_w * 0.001;
            }
        }
        let mean_w = energy_j / 3.0;
        assert!((mean_w - 60.0).abs() < 3.0, "{mean_w} W");
        assert!(hottest <= 50.0 && shots >= 8, "{hottest} after {shots} shots");
        assert!(!robot.lower.is_armed() && !robot.upper.is_armed());
    }
}
