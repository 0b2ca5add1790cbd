//! Fits of the power model of a chassis, for `judges/power.py`.
//!
//! ```text
//! drivetrain-judges power STEPS    f32 in, a drive after the other: k0 to k3 of the model to start from (4); STEPS times torque and
//!                                  speed of four wheels (8) and the power measured. Out: the power of a wheel at rest,
//!                                  at 1 Nm, at 30 rad/s
//! ```

use crate::defect::defects;
use crate::{Outcome, floats};
use drivetrain::chassis::{PowerFit, PowerModel};
use drivetrain::units::AngularVelocity;
use std::io::{Read, Write};

defects! {
    /// One wheel is left out.
    Wheel = "wheel",
    /// Torques count, instead of their squares.
    Torque = "torque",
    /// The fit forgets, in some 100 steps.
    Forgets = "forgets",
    /// The mechanical power counts twice.
    Mechanical = "mechanical",
}

pub fn run(arguments: &[&str], mut input: impl Read, output: &mut impl Write) -> Outcome<()> {
    let (arguments, defect) = Defect::split(arguments)?;
    let [steps] = arguments else {
        return Err("see the head of judges/src/power.rs for the arguments".into());
    };
    let steps: u32 = steps.parse()?;
    while let Some([k0, k1, k2, k3]) = floats::next(&mut input)? {
        let k1 = if defect == Defect::Mechanical { 2.0 * k1 } else { k1 };
        let start = PowerModel::new(k0, k1, k2, k3)?;
        let mut fit = PowerFit::new(start, if defect == Defect::Forgets { 0.99 } else { 1.0 });
        for _ in 0..steps {
            let loads: [f32; 8] = floats::read(&mut input)?;
            let [measured_w] = floats::read(&mut input)?;
            let wheels = loads.chunks_exact(2).map(|load| {
                (
                    if defect == Defect::Torque { load[0].abs().sqrt() } else { load[0] },
                    AngularVelocity::from_rad_per_s(load[1]),
                )
            });
            let count = if defect == Defect::Wheel { 3 } else { 4 };
            fit.learn(wheels.take(count), measured_w);
        }
        let model = fit.model();
        let power = |torque, speed_rad_s| {
            model.power_w((torque, AngularVelocity::from_rad_per_s(speed_rad_s)))
        };
        floats::write([(0.0, 0.0), (1.0, 0.0), (0.0, 30.0)].map(|(t, s)| power(t, s)), output)?;
    }
    Ok(())
}
