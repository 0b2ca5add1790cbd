//! Any model, any loads, any readings: the power limiter cuts, and never adds.
#![no_main]

use drivetrain::chassis::{PowerBuffer, PowerFit, PowerModel};
use drivetrain::control::PidConfig;
use drivetrain::units::AngularVelocity;
use drivetrain_fuzz::Input;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    let [k0, k1, k2, k3] = [input.float(), input.float(), input.float(), input.float()];
    let usable = [k0, k1, k2, k3].iter().all(|k| k.is_finite() && *k >= 0.0);
    let model = PowerModel::new(k0, k1, k2, k3);
    assert_eq!(model.is_ok(), usable);
    let Ok(model) = model else { return };
    let mut fit = PowerFit::new(model, input.float());
    let pid = PidConfig::new(2.0, 0.5, 0.0).with_output_limit(120.0);
    let Ok(fresh) = PowerBuffer::new(input.positive(), pid) else { return };
    // I9 and I10: a copy that starts anew wherever the loop does.
    let (mut buffer, mut clean) = (fresh, fresh);
    while !input.is_empty() {
        let loads: [(f32, AngularVelocity); 4] = core::array::from_fn(|_| {
            (input.float(), AngularVelocity::from_rad_per_s(input.float()))
        });
        let limit_w = input.float();
        cut(&model, loads, limit_w);
        let before = fit;
        fit.learn(loads, input.float());
        if fit.rejected() != before.rejected() {
            assert_eq!(fit.model(), before.model(), "I5");
        }
        cut(&fit.model(), loads, limit_w);
        let energy_j = (input.byte() % 4 != 0).then(|| input.float());
        let known_j = energy_j.filter(|energy| energy.is_finite());
        let dt_s = input.step_s();
        let allowance_w = buffer.allowance_w(limit_w, energy_j, dt_s);
        let again_w = clean.allowance_w(limit_w, known_j, dt_s);
        assert_eq!(allowance_w.to_bits(), again_w.to_bits(), "I5, I9 or I10: {buffer:?}");
        assert!(allowance_w >= 0.0 && allowance_w.is_finite(), "{allowance_w}");
        let most = if limit_w > 0.0 && limit_w.is_finite() { limit_w } else { 0.0 };
        assert!(allowance_w <= most + 120.0, "I2: {allowance_w} of {limit_w}");
        if known_j.is_none() {
            assert!(allowance_w <= most, "I4: {allowance_w} of {limit_w} without a reading");
            clean = fresh;
        }
    }
});

/// The factor is one, and what it promises holds when it is counted anew, in `f64`.
fn cut(model: &PowerModel, loads: [(f32, AngularVelocity); 4], limit_w: f32) {
    let (scale, power_w) = model.cut(loads, limit_w);
    assert!((0.0..=1.0).contains(&scale), "{scale}");
    let (again, same_w) = model.cut(loads, limit_w);
    assert_eq!((again.to_bits(), same_w.to_bits()), (scale.to_bits(), power_w.to_bits()), "I10");
    let limit = if limit_w > 0.0 { limit_w } else { 0.0 };
    let power =
        |load: &(f32, AngularVelocity), torque: f32| f64::from(model.power_w((torque, load.1)));
    let idle: f64 = loads.iter().map(|load| power(load, 0.0)).sum();
    let cut_w: f64 = loads.iter().map(|load| power(load, load.0 * scale)).sum();
    let size: f64 =
        loads.iter().map(|load| power(load, load.0).abs() + power(load, -load.0).abs()).sum();
    if power_w <= limit && cut_w.is_finite() && size.is_finite() && size < 1e30 {
        // A torque that is cut has no smaller step than this.
        let smallest = f32::from_bits(1);
        let grain: f64 =
            loads.iter().map(|load| (power(load, smallest) - power(load, 0.0)).abs()).sum();
        let limit = f64::from(limit);
        assert!(
            cut_w <= limit + 1e-4 * (size + idle) + grain + 1e-30,
            "{cut_w} of {limit_w}: {scale} {power_w} {loads:?} {model:?}"
        );
    }
}
