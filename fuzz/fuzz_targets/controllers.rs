//! Controllers and filters with any gains, any samples and any steps.
#![no_main]

use drivetrain::control::{
    Biquad, Differentiator, LowPass, MotionLimits, Pid, PidConfig, PositionActuator, Profile,
    RelayTuner, SlewLimiter, SpeedActuator, StepResponse, Window,
};
use drivetrain::error::ConfigError;
use drivetrain::time::TimeStep;
use drivetrain_fuzz::{Input, Observed};
use libfuzzer_sys::fuzz_target;

const ANY: (f32, f32) = (f32::MIN, f32::MAX);

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    match input.byte() % 12 {
        0..=2 => pid(input),
        3 => speed_actuator(input),
        4 => position_actuator(input),
        5 => filters(input),
        6 => differentiators(input),
        7 => slew(input),
        8 => profile(input),
        9 => relay(input),
        10 => windows(input),
        _ => step_response(input),
    }
});

fn pid_config(input: &mut Input) -> PidConfig {
    let mut config = PidConfig::new(input.positive(), input.positive(), input.positive());
    let options = input.byte();
    for bit in 0..8 {
        if options & (1 << bit) == 0 {
            continue;
        }
        config = match (bit, input.byte() % 2) {
            (0, 0) => config.with_output_limit(input.positive()),
            (0, _) => config.with_output_range(input.float(), input.float()),
            (1, 0) => config.with_integral_limit(input.positive()),
            (1, _) => config.with_dead_band(input.positive()),
            (2, 0) => config.with_integral_separation(input.positive()),
            (2, _) => config.with_variable_integral(input.positive(), input.positive()),
            (3, 0) => config.with_back_calculation(input.positive()),
            (3, _) => config.without_anti_windup(),
            (4, 0) => config.with_dead_band(input.positive()),
            (4, _) => config.with_feed_forward(input.float(), input.float()),
            (5, 0) => config.with_slew_limit(input.positive()),
            (5, _) => config.with_period(input.positive()),
            (6, 0) => config.with_derivative_filter(input.positive()),
            (6, _) => config.with_tracking(input.positive()),
            (_, 0) => config.with_derivative_on_error(),
            _ => config.with_incremental_form(),
        };
    }
    config
}

fn pid(mut input: Input) {
    let Ok(pid) = Pid::new(pid_config(&mut input)) else { return };
    let mut pid = Observed::new(pid);
    while !input.is_empty() {
        match input.byte() {
            0..=223 => {
                let (setpoint, measured, dt_s) = (input.float(), input.float(), input.step_s());
                update(&mut pid, [setpoint, measured, dt_s]);
            }
            224..=231 => {
                let (error, rate, dt_s) = (input.float(), input.float(), input.step_s());
                let range = pid.get().config().output_range();
                let left_out = is_left_out(&[error, rate], dt_s);
                pid.step_counted(range, left_out, Pid::rejected, |pid| {
                    pid.step_error(error, rate, &TimeStep::of(dt_s))
                });
            }
            232..=237 => {
                let fresh = Pid::new(pid.get().config()).expect("it was valid");
                pid.restart(fresh);
                assert_eq!(terms(pid.get()), terms(&fresh), "I9: {pid:?}");
            }
            238..=243 => pid.restart_at(input.float()),
            244..=249 => {
                let (kp, ki, kd) = (input.positive(), input.positive(), input.positive());
                pid.forgive();
                pid.change(|pid| {
                    _ = pid.set_gains(kp, ki, kd);
                    pid.output()
                });
            }
            _ => {
                let config = pid_config(&mut input);
                pid.forgive();
                pid.change(|pid| {
                    let before = pid.output();
                    _ = pid.set_config(config);
                    assert_eq!(pid.output().to_bits(), before.to_bits());
                    pid.output()
                });
            }
        }
    }
}

/// Tells whether a step is counted and taken all the same: its time is too long for the integral, its samples are good.
fn is_left_out(samples: &[f32], dt_s: f32) -> bool {
    TimeStep::of(dt_s).is_frozen() && samples.iter().all(|sample| sample.is_finite())
}

