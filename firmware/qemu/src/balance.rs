//! The rows of a robot that balances: a leg of five bars, and an update of the whole controller.

use crate::meter::{CALLS, instructions};
use crate::report::row;
use core::hint::black_box;
use drivetrain::chassis::{BalanceModel, BalancePhase, Balancer, FiveBar, LegEffort, LegState};
use drivetrain::geometry::{Attitude, Rotation3};
use drivetrain::units::{Angle, AngularVelocity};

#[unsafe(no_mangle)]
#[inline(never)]
fn chassis_five_bar(
    leg: &FiveBar,
    angles: [Angle; 2],
    rates: [AngularVelocity; 2],
    torques_nm: [f32; 2],
) -> Option<LegState> {
    leg.state(angles, rates, torques_nm)
}

#[unsafe(no_mangle)]
#[inline(never)]
fn chassis_balancer(
    robot: &mut Balancer,
    attitude: Option<&Attitude>,
    legs: Option<[LegState; 2]>,
    wheels: [AngularVelocity; 2],
) -> Option<[LegEffort; 2]> {
    robot.update(attitude, legs, wheels)
}

const MODEL: BalanceModel = BalanceModel {
    wheel_radius_m: 0.075,
    wheel_kg: 0.8,
    wheel_kg_m2: 0.0045,
    leg_kg: 1.1,
    leg_kg_m2: 0.012,
    leg_centre: 0.6,
    body_kg: 14.0,
    body_kg_m2: 0.25,
    body_height_m: 0.03,
};
const DT_S: f32 = 0.001;

pub fn rows() {
    let leg = black_box(FiveBar::new(0.075, 0.15, 0.27).unwrap());
    let angles = leg.angles(0.25, 0.02).unwrap();
    let rates = [0.3, -0.2].map(AngularVelocity::from_rad_per_s);
    let each = |state: fn(&FiveBar, [Angle; 2], [AngularVelocity; 2], [f32; 2]) -> _, call| {
        let turned = Angle::from_radians(0.1 * call as f32 / CALLS as f32);
        _ = black_box(state(&leg, [angles[0] + turned, angles[1]], rates, [5.0, -5.0]));
    };
    row("five_bar", &[instructions(chassis_five_bar as _, each)]);

    let mut robot = Balancer::new(&black_box(MODEL), [0.14, 0.36], [10.0, 50.0], DT_S).unwrap();
    let mut state = leg.state(angles, rates, [5.0, -5.0]).unwrap();
    state.force_n = 70.0;
    let wheels = [AngularVelocity::from_rad_per_s(0.5); 2];
    let attitude = |call: u32| {
        let pitch = Angle::from_radians(0.05 * call as f32 / CALLS as f32);
        let rotation = Rotation3::from_roll_pitch_yaw(Angle::ZERO, pitch, Angle::ZERO);
        Attitude { rotation, rates: [AngularVelocity::from_rad_per_s(0.1); 3] }
    };
    robot.start();
    let level = attitude(0);
    // At its goal, the length of the legs: then it stands.
    robot.set_length(state.length_m);
    for _ in 0..2_000 {
        _ = robot.update(Some(&level), Some([state; 2]), [AngularVelocity::ZERO; 2]);
    }
    assert!(robot.phase() == BalancePhase::Standing);
    let each = |update: fn(&mut Balancer, Option<&Attitude>, Option<[LegState; 2]>, _) -> _,
                call| {
        _ = black_box(update(&mut robot, Some(&attitude(call)), Some([state; 2]), wheels));
    };
    row("balancer", &[instructions(chassis_balancer as _, each)]);
    assert!(robot.phase() == BalancePhase::Standing);
}
