//! The wheels as a stream for a plotting tool on a serial port.

use super::scenario::Sample;
use drivetrain::wire::EncodeError;
use drivetrain::wire::vofa::justfloat;

/// Four targets, then four speeds, in rpm: front left, front right, rear left, rear right.
pub(crate) const CHANNELS: usize = 8;

pub(crate) fn stream(samples: &[Sample]) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    let mut frame = [0; 4 * CHANNELS + 4];
    for sample in samples {
        let (targets, speeds) = (sample.target_rpm.into_array(), sample.measured_rpm.into_array());
        let mut values = targets.into_iter().chain(speeds);
        let channels: [f32; CHANNELS] = std::array::from_fn(|_| values.next().unwrap_or(0.0));
        bytes.extend_from_slice(justfloat(&channels, &mut frame)?);
    }
    Ok(bytes)
}
