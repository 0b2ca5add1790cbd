#!/usr/bin/env python3
"""Plants one defect at a time in a copy of the crate, and expects the fuzz target to find it.

    fuzz/controls.py [--seconds N] [WORD]...     60 s at most for each; WORD: only rows in whose target or defect it occurs
    fuzz/controls.py --check                     only looks whether the texts are there, and the rows in README.md
"""

import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
NIGHTLY = (ROOT / ".ci/nightly").read_text().strip()

# target, what is wrong, file, text that stands there exactly once, what is planted instead
DEFECTS = [
    ("ingest", "feedback is never late", "src/motor/safety/motor.rs",
     "let is_settled = self.link == Link::Online && self.is_fresh(now, timeouts);", "let is_settled = self.link == Link::Online;"),
    ("ingest", "targets never grow old", "src/motor/safety/motor.rs",
     "self.has_target && !is_near(now, self.commanded, timeouts.command_us())", "false"),
    ("ingest", "an angle of 8192 is taken", "src/dji/codec.rs",
     "(motion >> 29) |", "(motion.saturating_sub(1 << 16) >> 29) |"),
    ("ingest", "a bad length is not counted", "src/dji/watch.rs",
     "rejects.bad_length = rejects.bad_length.saturating_add(1);", ""),
    ("ingest", "a motor that leaves stays in its frame", "src/dji/attach.rs",
     "outbox.put(place, 0);\n    let mut slots", "let mut slots"),
    ("ingest", "relaxing keeps the integral", "src/dji/slot/target.rs",
     "Rest::Relaxed => self.reset_loops(),", "Rest::Relaxed => {}"),
    ("ingest", "a relaxed motor's last word is held", "src/motor/safety/motor.rs",
     "Some(Hold::Keep) if !self.has_rested() => Output::Repeat,", "Some(Hold::Keep) => Output::Repeat,"),
    ("ingest", "a word from before a refused target is held", "src/motor/safety/motor.rs",
     "Some(Hold::Keep) if !self.has_rested() => Output::Repeat,",
     "Some(Hold::Keep) if !self.has_rested() || self.refused_targets > 0 => Output::Repeat,"),
    ("ingest", "a refused frame keeps its motor fresh", "src/dji/watch.rs",
     "let Some(feedback) = Feedback::decode(frame.bytes()) else {", "let Some(feedback) = Feedback::decode(frame.bytes()) else {\n        if let Some(slot) = motors.slots.get_mut(index) {\n            slot.receive(Feedback::NONE, now.stamp());\n        }"),
    ("ingest", "the limit is one count too high", "src/dji/slot/config.rs",
     "let limit_raw = to_raw(limit, raw_per_unit, config.command_raw);", "let limit_raw = to_raw(limit, raw_per_unit, config.command_raw) + 1;"),
    ("ingest", "time is lost without a trip", "src/motor/safety/motor.rs",
     "self.set_late();\n        }\n        self.trip();", "self.set_late();\n        }"),
    ("ingest", "feedback stays fresh where time is lost", "src/motor/safety/motor.rs",
     "if self.listens && self.link == Link::Online {\n            self.set_late();\n        }\n        self.trip();", "self.trip();"),
    ("ingest", "where time is lost the zeros come a cycle late", "src/dji/watch.rs",
     "    if hold != Hold::Keep {\n", "    if hold == Hold::LoseTime {\n        return outbox.finish_update();\n    }\n    if hold != Hold::Keep {\n"),
    ("ingest", "time that stands or goes back is a bad step", "src/motor/safety/device.rs",
     "(!self.is_running || before < self.updated)", "true"),
    ("ingest", "an update before the arming drives", "src/motor/safety/device.rs",
     "self.armed_at <= self.updated && (!self.is_running", "(!self.is_running"),
    ("ingest", "a motor that lost time resumes by itself", "src/motor/safety/motor.rs",
     "self.set_late();\n        }\n        self.trip();", "self.set_late();\n        }\n        self.lose();"),
    ("ingest", "arming again makes a target younger", "src/dji/attach.rs",
     "    let (guard, slots) = motors.parts();\n    let is_chosen", "    let (guard, slots) = motors.parts();\n    slots.iter_mut().for_each(|slot| slot.guard.renew_target(now.stamp()));\n    let is_chosen"),
    ("ingest", "the output range is open at once", "src/motor/safety/motor.rs",
     "let most = limited(left, 0.0, self.share(now));", "_ = self.share(now);\n        let most = left;"),
    ("ingest", "a request that is repeated counts", "src/motor/safety/device.rs",
     "self.quiet_us = 0;\n        self.granted\n", "self.granted\n"),
    ("ingest", "after a trip any request counts", "src/motor/safety/device.rs",
     "!self.tripped || self.quiet_us >= Self::PAUSE_US;", "true;"),
    ("ingest", "a fault asks for no new request", "src/motor/safety/device.rs",
     "if was_armed && !motor.guard().is_armed() {\n            self.trip();\n        }", "_ = was_armed;"),
    ("ingest", "an emergency stop that is cleared asks for no new request", "src/motor/safety/device.rs",
     "if changes {\n            self.trip();", "if changes && is_stopped {\n            self.trip();"),
    ("ingest", "a stall is a pause", "src/motor/safety/device.rs",
     "unwrap_or(u32::MAX).min(Self::MOST_US)", "unwrap_or(u32::MAX)"),
    ("runner", "an evicted frame is not given back", "src/runner/port.rs",
     "if waits || self.device.requeue(&other) {", "if waits || other.header() < 0x300 {"),
    ("runner", "a full driver is not counted", "src/runner/port.rs",
     "increment(&mut self.statistics.refused);", ""),
    ("runner", "errors do not count against the budget", "src/runner/mod.rs",
     "for _ in 0..budget {\n            match", "while frames < budget {\n            match"),
    ("runner", "the emergency stop is not looked at", "src/runner/mod.rs",
     "self.device.emergency_stop();\n        }\n        self.sending", "}\n        self.sending"),
    ("runner", "holds the command of a motor at rest", "src/dji/watch.rs",
     "filter(|slot| !repeats(slot))", "filter(|slot| !repeats(slot) && false)"),
    ("runner", "a clock that goes back gives no step", "src/time/ticker.rs",
     "Some(Tick::new(now, 0.0))", "None"),
    ("runner", "a clock that stands is not noticed", "src/runner/watch.rs",
     "let stands = passed >= self.limit;", "let stands = passed == u32::MAX;"),
    ("runner", "a bus that was lost asks for no new request", "src/runner/mod.rs",
     "self.device.trip();", "self.device.disarm();"),
    ("controllers", "NaN passes", "src/time/ticker.rs",
     "let admitted = finite && !self.is_hold();", "let admitted = (finite || true) && !self.is_hold();"),
    ("controllers", "a reset keeps the integral", "src/control/pid/mod.rs",
     "self.interrupt();\n        self.core.integral = 0.0;\n        self.core.output = 0.0;",
     "self.interrupt();\n        self.core.output = 0.0;"),
    ("controllers", "the slew limiter rounds back", "src/control/shaping/mod.rs",
     "let value = limited(self.value + change, nearest, farthest);", "let value = if nearest > farthest { target } else { self.value + change };"),
    ("chassis", "commands never grow old", "src/chassis/base.rs",
     "self.clock.is_dead() || self.command_age_s > self.limits.command_timeout_s();", "self.clock.is_dead();"),
    ("chassis", "with limits, an old command is followed on", "src/chassis/base.rs",
     "_ if self.status.command_stale => Twist::ZERO,", "_ if self.status.command_stale && self.limits.wheel_speed().as_rad_per_s() > 1e30 => Twist::ZERO,"),
    ("chassis", "wheels have no limit", "src/chassis/base.rs",
     "let wheels = K::map(wheels, |wheel| slowed(wheel, scale));\n        if self.is_locking", "if self.is_locking"),
    ("chassis", "a command of NaN is not counted", "src/chassis/base.rs",
     "self.status.rejected = self.status.rejected.saturating_add(1);\n        }\n        self.is_renewed", "}\n        self.is_renewed"),
    ("power", "without a reading all is allowed", "src/chassis/power_buffer.rs",
     "return limit_w * self.blind_share;", "return limit_w * (self.blind_share + 1.0);"),
    ("power", "the loop goes on over a gap", "src/chassis/power_buffer.rs",
     "self.pid.reset();\n", ""),
    ("snake", "targets never grow old", "src/motor/safety/motor.rs",
     "self.has_target && !is_near(now, self.commanded, timeouts.command_us())", "false"),
    ("snake", "a field that cannot be is not counted", "src/snake/bus.rs",
     "6 => &mut counters.bad_field,", "6 => &mut counters.bad_length,"),
    ("snake", "enabled before the speed is set", "src/snake/model.rs",
     "Self::Speed,\n        Self::Position,\n        Self::Enable,\n    ];", "Self::Enable,\n        Self::Speed,\n        Self::Position,\n    ];"),
    ("snake", "does not wait for an answer", "src/snake/schedule.rs",
     "joints.answers.expect(index.into(), register, now);", ""),
    ("snake", "waits for another's answer", "src/snake/schedule.rs",
     "*asked != register", "*asked == register"),
    ("snake", "of two equal questions that of long ago ends the wait for the other", "src/snake/schedule.rs",
     "*asked == register && !is_given_up", "{ _ = is_given_up; *asked == register }"),
    ("snake", "who owes an answer is written what was left over", "src/snake/schedule.rs",
     "next_after(joints.written, joints.writes & !quiet)", "next_after(joints.written, joints.writes)"),
    ("snake", "who owes an answer is asked what was left over", "src/snake/schedule.rs",
     "{ joints.reads & !quiet }", "{ joints.reads }"),
    ("snake", "a question given back is counted", "src/snake/schedule.rs",
     "requests.saturating_sub(1)", "requests"),
    ("snake", "let go and not disabled", "src/snake/bus.rs",
     "is_some_and(Slot::let_go) {\n            schedule::stop(self, index);", "is_some_and(Slot::let_go) {"),
    ("snake", "a disable given back comes after a write", "src/snake/schedule.rs",
     "if command == Command::DISABLE {\n        drop_write(joints, bit);\n    }\n", ""),
    ("snake", "a write given back goes before others", "src/snake/slot.rs",
     "self.ahead |= self.renew", "self.ahead = self.renew"),
    ("snake", "without a step, late, it moves on", "src/motor/safety/device.rs",
     "self.held_steps == 0 && self.updated.since(before) <= self.timeouts.late();", "self.held_steps == 0;"),
    ("snake", "without a step no disable is sent again", "src/snake/bus.rs",
     "self.update_joints(false, Some(hold));\n        schedule::stop_again(self);\n", "self.update_joints(false, Some(hold));\n"),
    ("snake", "without a step an answer is waited for for ever", "src/snake/bus.rs",
     "self.give_up((!(stands && held > self.reply_timeout)).then_some(self.reply_timeout));", "_ = (stands, held);"),
    ("snake", "a frame given back is not counted", "src/snake/schedule.rs",
     "    drop_frames(joints, 1);\n    true\n", "    true\n"),
    ("snake", "an old speed is written", "src/snake/slot.rs",
     "self.speed = speed;\n            self.renew(Register::Speed);", "self.renew(Register::Speed);"),
    ("snake", "old settings are written", "src/snake/slot.rs",
     "self.settings = settings;\n", "_ = settings;\n"),
    ("snake", "time is lost without a trip", "src/motor/safety/motor.rs",
     "self.set_late();\n        }\n        self.trip();", "self.set_late();\n        }"),
    ("snake", "feedback stays fresh where time is lost", "src/motor/safety/motor.rs",
     "if self.listens && self.link == Link::Online {\n            self.set_late();\n        }\n        self.trip();", "self.trip();"),
    ("snake", "joints do not notice time that is lost", "src/snake/bus.rs",
     "if let Some(hold) = self.guard.pass(", "if let Some(hold @ (Hold::Keep | Hold::Rest)) = self.guard.pass("),
    ("snake", "any request to the joints counts", "src/snake/device.rs",
     "        self.guard.ask()\n", "        self.guard.ask() || true\n"),
    ("snake", "arming again makes a target younger", "src/snake/device.rs",
     "        let is_chosen = |_, slot: &Slot| slot.id.is_some();\n", "        let (at, is_chosen) = (now.stamp(), |_: u8, slot: &Slot| slot.id.is_some());\n        self.slots.iter_mut().for_each(|slot| slot.guard.renew_target(at));\n"),
    ("drives", "feedback is never late", "src/motor/safety/motor.rs",
     "let is_settled = self.link == Link::Online && self.is_fresh(now, timeouts);", "let is_settled = self.link == Link::Online;"),
    ("drives", "targets never grow old", "src/motor/safety/motor.rs",
     "self.has_target && !is_near(now, self.commanded, timeouts.command_us())", "false"),
    ("drives", "rest that was refused gives way", "src/motor/actuator/device.rs",
     "self.offered.is_rest &= self.offered.frame != Some(*frame);", ""),
    ("drives", "a question goes before rest that was refused", "src/motor/actuator/update.rs",
     "if frame.is_remote() && !self.offered.is_rest { self.motor.rest() } else { frame }", "frame"),
    ("drives", "the poll of a drive that is being enabled counts as rest", "src/motor/actuator/update.rs",
     "self.offered.is_rest &= !was_on || self.power.is_on();", ""),
    ("drives", "a motor that is disarmed keeps its frame until the next update", "src/motor/actuator/update.rs",
     "        let rest = self.rest();\n        self.offer(Some(rest));", ""),
    ("drives", "a damaged frame is taken", "src/damiao/bus.rs",
     "        let Some(status) = Status::of(head >> 4) else {\n            return", "        let Some(status) = Status::of(head >> 4) else {\n            self.status = None;\n            return"),
    ("drives", "a VESC rests at a duty of zero", "src/vesc/config.rs",
     "Self::Release => Command::RELEASE,", "Self::Release => Command::Duty(0.0),"),
    ("drives", "an ODrive in velocity mode rests at a velocity of zero", "src/odrive/bus.rs",
     "Command::Torque(0.0) } else { Command::IDLE };", "Command::Torque(0.0) } else { Command::Velocity(0.0, 0.0) };"),
    ("drives", "a RobStride is enabled without its torque limit", "src/robstride/config.rs",
     "limit(Register::TorqueLimit, nm)", "limit(Register::TorqueLimit, 17.0 + 0.0 * nm)"),
    ("drives", "a RobStride in current mode has no limit", "src/robstride/config.rs",
     "(torque_nm / self.nm_per_ampere).min(limit).max(-limit)", "2.0 * limit.copysign(torque_nm)"),
    ("drives", "a drive of Damiao in force-position mode rests at its zero", "src/damiao/bus.rs",
     "        } else {\n            self.off()\n        }", "        } else if self.mode.base() == 0x300 {\n            self.frame_of(Command::ForcePosition(0.0, 1.0, 0.1))\n        } else {\n            self.off()\n        }"),
    ("drives", "a drive of MyActuator rests at a velocity of zero", "src/rmd/codec.rs",
     "pub const REST: Self = Self::Torque(0);", "pub const REST: Self = Self::Velocity(0);"),
    ("candump", "an id of two digits", "src/wire/candump.rs",
     "\"{:03X}\"", "\"{:02X}\""),
    ("wire_dbus", "the signal is never lost", "src/wire/receiver.rs",
     "self.live && now.since(self.met) <= self.limit", "self.live"),
    ("wire_dbus", "a truncated frame is not counted", "src/wire/dbus.rs",
     "count(&mut self.counts.skipped_bytes, u32::try_from(self.length).unwrap_or(u32::MAX));", ""),
    ("wire_dbus", "a switch in the middle is refused", "src/wire/dbus.rs",
     "3 => Some(Switch::Middle),", ""),
    ("wire_dbus", "two channels are exchanged", "src/wire/dbus.rs",
     "left_x: channel(22)?,\n            left_y: channel(33)?,", "left_x: channel(33)?,\n            left_y: channel(22)?,"),
    ("wire_feetech", "noise is not counted", "src/wire/deframer.rs",
     "self.give_up(noise);", "self.discard(noise);"),
    ("wire_feetech", "a frame behind noise is lost with it", "src/wire/deframer.rs",
     "                self.give_up(1);\n            }\n        }\n    }", "                self.give_up(total);\n            }\n        }\n    }"),
    ("wire_feetech", "the sum is not looked at", "src/wire/feetech/status.rs",
     "checksum(summed) != *sum", "checksum(summed) != *sum && false"),
    ("wire_feetech", "an answer without parameters is refused", "src/wire/feetech/status.rs",
     "if checksum(summed) != *sum", "if checksum(summed) != *sum || parameters.is_empty()"),
    ("wire_hipnuc", "the signal is never lost", "src/wire/receiver.rs",
     "self.live && now.since(self.met) <= self.limit", "self.live"),
    ("wire_hipnuc", "a bad checksum costs all that it stands in", "src/wire/deframer.rs",
     "                self.give_up(1);\n            }\n        }\n    }", "                self.give_up(total);\n            }\n        }\n    }"),
    ("wire_hipnuc", "a motion that is no number is taken", "src/wire/hipnuc.rs",
     "imu.filter(Self::is_finite)", "imu"),
    ("wire_hipnuc", "the checksum is not looked at", "src/wire/hipnuc.rs",
     "if digest.finalize() != u16::from_le_bytes(*crc) {", "if digest.finalize() != u16::from_le_bytes(*crc) && false {"),
    ("wire_hipnuc", "every frame is refused", "src/wire/hipnuc.rs",
     "(0x91, 76) =>", "(0x91, 77) =>"),
    ("wire_host_link", "the signal is never lost", "src/wire/receiver.rs",
     "self.live && now.since(self.met) <= self.limit", "self.live"),
    ("wire_host_link", "a bad checksum costs all that it stands in", "src/wire/deframer.rs",
     "                self.give_up(1);\n            }\n        }\n    }", "                self.give_up(total);\n            }\n        }\n    }"),
    ("wire_host_link", "the checksum is not looked at", "src/wire/host_link.rs",
     "if CRC.checksum(body) == u16::from_be_bytes(*crc) {", "if CRC.checksum(body) == u16::from_be_bytes(*crc) || true {"),
    ("wire_host_link", "an angle that is no number is refused", "src/wire/host_link.rs",
     "format.read(check(frame)?).ok_or(Reject::Length)", "format.read(check(frame)?).filter(|telemetry| telemetry.imu_angles_deg.as_flattened().iter().all(|angle| angle.is_finite())).ok_or(Reject::Content)"),
    ("wire_referee", "a limit rises with the first frame", "src/wire/referee/receiver.rs",
     "holds.then_some(self.previous.min(self.latest))", "holds.then_some(self.latest)"),
    ("wire_referee", "a charge that cannot be counts", "src/wire/referee/receiver.rs",
     "if value > most {", "if value > most && false {"),
    ("wire_referee", "the first frame after silence is a second", "src/wire/referee/receiver.rs",
     "self.is_second = self.deadline.is_live(now);", "self.is_second = self.latest < u16::MAX;"),
    ("wire_referee", "silence raises a limit to the safe one", "src/wire/referee/receiver.rs",
     "self.safe_limit_w.min(self.limit_w.latest)", "self.safe_limit_w"),
    ("wire_referee", "the signal is never lost", "src/wire/receiver.rs",
     "self.live && now.since(self.met) <= self.limit", "self.live"),
    ("wire_referee", "the checksum is not looked at", "src/wire/referee.rs",
     "if CRC.checksum(body) == u16::from_le_bytes(*crc) {", "if CRC.checksum(body) == u16::from_le_bytes(*crc) || true {"),
    ("wire_referee", "the heats of two layouts are mixed up", "src/wire/referee.rs",
     "data.0.len() == WITH_SECOND_BARREL", "data.0.len() != WITH_SECOND_BARREL"),
    ("wire_referee", "a velocity that is no number is taken", "src/wire/referee.rs",
     "velocity.is_finite() && *velocity >= 0.0", "true || *velocity >= 0.0"),
    ("wire_referee", "the left stick is that of a DR16", "src/wire/vt13.rs",
     "left_y: channel(22)?,\n            left_x: channel(33)?,", "left_x: channel(22)?,\n            left_y: channel(33)?,"),
    ("wire_referee", "a capacitor in error is used", "src/wire/supercap.rs",
     "if self.is_on && self.errors == 0 {", "if self.is_on {"),
    ("wire_vofa", "an end within the values is sent as it is", "src/wire/vofa.rs",
     "if makes_tail(previous, bytes) {", "if false {"),
    ("wire_vofa", "what is no frame costs all of it", "src/wire/deframer.rs",
     "                self.give_up(1);\n            }\n        }\n    }", "                self.give_up(total);\n            }\n        }\n    }"),
]


