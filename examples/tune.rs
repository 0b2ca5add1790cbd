//! Finds the speed-loop gains of two motors that it knows nothing about: a relay makes each swing, a rule turns the swing into
//! gains, and a step shows what they are worth.
//!
//! ```text
//! cargo run --release --example tune [FILE.svg]
//! ```
//! On a real robot the three steps are the same; lift the wheels off the ground first. The motors here are simulated, and some
//! of their inertia and friction is an estimate: take the procedure home, not the gains.

#[path = "picture/axes.rs"]
mod axes;
mod output;

use axes::{BLUE, RED};
use drivetrain::control::{PidConfig, RelayTuner, StepResponse, TuningRule};
use drivetrain::dji::{Bus, Config, Gm6020Voltage, Handle, M3508, Model};
use drivetrain::runner::{Nb, Runner};
use drivetrain::sim::{MotorConfig, Simulation};
use drivetrain::time::Duration;
use drivetrain::units::{AngularVelocity, Current, Voltage};
use output::console;
use plotters::prelude::*;
use std::error::Error;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Speeds in rad/s; the output in A or V.
struct Plan<M: Model> {
    name: &'static str,
    unit: &'static str,
    simulated: MotorConfig,
    /// A speed about which the motor swings: away from zero, where dry friction would hold it.
    swing_about: f32,
    /// Amplitude, hysteresis and bias.
    relay: [f32; 3],
    guessed: PidConfig,
    rule: TuningRule,
    step_to: f32,
    effort: fn(&mut Bus, Handle<M>, f32),
}

const WHEEL: Plan<M3508> = Plan {
    name: "M3508",
    unit: "A",
    simulated: MotorConfig::m3508(1),
    swing_about: 15.0,
    // The hysteresis slows the swing down to 8 samples of the loop in half a period, and more.
    relay: [3.0, 0.5, 0.0],
    guessed: PidConfig::new(0.1, 2.0, 0.0),
    rule: TuningRule::TyreusLuybenPi,
    step_to: 30.0,
    effort: |bus, motor, amperes| _ = bus.set_current(motor, Current::from_amperes(amperes)),
};

const YAW: Plan<Gm6020Voltage> = Plan {
    name: "GM6020",
    unit: "V",
    simulated: MotorConfig::gm6020_voltage(1),
    swing_about: 8.0,
    // The back-EMF takes 0.75 V for each rad/s; the relay swings about that.
    relay: [4.0, 3.0, 6.0],
    guessed: PidConfig::new(0.2, 4.0, 0.0),
    rule: TuningRule::TyreusLuybenPi,
    step_to: 12.0,
    effort: |bus, motor, volts| _ = bus.set_voltage(motor, Voltage::from_volts(volts)),
};

/// Time and speed of a step response.
type Curve = Vec<(f32, f32)>;

struct Tuned {
    name: &'static str,
    target: f32,
    before: Curve,
    after: Curve,
}

/// Runs one motor for `seconds`; `work` gets its handle, its measured speed and the time step, once a tick.
fn run<M: Model>(
    plan: &Plan<M>,
    speed: PidConfig,
    seconds: u32,
    mut work: impl FnMut(&mut Bus, Handle<M>, f32, f32),
) -> Outcome<()> {
    let world = Simulation::new(1);
    world.attach(plan.simulated)?;
    let mut bus = Bus::new();
    let motor = bus.attach(Config::<M>::new(1).speed_loop(speed))?;
    let mut runner = Runner::new(Nb(world.controller()), world.clock(), bus);
    let mut armed = false;
    for _ in 0..seconds * 10_000 {
        world.advance(Duration::from_micros(100));
        runner.poll(8);
        if let Some(tick) = runner.due() {
            armed = armed || runner.arm(tick).is_ok();
            let speed = runner.device().state(motor).map(|state| state.velocity.as_rad_per_s());
            if let (true, Some(speed)) = (armed, speed) {
                work(runner.device_mut(), motor, speed, tick.dt_s());
            }
            runner.tick(tick);
        }
    }
    Ok(())
}

