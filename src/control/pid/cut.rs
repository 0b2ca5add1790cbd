use super::Pid;

impl Pid {
    /// Takes what was let through of the last output by a limit beyond this loop, and keeps the integral within its
    /// size: an integral that alone asks for more than passes would be wound up. NaN counts as zero.
    pub(crate) const fn keep_integral_within(&mut self, passed: f32) {
        let most = if passed.is_nan() { 0.0 } else { passed.abs() };
        self.keep_integral_between(-most, most);
    }

    /// Keeps the integral between the ends of a range of the output that contains zero.
    pub(crate) const fn keep_integral_between(&mut self, lowest: f32, highest: f32) {
        if self.integral > highest {
            self.integral = highest;
        } else if self.integral < lowest {
            self.integral = lowest;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::control::{Pid, PidConfig};

    /// A second at an error of 1 with only half of the output let through, and the first output after it.
    fn after_a_second(tells: bool) -> f32 {
        let mut pid = Pid::new(PidConfig::new(1.0, 100.0, 0.0)).unwrap();
        for _ in 0..1_000 {
            let output = pid.update(1.0, 0.0, 0.001);
            if tells {
                pid.keep_integral_within(output.min(2.0));
            }
        }
        pid.update(1.0, 0.0, 0.001)
    }

    #[test]
    fn a_loop_that_is_told_what_passed_does_not_wind_up() {
        assert!(after_a_second(false) > 100.0);
        assert!((after_a_second(true) - 3.1).abs() < 1e-4); // P and the 2 that passed, and a step's growth
    }

    #[test]
    fn the_sign_stays_and_what_is_no_number_takes_all() {
        let mut pid = Pid::new(PidConfig::new(0.0, 100.0, 0.0)).unwrap();
        for _ in 0..=100 {
            pid.update(-1.0, 0.0, 0.001);
        }
        pid.keep_integral_within(4.0);
        assert!((pid.terms().i + 4.0).abs() < 1e-6);
        pid.keep_integral_within(100.0);
        assert!((pid.terms().i + 4.0).abs() < 1e-6);
        pid.keep_integral_within(f32::NAN);
        assert!(pid.terms().i.abs() < 1e-6);
    }
}