def plant(tree, file, there, instead):
    path = tree / file
    text = path.read_text()
    if text.count(there) != 1:
        sys.exit(f"{file}: {text.count(there)} times, not once: {there!r}")
    path.write_text(text.replace(there, instead))
    return lambda: path.write_text(text)


def build(tree, target):
    command = ["cargo", f"+{NIGHTLY}", "fuzz", "build", "--sanitizer", "none", target]
    done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)


def fuzz(tree, binary, target, seconds):
    corpus = tree / "inputs"
    shutil.rmtree(corpus, ignore_errors=True)
    packed = ROOT / "fuzz" / "corpus" / f"{target}.hex"
    subprocess.run([sys.executable, ROOT / ".ci" / "corpus.py", "unpack", packed, corpus], check=True)
    started = time.monotonic()
    done = subprocess.run(
        [binary, f"-max_total_time={seconds}", "-timeout=10", "-max_len=512", f"-artifact_prefix={tree}/", corpus],
        capture_output=True, text=True, errors="replace")
    said = re.search(r"panicked at [^\n]*\n([^\n]*)", done.stderr)
    hung = "no end" if "ERROR: libFuzzer: timeout" in done.stderr else "?"
    return done.returncode != 0, time.monotonic() - started, said.group(1)[:70] if said else hung


