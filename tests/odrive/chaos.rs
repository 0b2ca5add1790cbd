//! Random losses of frames, resets, errors, targets and requests to arm: a torque needs an armed motor, the mode and the limits.

use crate::bench::{Bench, GEAR, torque};
use drivetrain::motor::{AngleDrive, Devices, VelocityDrive};
use drivetrain::odrive::{Firmware, Heartbeat, Mode, Model};
use drivetrain::units::{Angle, AngularVelocity};

/// xorshift
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

#[derive(Default)]
struct Seen {
    driven: u32,
    wrong: u32,
    resets: u32,
    armed: u32,
}

fn run(
    seed: u64,
    firmware: Firmware,
    mode: impl Into<Mode>,
    modes: (u32, u32),
    limit_nm: f32,
    set: fn(&mut Bench, f32),
    seen: &mut Seen,
) {
    let mode = mode.into();
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let mut bench = Bench::new(mode, firmware);
    let (mut until, mut cut_until, mut sets) = (0, 0, true);
    // How long the motor has been disarmed, and the axis in closed loop with other modes or limits, on a bus that was whole.
    let (mut calm, mut wrong) = (0, 0);
    for step in 0..4_000_u64 {
        match random.below(1_500) {
            0 => {
                bench.lost = Some(if random.below(2) == 0 { 1 } else { 9 });
                until = step + random.below(700);
            }
            1 => cut_until = step + random.below(60),
            2 => {
                bench.drive.lose_supply();
                seen.resets += 1;
            }
            3 if random.below(3) == 0 => bench.drive.fail(0x40),
            4..8 => bench.own.motor_mut().clear_errors(),
            8 => bench.own.disarm(),
            9 => Devices::emergency_stop(&mut bench.own),
            10..13 => sets = !sets,
            13..30 => {
                Devices::clear_emergency_stop(&mut bench.own);
                let now = bench.now();
                seen.armed += u32::from(bench.own.arm(now).is_ok());
            }
            30 => bench.drive.refuse(14),
            31..34 => bench.drive.refuse(0),
            _ => {}
        }
        if step >= until {
            bench.lost = None;
        }
        bench.is_cut = step < cut_until;
        if sets {
            set(&mut bench, if step % 1_000 < 500 { 1.0 } else { -0.5 });
        }
        bench.step();
        let torque_nm = bench.drive.shaft().torque_nm();
        let is_armed = Devices::is_armed(&mut bench.own);
        calm = if is_armed || bench.is_cut { 0 } else { calm + 1 };
        let place = format!("{firmware:?} {mode:?}, seed {seed}, step {step}: {torque_nm} Nm");
        assert!(calm < 3 || torque_nm == 0.0, "{place}");
        let (_, amperes) = bench.drive.limits();
        let most_nm = amperes * Model::D6374.torque_constant() * GEAR;
        let is_closed = bench.drive.state() == Heartbeat::CLOSED_LOOP;
        let is_right = bench.drive.modes() == modes && most_nm <= limit_nm * 1.001;
        wrong = if is_closed && !is_right && !bench.is_cut { wrong + 1 } else { 0 };
        assert!(wrong < 130, "{place}: {:?}, at most {most_nm} Nm", bench.drive.modes());
        if torque_nm != 0.0 {
            assert!(is_closed, "{place}");
            assert!(wrong > 0 || torque_nm.abs() <= limit_nm * 1.001 || bench.is_cut, "{place}");
            seen.wrong += u32::from(wrong > 0);
            seen.driven += 1;
        }
    }
}

#[test]
fn a_torque_needs_an_armed_motor_its_mode_and_its_limits_whatever_gets_lost() {
    let mut seen = Seen::default();
    for seed in 1..=25 {
        for firmware in [Firmware::V0_5, Firmware::V0_6] {
            run(
                seed,
                firmware,
                torque(),
                (1, 1),
                3.0,
                |bench, share| _ = bench.own.set_torque(share),
                &mut seen,
            );
            run(
                seed,
                firmware,
                Mode::velocity(2.0),
                (2, 1),
                2.0,
                |bench, share| {
                    let target = AngularVelocity::from_rad_per_s(5.0 * share);
                    _ = bench.own.set_velocity((), target);
                },
                &mut seen,
            );
            run(
                seed,
                firmware,
                Mode::position(2.0),
                (3, 1),
                2.0,
                |bench, share| _ = bench.own.set_angle((), Angle::from_radians(share)),
                &mut seen,
            );
        }
    }
    let Seen { driven, wrong, resets, armed } = seen;
    assert!(wrong < driven / 200, "{wrong} of {driven}");
    assert!(driven > 10_000 && resets > 200 && armed > 200, "{driven} {resets} {armed}");
}