fn identify<M: Model>(plan: &Plan<M>) -> Outcome<RelayTuner> {
    let [amplitude, hysteresis, bias] = plan.relay;
    let mut tuner = RelayTuner::new(amplitude, hysteresis)?.with_bias(bias)?;
    run(plan, plan.guessed, 3, |bus, motor, speed, dt_s| {
        (plan.effort)(bus, motor, tuner.update(plan.swing_about, speed, dt_s));
    })?;
    match (tuner.ultimate(), tuner.failure()) {
        (Some(_), _) => Ok(tuner),
        (None, Some(failure)) => Err(format!("{}: {failure}", plan.name).into()),
        (None, None) => Err(format!("{}: still swinging after 3 s", plan.name).into()),
    }
}

fn step<M: Model>(plan: &Plan<M>, speed: PidConfig) -> Outcome<(StepResponse, Curve)> {
    let mut response = StepResponse::new(0.0, plan.step_to, 1.0, 0.05)?;
    let (mut curve, mut time_s) = (Curve::new(), 0.0);
    run(plan, speed, 2, |bus, motor, speed, dt_s| {
        _ = bus.set_velocity(motor, AngularVelocity::from_rad_per_s(plan.step_to));
        if !response.is_complete() {
            response.record(speed, dt_s);
            curve.push((time_s, speed));
            time_s += dt_s;
        }
    })?;
    Ok((response, curve))
}

fn tune<M: Model>(plan: &Plan<M>) -> Outcome<Tuned> {
    let tuner = identify(plan)?;
    let (gain, period_s) = tuner.ultimate().ok_or("still swinging")?;
    console::line(format_args!(
        "{}: ultimate gain {:.3} {unit} per rad/s, ultimate period {:.1} ms",
        plan.name,
        gain,
        1e3 * period_s,
        unit = plan.unit,
    ));
    let (before, before_curve) = step(plan, plan.guessed)?;
    report("guessed", plan.guessed, &before);
    let gains = tuner.pid(plan.rule).ok_or("still swinging")?;
    let (after, after_curve) = step(plan, gains)?;
    report(&format!("{:?}", plan.rule), gains, &after);
    Ok(Tuned { name: plan.name, target: plan.step_to, before: before_curve, after: after_curve })
}

fn report(title: &str, speed: PidConfig, measures: &StepResponse) {
    let ms = |time_s: Option<f32>| time_s.map_or("never".into(), |s| format!("{:.0} ms", 1e3 * s));
    let (kp, ki, _) = speed.gains();
    console::line(format_args!(
        "  {title:<15} kp {:.3}  ki {:.2}   rise {}, overshoot {:.1} %, settled (5 %) {}, steady error {:+.3} rad/s",
        kp,
        ki,
        ms(measures.rise_time_s()),
        100.0 * measures.overshoot(),
        ms(measures.settling_time_s()),
        measures.steady_error(),
    ));
}

fn plot(path: &str, motors: &[Tuned]) -> Outcome<()> {
    std::fs::File::create(path).map_err(|error| format!("{path}: {error}"))?;
    let root = SVGBackend::new(path, (900, 640)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, motor) in root.split_evenly((motors.len(), 1)).iter().zip(motors) {
        let title = format!("step of the {} (grey: target, red: guessed, blue: tuned)", motor.name);
        let time = (axes::TIME, 0.0..0.6);
        let speed = ("rad/s", 0.0..1.6 * motor.target);
        let mut chart = axes::axes(area, &title, time, speed, None)?;
        let target = [(0.0, motor.target), (0.6, motor.target)];
        chart.draw_series(LineSeries::new(target, &RGBColor(150, 150, 150)))?;
        for (curve, colour) in [(&motor.before, RED), (&motor.after, BLUE)] {
            let shown = curve.iter().copied().take_while(|(time_s, _)| *time_s <= 0.6);
            chart.draw_series(LineSeries::new(shown, &colour))?;
        }
    }
    root.present()?;
    Ok(())
}

fn main() -> Outcome<()> {
    let path = output::path("tune");
    plot(&path, &[tune(&WHEEL)?, tune(&YAW)?])?;
    console::line(format_args!("plot: {path}"));
    Ok(())
}
