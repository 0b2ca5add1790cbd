//! Controllers against sequences that `tests/data/control/generate.py` computed independently, in double precision.

#![cfg(test)]

use drivetrain::control::{
    Biquad, Differentiator, LoadObserver, LowPass, MotionLimits, Pid, PidConfig, Profile,
    TuningRule, fhan,
};
use drivetrain::time::TimeStep;

/// The rows of a file, each with its cells; what is not a number is NaN.
fn rows(csv: &'static str) -> impl Iterator<Item = (&'static str, Vec<f32>)> {
    csv.lines().skip(1).map(|line| {
        let name = line.split(',').next().unwrap_or_default();
        (name, line.split(',').map(|cell| cell.parse().unwrap_or(f32::NAN)).collect())
    })
}

#[track_caller]
fn assert_close(actual: f32, expected: f32, tolerance: f32, what: &str) {
    let allowed = tolerance * expected.abs().max(1.0);
    assert!((actual - expected).abs() <= allowed, "{what}: {actual} instead of {expected}");
}

fn controller(case: &str) -> Option<Pid> {
    let pid = PidConfig::new;
    let config = match case {
        "plain" => pid(2.0, 15.0, 0.01),
        "output_limit" => pid(4.0, 40.0, 0.01).with_output_limit(1.5),
        "output_range" => pid(4.0, 40.0, 0.0).with_output_range(-0.25, 1.5),
        "integral_limit" => pid(1.0, 40.0, 0.0).with_integral_limit(0.5),
        "back_calculation" => {
            pid(4.0, 40.0, 0.01).with_output_limit(1.5).with_back_calculation(0.02)
        }
        "without_anti_windup" => pid(4.0, 40.0, 0.01).with_output_limit(1.5).without_anti_windup(),
        "integral_separation" => pid(2.0, 30.0, 0.0).with_integral_separation(0.6),
        "variable_integral" => pid(2.0, 30.0, 0.0).with_variable_integral(0.2, 0.8),
        "dead_band" => pid(2.0, 30.0, 0.0).with_dead_band(0.1),
        "feed_forward" => pid(1.0, 5.0, 0.0).with_feed_forward(0.2, 0.7),
        "slew_limit" => pid(2.0, 15.0, 0.0).with_slew_limit(20.0),
        "derivative_filter" => pid(2.0, 15.0, 0.02).with_derivative_filter(40.0),
        "derivative_on_error" => pid(2.0, 15.0, 0.005).with_derivative_on_error(),
        "circle" => pid(0.05, 0.2, 0.001).with_period(360.0),
        "together" => pid(4.0, 30.0, 0.02)
            .with_output_range(-1.5, 2.0)
            .with_integral_limit(1.0)
            .with_integral_separation(0.9)
            .with_variable_integral(0.2, 0.8)
            .with_dead_band(0.02)
            .with_feed_forward(0.1, 0.3)
            .with_slew_limit(60.0)
            .with_period(8.0)
            .with_derivative_filter(80.0)
            .with_back_calculation(0.05),
        "incremental" => pid(2.0, 15.0, 0.01).with_incremental_form(),
        "incremental_limit" => pid(4.0, 40.0, 0.01).with_output_limit(1.5).with_incremental_form(),
        "incremental_tracking" => pid(2.0, 15.0, 0.0).with_tracking(60.0).with_incremental_form(),
        _ => return None,
    };
    Pid::new(config).ok()
}

#[test]
fn pid_with_each_option_alone_and_all_together() {
    let mut running = ("", None);
    let mut cases = 0;
    for (case, row) in rows(include_str!("data/control/pid.csv")) {
        if running.0 != case {
            running = (case, controller(case));
            cases += 1;
        }
        let output = match &mut running.1 {
            Some(pid) => pid.step(row[1], row[2], &TimeStep::of(row[3])),
            None => f32::NAN,
        };
        assert_close(output, row[4], 5e-5, case);
    }
    assert_eq!(cases, 18);
}

#[test]
fn fhan_in_the_form_of_the_paper() {
    for (_, row) in rows(include_str!("data/control/fhan.csv")) {
        assert_close(
            fhan(row[0], row[1], row[2], row[3]) / row[2],
            row[4] / row[2],
            1e-4,
            "fhan / r",
        );
    }
}