fn terms(pid: &Pid) -> [f32; 4] {
    [pid.proportional(), pid.integral(), pid.derivative(), pid.feed_forward()]
}

/// A bad sample leaves every term as it is (I5), and D rests in the next good step: it keeps its value.
fn update(pid: &mut Observed<Pid>, [setpoint, measured, dt_s]: [f32; 3]) {
    let before = (*pid.get(), pid.differs());
    let bits = |pid: &Pid| terms(pid).map(f32::to_bits);
    let range = pid.get().config().output_range();
    let left_out = is_left_out(&[setpoint, measured], dt_s);
    let taken = pid.step_counted(range, left_out, Pid::rejected, |pid: &mut Pid| {
        pid.step(setpoint, measured, &TimeStep::of(dt_s))
    });
    let ([.., before_d, _], [.., d, _]) = (bits(&before.0), bits(pid.get()));
    match (taken, before.1) {
        (false, _) => {
            assert_eq!(bits(&before.0), bits(pid.get()), "I5: {pid:?}");
            if !TimeStep::of(dt_s).is_hold() {
                pid.rests();
            }
        }
        (true, true) => assert_eq!(before_d, d, "D does not rest: {pid:?}"),
        (true, false) => {}
    }
}

fn speed_loop(input: &mut Input) -> Result<SpeedActuator, ConfigError> {
    let mut actuator = SpeedActuator::new(pid_config(input));
    let options = input.byte();
    if options & 1 != 0 {
        let cutoff_hz = input.positive();
        actuator = actuator.and_then(|actuator| actuator.with_feedback_filter(cutoff_hz));
    }
    if options & 2 != 0 {
        let cutoff_hz = input.positive();
        actuator = actuator.and_then(|actuator| actuator.with_output_filter(cutoff_hz));
    }
    actuator
}

fn speed_actuator(mut input: Input) {
    let Ok(fresh) = speed_loop(&mut input) else { return };
    let range = fresh.pid().config().output_range();
    let mut actuator = Observed::new(fresh);
    while !input.is_empty() {
        match input.byte() {
            0..=231 => {
                let (setpoint, speed, dt_s) = (input.float(), input.float(), input.step_s());
                let left_out = is_left_out(&[setpoint, speed], dt_s);
                let taken =
                    actuator.step_counted(range, left_out, SpeedActuator::rejected, |actuator| {
                        actuator.step(setpoint, speed, &TimeStep::of(dt_s))
                    });
                // D rests, and the filter before it starts anew.
                if !taken && !TimeStep::of(dt_s).is_hold() {
                    actuator.rests();
                }
            }
            232..=239 => actuator.restart(fresh),
            240..=247 => actuator.restart_at(input.float()),
            _ => {
                actuator.forgive();
                actuator.change(|actuator| {
                    actuator.interrupt();
                    actuator.output()
                });
            }
        }
    }
}

fn position_actuator(mut input: Input) {
    let angle = pid_config(&mut input);
    let mut actuator = speed_loop(&mut input).and_then(|speed| PositionActuator::new(angle, speed));
    let options = input.byte();
    if options & 1 != 0 {
        let cutoff_hz = input.positive();
        actuator = actuator.and_then(|actuator| actuator.with_angle_filter(cutoff_hz));
    }
    if options & 2 != 0 {
        let divider = input.byte();
        actuator = actuator.and_then(|actuator| actuator.with_outer_divider(divider));
    }
    let Ok(fresh) = actuator else { return };
    let range = fresh.speed().config().output_range();
    let (slowest, fastest) = fresh.position().config().output_range();
    let mut actuator = Observed::new(fresh);
    while !input.is_empty() {
        match input.byte() {
            0..=231 => {
                let (setpoint, angle, speed) = (input.float(), input.float(), input.float());
                let dt_s = input.step_s();
                let angle_counts = if options & 4 == 0 { angle } else { 0.0 };
                let left_out = is_left_out(&[setpoint, angle_counts, speed], dt_s);
                let taken = actuator.step_counted(
                    range,
                    left_out,
                    PositionActuator::rejected,
                    |actuator| {
                        if options & 4 == 0 {
                            actuator.step(setpoint, angle, speed, &TimeStep::of(dt_s))
                        } else {
                            actuator.step_error(setpoint, speed, &TimeStep::of(dt_s))
                        }
                    },
                );
                // D rests also in the next step of the outer loop, which may be many steps away.
                if !taken && !TimeStep::of(dt_s).is_hold() {
                    actuator.forgive();
                }
                let speed = actuator.get().speed_setpoint();
                let within = slowest <= speed && speed <= fastest || speed == 0.0;
                assert!(within, "I2: {speed} of {actuator:?}");
            }
            232..=239 => actuator.restart(fresh),
            240..=247 => actuator.restart_at(input.float()),
            _ => {
                actuator.change(|actuator| {
                    actuator.interrupt();
                    actuator.output()
                });
            }
        }
    }
}

