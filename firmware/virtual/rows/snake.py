"""The snake robot: joints with loops of their own, a computer, four IMUs and a servo on serial lines by DMA."""
import math

from board.host import JOINTS
from machines import ARM_AT_US, CYCLE_US, FAULT_AT_US
from rows.judge import START_US, WATCHDOG_US, figures, must, row, watched

# A joint goes on to its last target: it rests when its "disable" was sent.
DISABLE = bytes((1, 0x10, 0, 0, 0, 0))
HOST_LOST_US = 160_000 + 50_000 + 7_000 + 3 * CYCLE_US
# A period of the commands, half a period of the servo's line, and its way.
SERVO_LAG_US = 60_000


def _swinging(robot):
    robot.run(FAULT_AT_US)
    must(robot.enabled() == JOINTS, f"{robot.enabled()} joints are enabled before the fault")


def _disabled(robot, since):
    """How long after `since` each joint had its "disable", and none its "enable" after that, in us."""
    last = 0.0
    for joint in range(1, JOINTS + 1):
        sent = [frame for frame in robot.sent(since) if frame.id == joint]
        driven = [frame.us for frame in sent if robot.drives(frame)]
        stops = [frame.us for frame in sent if frame.data == DISABLE and frame.us > (driven[-1] if driven else since)]
        must(stops, f"joint {joint} was not disabled")
        last = max(last, stops[0])
    return last - since


def _at_rest(robot, since, limit_us, note, until):
    robot.run(until)
    zero = _disabled(robot, since)
    must(zero < limit_us, f"all are disabled after {zero:.0f} us only")
    must(robot.enabled() == 0, f"{robot.enabled()} joints are enabled")
    must(not robot.stale(since), f"{len(robot.stale(since))} stale frames")
    must(robot.wire.collisions == 0, f"{robot.wire.collisions} collisions")
    return {"zero_us": zero, "stale": len(robot.stale(since)), "note": note}


def _goes_on(robot, until, note):
    robot.run(until)
    must(robot.enabled() == JOINTS, f"{robot.enabled()} joints are enabled")
    must(not robot.resets, "it was reset")
    return {"zero_us": None, "stale": len(robot.stale(FAULT_AT_US)), "note": note}


@row("-", "fresh", "snake")
def gait(robot):
    """It is zeroed, enabled and swings: joints, gripper, servo, IMUs and telemetry."""
    busy = watched(robot, FAULT_AT_US)
    errors, servo = [], []
    for place in range(30):
        errors_of = lambda: [robot.angle(joint) - robot.gait(joint, robot.clock.us()) for joint in range(JOINTS)]
        robot.at(FAULT_AT_US + place * 10_000, lambda: errors.extend(errors_of()))
        robot.at(FAULT_AT_US + place * 10_000, lambda: servo.append((robot.servo.degrees() - 180, robot.gripper(robot.clock.us() - SERVO_LAG_US))))
    robot.run(ARM_AT_US)
    must(robot.sent() and not robot.driven() and robot.enabled() == 0, "it drives before it was armed")
    first = [frame.us for frame in robot.sent() if frame.data == DISABLE][0]
    robot.run(FAULT_AT_US + 300_000)
    rms = math.sqrt(sum(error * error for error in errors) / len(errors))
    must(rms < 1.5, f"the joints are {rms:.2f} degrees off")
    _, joints, angles = robot.host.telemetry[-1]
    off = max(abs(joints[place] - robot.angle(place)) for place in range(JOINTS))
    must(off < 12, f"the telemetry is {off:.1f} degrees off")
    must(not any(map(math.isnan, angles)), "an IMU is missing in the telemetry")
    must(robot.host.damaged == 0 and len(robot.host.telemetry) >= 15, f"{len(robot.host.telemetry)} telemetry frames")
    off = max(abs(degrees - wanted) for degrees, wanted in servo)
    must(off < 5 and max(servo)[0] - min(servo)[0] > 20, f"the servo is {off:.1f} degrees off")
    must(robot.servo.answers > 20, f"{robot.servo.answers} answers of the servo")
    must(robot.wire.collisions == 0, f"{robot.wire.collisions} collisions of a joint's id")
    must(not robot.resets and not robot.stale(), "a reset, or stale frames")
    jitter_us = robot.jitter_us(FAULT_AT_US - 50_000, FAULT_AT_US, 0x1FF)
    must(jitter_us < CYCLE_US / 2, f"the cycle is {jitter_us:.0f} us off")
    return {
        "zero_us": first, "stale": 0, "note": f"follows a gait, {rms:.1f} degrees off",
        "figures": figures(busy, jitter_us),
    }


@row("F58", needs="snake")
def host_cut(robot):
    """The line of the computer is cut in the middle of a frame."""
    _swinging(robot)
    robot.host.cut_after = 40
    result = _at_rest(robot, FAULT_AT_US, HOST_LOST_US, "disabled; at rest when it is heard again", FAULT_AT_US + 300_000)
    robot.host.is_sending = True
    robot.run(FAULT_AT_US + 420_000)
    must(robot.enabled() == 0, "it was enabled without being asked")
    return result


