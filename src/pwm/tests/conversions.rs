//! Every `f32` that a share could be.

use crate::math::tests::every_f32;
use crate::pwm::rc::duty;

#[test]
#[ignore = "2^32 shares of two timers: by .ci/run"]
fn every_f32_becomes_the_nearest_duty() {
    for max in [19_999_u16, u16::MAX] {
        every_f32(|bits| {
            let share = f32::from_bits(bits);
            let exact = (f64::from(share) * f64::from(max)).clamp(0.0, f64::from(max));
            let off = (f64::from(duty(share, max)) - exact).abs();
            let is_near = off <= 0.5 + exact * 1.2e-7;
            assert!(is_near || share.is_nan() && duty(share, max) == 0, "{share:e}");
        });
    }
    std::println!("exhaustive: duties of a timer: 8589934592 values");
}