fn filters(mut input: Input) {
    let low_pass = LowPass::new(input.positive());
    let (center, q, sample) = (input.positive(), input.positive(), input.positive());
    let biquad = if input.coin() {
        Biquad::low_pass(center, q, sample)
    } else {
        Biquad::notch(center, q, sample)
    };
    let (new_low_pass, new_biquad) = (low_pass.ok(), biquad.ok());
    let mut low_pass = new_low_pass.map(Observed::new);
    let mut biquad = new_biquad.map(Observed::new);
    let mut extremes = (0.0_f32, 0.0_f32);
    let mut first = true;
    while !input.is_empty() {
        if input.byte() >= 248 {
            if let Some((filter, fresh)) = low_pass.as_mut().zip(new_low_pass) {
                filter.reset(fresh, |filter| {
                    filter.reset();
                    filter.value()
                });
            }
            if let Some((filter, fresh)) = biquad.as_mut().zip(new_biquad) {
                filter.reset(fresh, |filter| {
                    filter.reset();
                    filter.value()
                });
            }
            first = true;
        }
        let (sample, dt_s) = (input.float(), input.step_s());
        if sample.is_finite() {
            extremes = if first {
                (sample.min(0.0), sample.max(0.0))
            } else {
                (extremes.0.min(sample), extremes.1.max(sample))
            };
            first = false;
        }
        if let Some(filter) = &mut low_pass {
            // A low pass of the first order never leaves what it was given, but for rounding.
            let slack = 1e-5 * extremes.0.abs().max(extremes.1.abs()) + f32::MIN_POSITIVE;
            let range = ((extremes.0 - slack).max(f32::MIN), (extremes.1 + slack).min(f32::MAX));
            filter.step(range, LowPass::rejected, |filter| filter.update(sample, dt_s));
        }
        if let Some(filter) = &mut biquad {
            let before = filter.get().rejected();
            filter.step(ANY, Biquad::rejected, |filter| filter.update(sample));
            // A good sample that overflows makes the filter start anew.
            if sample.is_finite() && filter.get().rejected() != before {
                filter.forgive();
            }
        }
    }
}

fn differentiators(mut input: Input) {
    let (r, h0_s, max_step_s) = (input.positive(), input.positive(), input.positive());
    let mut linear = Differentiator::linear(r, max_step_s).ok().map(Observed::new);
    let mut optimal = Differentiator::optimal(r, h0_s, max_step_s).ok().map(Observed::new);
    while !input.is_empty() {
        let (sample, dt_s) = (input.float(), input.step_s());
        if let Some(differentiator) = &mut linear {
            differentiator.step(ANY, |one| one.rejected(), |one| one.update(sample, dt_s));
            assert!(differentiator.get().rate().is_finite(), "{differentiator:?}");
        }
        if let Some(differentiator) = &mut optimal {
            differentiator.step(ANY, |one| one.rejected(), |one| one.update(sample, dt_s));
            assert!(differentiator.get().rate().is_finite(), "{differentiator:?}");
        }
    }
}

