//! Numbers for people.

use super::system::JOINTS;
use super::system::checks::{Check, RMS_LIMIT_DEG};
use super::system::robot::Event;
use super::system::simulation::Run;
use super::system::tcp::Report;
use drivetrain::sim::SerialLine;
use drivetrain::wire::Counts;
use std::fmt::Write as _;

pub(crate) fn table(run: &Run, checks: &[Check]) -> String {
    let mut text = String::new();
    _ = writeln!(
        text,
        "joint   RMS error   largest   (degrees, in full swing; limit {RMS_LIMIT_DEG} RMS)"
    );
    for joint in 0..JOINTS {
        let (rms, most) = run.error_deg(joint, false);
        _ = write!(text, "{:>5} {rms:>11.3} {most:>9.3}", joint + 1);
        if run.setup.trouble.is_some() {
            let (rms, most) = run.error_deg(joint, true);
            _ = write!(text, "   after the fault {rms:>7.3} {most:>7.3}");
        }
        text.push('\n');
    }
    let (nominal, worst) = (run.budget.nominal() * 100.0, run.budget.worst_case() * 100.0);
    _ = writeln!(
        text,
        "bus     {:.2} % load from {} bits of {} frames; budget {nominal:.1} % nominal, {worst:.1} % worst case",
        run.traffic.load() * 100.0,
        run.traffic.busy_bits,
        run.traffic.frames
    );
    let counters = run.counters;
    _ = writeln!(
        text,
        "joints  {} requests, {} replies, {} unanswered, {} bad",
        counters.requests,
        counters.replies,
        counters.unanswered,
        counters.bad_length + counters.bad_field + counters.foreign_commands
    );
    _ = writeln!(text, "down    {}", line(run.sent.len(), &run.down));
    let up_frames = run.up.0.sent() / 121;
    _ = writeln!(text, "up      {}", line(usize::try_from(up_frames).unwrap_or(0), &run.up));
    let imus = run.imus.map(|(sent, counts)| format!("{}/{sent}", counts.frames)).join(" ");
    _ = writeln!(text, "IMUs    frames read of those sent: {imus}");
    let yaws = run
        .last_telemetry
        .map(|telemetry| telemetry.imu_angles_deg.map(|[_, _, yaw]| format!("{yaw:.1}")).join(" "));
    _ = writeln!(
        text,
        "servo   {} answers, last at {:.1} degrees; yaw of the segments {}",
        run.servo.frames,
        run.servo_deg.unwrap_or(f32::NAN),
        yaws.unwrap_or_default()
    );
    _ = writeln!(text, "host    lost {} times", run.host_losses);
    for (time_s, event) in &run.events {
        _ = writeln!(text, "{time_s:>7.3} s  {}", described(event));
    }
    for check in checks {
        _ = writeln!(text, "{}  {}", if check.holds { "ok  " } else { "FAIL" }, check.what);
    }
    text
}

fn line(frames: usize, (bytes, counts): &(SerialLine, Counts)) -> String {
    format!(
        "{frames} frames sent, {} good, {} with a wrong sum; {} bytes sent, {} damaged, {} lost, {} stray; {} skipped to resynchronise",
        counts.frames,
        counts.checksum_errors,
        bytes.sent(),
        bytes.flipped(),
        bytes.lost(),
        bytes.inserted(),
        counts.skipped_bytes
    )
}

fn described(event: &Event) -> String {
    match event {
        Event::HostHeard => "edge: the host is heard".to_owned(),
        Event::HostLost => "edge: the host is lost".to_owned(),
        Event::Zeroed => "zeroed".to_owned(),
        Event::Armed => "armed".to_owned(),
        Event::Relaxed(why) => format!("relaxed: {why}"),
        Event::Refused(why) => format!("refused: {why}"),
    }
}

pub(crate) fn side(name: &str, report: &Report) -> String {
    let Counts { frames, checksum_errors, skipped_bytes, .. } = report.counts;
    format!(
        "{name}: {} frames sent, {frames} received ({} bytes), {checksum_errors} with a wrong sum, {skipped_bytes} bytes skipped, other side lost {} times, joints up to {:.1} degrees, {} s",
        report.sent, report.bytes, report.losses, report.furthest_deg, report.seconds
    )
}