@row("F59", needs="snake")
def host_noise(robot):
    """A byte of each frame of the computer is damaged: no checksum holds."""
    _swinging(robot)
    robot.host.spoil = lambda place, byte: byte ^ 0x42 if place == 30 else byte
    return _at_rest(robot, FAULT_AT_US, HOST_LOST_US, "disabled", FAULT_AT_US + 300_000)


@row("F59", needs="snake")
def host_flaw(robot):
    """Two bytes of the computer have a framing error; then the computer sends "disable"."""
    _swinging(robot)
    for place, flaw in enumerate((0, 30)):
        robot.at(FAULT_AT_US + place * 60_000, lambda flaw=flaw: setattr(robot.host, "flaw", flaw))
    asked = FAULT_AT_US + 160_000
    robot.run(asked)
    must(robot.enabled() == JOINTS, f"{robot.enabled()} joints are enabled")
    must(robot.host.flaw is None, "no byte had an error")
    robot.ask(6)
    return _at_rest(robot, asked, 65_000, "goes on; disabled when asked", asked + 100_000)


@row("F57", needs="snake")
def host_drops(robot):
    """Each second command is damaged: the others count."""
    _swinging(robot)
    robot.host.spoil = lambda place, byte: byte ^ 0x42 if place == 30 and robot.host.sent % 2 else byte
    return _goes_on(robot, FAULT_AT_US + 300_000, "half of the commands count; goes on")


@row("F41", needs="snake")
def host_disables(robot):
    """The computer sends "disable"."""
    _swinging(robot)
    robot.ask(6)
    result = _at_rest(robot, FAULT_AT_US, 65_000, "disabled; enabled again when asked", FAULT_AT_US + 100_000)
    robot.arm_again(FAULT_AT_US + 100_000)
    robot.run(FAULT_AT_US + 560_000)
    must(robot.enabled() == JOINTS, f"{robot.enabled()} joints are enabled again")
    return result


@row("F24", needs="snake")
def joint_silent(robot):
    """A joint answers nothing: it is disabled, and after 100 ms all others are."""
    _swinging(robot)
    robot.world.fault("silent", 4, FAULT_AT_US, FAULT_AT_US + 400_000)
    return _at_rest(robot, FAULT_AT_US, 130_000, "all are disabled", FAULT_AT_US + 200_000)


@row("F15", needs="snake")
def joint_power(robot):
    """A joint has no supply for 150 ms: it starts disabled, which shows, and all are disabled."""
    _swinging(robot)
    robot.world.fault("power", 4, FAULT_AT_US, FAULT_AT_US + 150_000)
    return _at_rest(robot, FAULT_AT_US, 300_000, "all are disabled", FAULT_AT_US + 350_000)


@row("F54", needs="snake")
def snake_plug(robot):
    """The plug of the line is out for 200 ms: the first frames when it is back disable."""
    _swinging(robot)
    robot.wire.pull()
    back = FAULT_AT_US + 200_000
    robot.run(back)
    robot.wire.plug()
    result = _at_rest(robot, back, 20_000, "from when the plug is back: disabled", back + 100_000)
    must(not robot.driven(back), f"{len(robot.driven(back))} frames from before leave")
    return result


@row("F27", needs="snake")
def snake_dead_loop(robot):
    """All tasks stand: the watchdog resets, and what starts disables the joints first."""
    _swinging(robot)
    robot.core.hang(None)
    result = _at_rest(robot, FAULT_AT_US, WATCHDOG_US + START_US + 3 * CYCLE_US, "reset; disabled", FAULT_AT_US + 200_000)
    must(len(robot.resets) == 1 and robot.resets[0][1] == "watchdog", f"resets: {robot.resets}")
    return result


@row("F27", needs="snake")
def snake_brown_out(robot):
    """The supply of the board dips: the joints, which have their own, are disabled by the first frames."""
    _swinging(robot)
    robot.reset("brown-out")
    return _at_rest(robot, FAULT_AT_US, START_US + 2 * CYCLE_US, "disabled; at rest until enabled", FAULT_AT_US + 200_000)


@row("F58", needs="snake")
def snake_imu_cut(robot):
    """One of four IMUs is cut: its angles are missing in the telemetry, the others stay."""
    _swinging(robot)
    robot.imus[2].cut_after = 40
    result = _goes_on(robot, FAULT_AT_US + 250_000, "goes on; no angle in the telemetry")
    _, _, angles = robot.host.telemetry[-1]
    missing = [place for place in range(4) if math.isnan(angles[3 * place])]
    must(missing == [2], f"missing in the telemetry: {missing}")
    return result


@row("-", needs="snake")
def servo_silent(robot):
    """The servo answers nothing."""
    _swinging(robot)
    robot.servo.is_heard = False
    return _goes_on(robot, FAULT_AT_US + 150_000, "goes on")
