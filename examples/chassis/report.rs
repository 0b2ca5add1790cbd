//! Numbers for people, and rows for programs.

use super::scenario::{Run, Sample};
use super::silence::Silence;
use drivetrain::chassis::MecanumWheels;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Result, Write};
use std::path::Path;

pub(crate) const NAMES: MecanumWheels<&str> = MecanumWheels {
    front_left: "front left",
    front_right: "front right",
    rear_left: "rear left",
    rear_right: "rear right",
};

pub(crate) fn table(run: &Run) -> String {
    let mut text = String::new();
    let largest = run
        .samples
        .iter()
        .flat_map(|s| s.target_rpm.into_array())
        .fold(0.0_f32, |m, rpm| m.max(rpm.abs()));
    _ = writeln!(
        text,
        "{:<12} {:>14} {:>14}   (largest target {largest:.1} rpm)",
        "wheel", "RMS error rpm", "max error rpm"
    );
    for (index, name) in NAMES.into_array().into_iter().enumerate() {
        let (rms, max) = wheel_error(&run.samples, index);
        _ = writeln!(text, "{name:<12} {rms:>14.2} {max:>14.2}");
    }
    let (path_max, path_end) = path_error(&run.samples);
    if run.trouble.is_none() {
        let share = run.settled_error * 100.0;
        _ = writeln!(
            text,
            "settled      {share:.2} % of the largest target, 300 ms into constant motion, worst wheel"
        );
    }
    _ = writeln!(text, "path         {path_max:.3} m off at most, {path_end:.3} m at the end");
    if let Some((answers, counts)) = &run.serial {
        text.push_str(answers);
        _ = writeln!(
            text,
            "serial       {} lines accepted, {} out of range, {} unknown, {} malformed",
            counts.frames, counts.content_errors, counts.foreign_frames, counts.length_errors
        );
    }
    let statistics = &run.statistics;
    _ = writeln!(
        text,
        "bus          {:.1} % load, {} frames",
        run.traffic.load() * 100.0,
        run.traffic.frames
    );
    _ = writeln!(
        text,
        "frames       {} received, {} sent, {} refused, {} send errors, {} evicted, {} overruns",
        statistics.received,
        statistics.sent,
        statistics.refused,
        statistics.send_errors(),
        statistics.evicted,
        statistics.overruns
    );
    if let Some((trouble, from, until)) = run.trouble {
        _ = writeln!(
            text,
            "fault        {} from {from:.2} s to {until:.2} s; disarmed for {} ms in all",
            trouble.name(),
            run.refused_to_arm
        );
    }
    if run.trouble.is_some() {
        text += &escs(run);
    }
    text
}

/// Describes the ESCs while no command reached them.
fn escs(run: &Run) -> String {
    let Some(silence) = &run.silence else {
        return "ESCs         commands reached them all the while\n".into();
    };
    let Silence { from_s, until_s, way_m, disarmed_ms, .. } = *silence;
    let span_ms = (until_s - from_s) * 1e3;
    let kept = NAMES.zip(silence.kept_a).map(|(name, (least, most))| {
        let amperes = if most - least < 0.1 {
            format!("{:+.2} A", 0.5 * (least + most))
        } else {
            format!("{least:+.2} to {most:+.2} A")
        };
        format!("{name} {amperes}")
    });
    let currents = run.samples.iter().flat_map(|sample| sample.current_a.into_array());
    let largest = currents.fold(0.0_f32, |largest, amperes| largest.max(amperes.abs()));
    let went = match disarmed_ms {
        0 => String::new(),
        _ => format!(
            ", and was disarmed for {disarmed_ms} ms: zeros that do not arrive stop nothing"
        ),
    };
    format!(
        "ESCs         no command reached them for {span_ms:.0} ms from {from_s:.3} s on; each kept the current of its last one:
             {} (positive drives ahead)
             meanwhile the robot went {way_m:.2} m{went}
             (the largest current of this run, {largest:.1} A, would have been kept in the same way)
             simulated ESCs hold their last command; what real ones do is not documented\n",
        kept.into_array().join(", ")
    )
}

fn wheel_error(samples: &[Sample], wheel: usize) -> (f64, f32) {
    let errors = samples.iter().filter_map(|sample| {
        Some(
            sample.target_rpm.into_array().get(wheel)?
                - sample.measured_rpm.into_array().get(wheel)?,
        )
    });
    let (sum, max) = errors.fold((0.0_f64, 0.0_f32), |(sum, max), error| {
        (sum + f64::from(error) * f64::from(error), max.max(error.abs()))
    });
    ((sum / samples.len().max(1) as f64).sqrt(), max)
}

fn path_error(samples: &[Sample]) -> (f32, f32) {
    let error = |s: &Sample| (s.position_m.0 - s.planned_m.0).hypot(s.position_m.1 - s.planned_m.1);
    (samples.iter().map(error).fold(0.0, f32::max), samples.last().map_or(0.0, error))
}

pub(crate) fn write_csv(path: &Path, run: &Run) -> Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    writeln!(
        file,
        "time_s,armed,target_fl_rpm,target_fr_rpm,target_rl_rpm,target_rr_rpm,fl_rpm,fr_rpm,rl_rpm,rr_rpm,x_m,y_m,heading_rad,fl_a,fr_a,rl_a,rr_a"
    )?;
    for sample in &run.samples {
        write!(file, "{:.3},{}", sample.time_s, u8::from(sample.armed))?;
        for rpm in
            sample.target_rpm.into_array().into_iter().chain(sample.measured_rpm.into_array())
        {
            write!(file, ",{rpm:.3}")?;
        }
        let (x, y) = sample.position_m;
        write!(file, ",{x:.5},{y:.5},{:.5}", sample.heading_rad)?;
        for amperes in sample.current_a {
            write!(file, ",{amperes:.3}")?;
        }
        writeln!(file)?;
    }
    file.flush()
}