def check():
    """Every text stands where it is to be replaced, once, and the README has every row."""
    readme = (ROOT / "fuzz" / "README.md").read_text()
    for target, what, file, there, instead in DEFECTS:
        if (count := (ROOT / file).read_text().count(there)) != 1:
            sys.exit(f"{file}: {count} times, not once: {there!r}")
        if there == instead:
            sys.exit(f"{file}: no defect: {there!r}")
        if f"| `{target}` | {what} |" not in readme:
            sys.exit(f"fuzz/README.md has no row `{target}`, {what}")
    print(f"planted defects: {len(DEFECTS)} texts are where they are replaced, and in the README")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--seconds", type=int, default=60)
    arguments.add_argument("--check", action="store_true")
    arguments.add_argument("words", nargs="*")
    arguments = arguments.parse_args()
    if arguments.check:
        return check()
    missed = 0
    print("| target | defect | found after | by |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as tree:
        tree = pathlib.Path(tree)
        files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
        for name in files.stdout.split("\0")[:-1]:
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
        target_dir = pathlib.Path(os.environ.setdefault("CARGO_TARGET_DIR", str(ROOT / "target" / "controls")))
        version = subprocess.run(["rustc", "-vV"], capture_output=True, text=True, check=True).stdout
        host = re.search("host: (.*)", version).group(1)
        for _, _, *defect in DEFECTS:
            plant(tree, *defect)()
        for target, what, *defect in DEFECTS:
            if arguments.words and not any(word in f"{target} {what}" for word in arguments.words):
                continue
            restore = plant(tree, *defect)
            build(tree, target)
            found, seconds, said = fuzz(tree, target_dir / host / "release" / target, target, arguments.seconds)
            restore()
            missed += not found
            print(f"| `{target}` | {what} | " + (f"{seconds:.1f} s | `{said}` |" if found else "not found | |"), flush=True)
    sys.exit(f"{missed} not found" if missed else 0)


main()