fn slew(mut input: Input) {
    let (up, down) = (input.positive(), input.positive());
    let Ok(limiter) = SlewLimiter::new(up, down) else { return };
    let mut limiter = Observed::new(limiter);
    // What rounding may have left over from the steps before.
    let mut largest = 0.0_f32;
    while !input.is_empty() {
        if input.byte() >= 248 {
            let value = input.float();
            limiter.change(|limiter| {
                limiter.reset_to(value);
                limiter.value()
            });
        }
        let (target, dt_s) = (input.float(), input.step_s());
        let before = limiter.get().value();
        let taken =
            limiter.step(ANY, SlewLimiter::rejected, |limiter| limiter.update(target, dt_s));
        let after = limiter.get().value();
        let towards = if before <= target {
            before <= after && after <= target
        } else {
            target <= after && after <= before
        };
        assert!(towards || !taken, "from {before} to {target} by {after}");
        largest = largest.max(before.abs()).max(after.abs());
        let slack = f64::from(largest) * 2.0 * f64::from(f32::EPSILON) + 1e-44;
        let change = f64::from(after) - f64::from(before);
        let most = |rate: f32| {
            f64::from(rate) * f64::from(TimeStep::of(dt_s).dt_s()) * (1.0 + 1e-6) + slack
        };
        let slow = change <= most(up) && -change <= most(down);
        assert!(slow || !taken, "I2: from {before} by {change} in {dt_s} s");
    }
}

fn windows(mut input: Input) {
    let mut average = Observed::new(Window::<5>::new());
    let mut median = Observed::new(Window::<5>::new());
    while !input.is_empty() {
        let sample = input.float();
        average.step(ANY, Window::rejected, |window| window.push(sample).mean());
        median.step(ANY, Window::rejected, |window| window.push(sample).median());
    }
}

fn profile(mut input: Input) {
    let (start, end) = (input.float(), input.float());
    let (velocity, acceleration) = (input.positive(), input.positive());
    let mut limits = MotionLimits::new(velocity, acceleration);
    if input.coin() {
        limits = limits.with_jerk(input.positive());
    }
    let Ok(profile) = Profile::plan(start, end, &limits) else { return };
    assert!(profile.duration_s() >= 0.0, "{profile:?}");
    assert_eq!(profile.end().to_bits(), end.to_bits());
    while !input.is_empty() {
        let state = profile.at(input.float());
        let all = [state.position, state.velocity, state.acceleration];
        assert!(all.iter().all(|value| value.is_finite()), "{state:?} of {profile:?}");
        let slow = state.velocity.abs() <= velocity * 1.0001;
        assert!(slow, "I2: {state:?} of {profile:?}");
    }
}

fn relay(mut input: Input) {
    let (amplitude, hysteresis) = (input.positive(), input.positive());
    let bias = if input.coin() { input.float() } else { 0.0 };
    let (cycles, time_limit_s) = (input.byte(), input.positive());
    let tuner = RelayTuner::new(amplitude, hysteresis).and_then(|tuner| {
        tuner.with_bias(bias)?.with_cycles(cycles)?.with_time_limit(time_limit_s)
    });
    let Ok(tuner) = tuner else { return };
    let mut tuner = Observed::new(tuner);
    tuner.change(|tuner| tuner.output());
    while !input.is_empty() {
        let (setpoint, measured, dt_s) = (input.float(), input.float(), input.step_s());
        tuner.step(ANY, RelayTuner::rejected, |tuner| tuner.update(setpoint, measured, dt_s));
        let output = tuner.get().output();
        let off = (output - bias).abs();
        let rounding = 1e-6 * bias.abs();
        assert!(
            off <= amplitude * 1.001 + rounding || output == 0.0,
            "{output} of {bias} and {amplitude}"
        );
        if let Some(found) = tuner.get().ultimate() {
            assert!(format!("{found:?}").find("NaN").is_none(), "{found:?}");
        }
    }
}

fn step_response(mut input: Input) {
    let [start, target, duration_s] = [input.float(), input.float(), input.float()];
    let response = StepResponse::new(start, target, duration_s, input.float());
    let Ok(mut response) = response else { return };
    while !input.is_empty() {
        let (value, dt_s) = (input.float(), input.step_s());
        let said = |response: &StepResponse| {
            let times = (response.rise_time_s(), response.settling_time_s());
            (response.is_complete(), times, response.overshoot(), response.steady_error())
        };
        let (rejected, before) = (response.rejected(), said(&response));
        response.record(value, dt_s);
        if response.rejected() != rejected {
            assert_eq!(said(&response), before, "I5");
        }
    }
}
