//! The codecs, on binary streams.

use crate::{Defect, Outcome};
use drivetrain::damiao::{Command, Feedback, Model};
use drivetrain::motor::Impedance;
use drivetrain::units::{Angle, AngularVelocity};
use std::io::{Read, Write};

/// Reads commands of five `f32`, low byte first, and writes the data of their frames. The fields are those of the mode, in their
/// order: for MIT position, velocity, kp, kd, torque. What the mode does not have is left out.
pub fn encode(
    model: &Model,
    mode: &str,
    defect: Defect,
    mut input: impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let mut commands = Vec::new();
    input.read_to_end(&mut commands)?;
    let (commands, []) = commands.as_chunks::<20>() else { return Err("half a command".into()) };
    for command in commands {
        let (fields, _) = command.as_chunks::<4>();
        let &[a, b, c, d, e] = fields else { return Err("not five fields".into()) };
        let [a, b, c, d, e] = [a, b, c, d, e].map(f32::from_le_bytes);
        let command = match mode {
            "mit" => Command::Mit(mit(defect, model, [a, b, c, d, e])),
            "position-velocity" => Command::PositionVelocity(a, b),
            "velocity" => Command::Velocity(a),
            "force-position" => Command::ForcePosition(a, b, c),
            _ => return Err(format!("no mode {mode}").into()),
        };
        let mut data = command.encode(model.ranges());
        match (defect, mode) {
            (Defect::Nibbles, "mit") => data[3] = data[3].rotate_left(4),
            (Defect::Nibbles, _) => data.swap(2, 3),
            _ => {}
        }
        output.write_all(&data)?;
    }
    Ok(())
}

fn mit(defect: Defect, model: &Model, [p, v, kp, kd, t]: [f32; 5]) -> Impedance {
    let command = Impedance {
        angle: Angle::from_radians(p),
        velocity: AngularVelocity::from_rad_per_s(v),
        stiffness: kp,
        damping: kd,
        torque_nm: t,
    };
    match defect {
        Defect::Scale => Impedance { damping: kd * 4096.0 / 4095.0, ..command },
        Defect::Rounded => Impedance { torque_nm: t + model.tmax_nm() / 4095.0, ..command },
        _ => command,
    }
}

/// Reads the data of feedback frames and writes 20 bytes for each: position, velocity and torque as `f32`, low byte first; status,
/// id, temperatures of driver and rotor, whether the position is at an end, and three zeros. The status of a frame that is refused
/// is 255.
pub fn decode(
    model: &Model,
    defect: Defect,
    mut input: impl Read,
    output: &mut impl Write,
) -> Outcome<()> {
    let mut frames = Vec::new();
    input.read_to_end(&mut frames)?;
    let (frames, []) = frames.as_chunks::<8>() else { return Err("half a frame".into()) };
    for data in frames {
        let mut data = *data;
        if defect == Defect::Nibbles {
            data[4] = data[4].rotate_left(4);
        }
        let Some(feedback) = Feedback::decode(&data, model.ranges()) else {
            let mut refused = [0; 20];
            refused[12] = 255;
            output.write_all(&refused)?;
            continue;
        };
        let mut measured = feedback.measured;
        if defect == Defect::Scale {
            measured.torque_nm *= 4095.0 / 4096.0;
        }
        let values = [measured.position_rad, measured.velocity_rad_per_s, measured.torque_nm];
        for value in values {
            output.write_all(&value.to_le_bytes())?;
        }
        let Feedback { status, id, driver_c, rotor_c, is_at_end, .. } = feedback;
        let rest = [status as u8, id, driver_c, rotor_c, is_at_end.into(), 0, 0, 0];
        output.write_all(&rest)?;
    }
    Ok(())
}