#[test]
fn tracking_differentiators() {
    let mut optimal = Differentiator::optimal(50.0, 0.006, 0.002).unwrap();
    let mut linear = Differentiator::linear(80.0, 0.002).unwrap();
    for (_, row) in rows(include_str!("data/control/differentiator.csv")) {
        assert_close(optimal.update(row[0], 0.002), row[1], 1e-4, "optimal");
        assert_close(optimal.rate(), row[2], 2e-3, "optimal rate");
        assert_close(linear.update(row[0], 0.002), row[3], 1e-4, "linear");
        assert_close(linear.rate(), row[4], 1e-3, "linear rate");
    }
}

#[test]
fn biquad_impulse_responses() {
    let mut running: Option<((&str, f32, f32), Biquad)> = None;
    for (kind, row) in rows(include_str!("data/control/biquad.csv")) {
        let key = (kind, row[1], row[2]);
        let mut input = 0.0;
        if running.is_none_or(|(at, _)| at != key) {
            let made = match kind {
                "low_pass" => Biquad::low_pass(row[1], row[2], 1000.0),
                _ => Biquad::notch(row[1], row[2], 1000.0),
            };
            let mut filter = made.unwrap();
            filter.reset_to(0.0);
            running = Some((key, filter));
            input = 1.0;
        }
        if let Some((_, filter)) = &mut running {
            assert_close(filter.update(input), row[3], 2e-6, kind);
        }
    }
}

#[test]
fn low_pass_with_a_time_step_that_varies() {
    let mut filter = LowPass::new(30.0).unwrap();
    for (_, row) in rows(include_str!("data/control/low_pass.csv")) {
        assert_close(filter.update(row[0], row[1]), row[2], 2e-6, "low pass");
    }
}

#[test]
fn profiles_up_down_short_and_overlong() {
    let mut compared = 0;
    for (_, row) in rows(include_str!("data/control/profile.csv")) {
        let mut limits = MotionLimits::new(row[2], row[3]);
        if row[4] > 0.0 {
            limits = limits.with_jerk(row[4]);
        }
        let profile = Profile::plan(row[0], row[1], &limits).unwrap();
        let state = profile.at(row[5]);
        assert_close(profile.duration_s(), row[6], 1e-6, "duration");
        // The position where the time in f32 is a spacing off.
        let late = row[5] * 1e-6 * row[2];
        assert_close(state.position, row[7], 1e-6 + late, "position");
        assert_close(state.velocity, row[8], 1e-5 + row[5] * 1e-6 * row[3], "speed");
        if row[9].is_nan() {
            continue; // where the acceleration jumps
        }
        assert_close(state.acceleration, row[9], 1e-4 + row[5] * 1e-6 * row[4], "acceleration");
        compared += 1;
    }
    assert!(compared > 300, "{compared}");
}

#[test]
fn gains_by_the_rules_of_the_papers() {
    let mut compared = 0;
    for (name, row) in rows(include_str!("data/control/tuning.csv")) {
        let rule = match name {
            "ZieglerNicholsP" => TuningRule::ZieglerNicholsP,
            "ZieglerNicholsPi" => TuningRule::ZieglerNicholsPi,
            "ZieglerNicholsPid" => TuningRule::ZieglerNicholsPid,
            "TyreusLuybenPi" => TuningRule::TyreusLuybenPi,
            _ => TuningRule::TyreusLuybenPid,
        };
        assert_eq!(format!("{rule:?}"), name);
        let (kp, ki, kd) = rule.pid(row[1], row[2]).gains();
        assert_close(kp, row[3], 1e-6, name);
        assert_close(ki, row[4], 1e-6, name);
        assert_close(kd, row[5], 1e-6, name);
        compared += 1;
    }
    assert_eq!(compared, 10);
}

/// The sequence is that of python-control, which placed the poles and simulated the estimator: `data/observer/compute.py`.
#[test]
fn load_observer_by_python_control() {
    let mut running: Option<((f32, f32), LoadObserver)> = None;
    let mut compared = 0;
    for (_, row) in rows(include_str!("data/observer/observer.csv")) {
        let key = (row[0], row[1]);
        running = running.filter(|(at, _)| *at == key);
        let (_, observer) =
            running.get_or_insert_with(|| (key, LoadObserver::new(row[0], row[1]).unwrap()));
        observer.update(row[4], row[3], row[2]);
        assert_close(observer.velocity_rad_per_s(), row[5], 1e-5, "speed");
        assert_close(observer.load_nm(), row[6], 5e-5, "load");
        compared += 1;
    }
    assert_eq!(compared, 340);
}
