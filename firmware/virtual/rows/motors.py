"""What goes wrong with a motor or its ESC."""
from robots import CYCLE_US, FAULT_AT_US
from rows.judge import LOST_US, STANDS_RPM, drives_again, driving, first_word, goes_on, must, rested, rests, row

# A fault that an ESC reports shows in its next frame, in the next tick.
REPORTED_US = 3 * CYCLE_US + 300


@row("F24")
def silent_motor(robot):
    """The first motor is silent for 105 ms, and heard again: its word is zero in time, and stays zero until armed again."""
    driving(robot)
    robot.world.fault("silent", 0, FAULT_AT_US, FAULT_AT_US + 105_000)
    robot.run(FAULT_AT_US + 140_000)
    word = [frame for frame in robot.commands(FAULT_AT_US) if any(frame.data[:2])]
    last = word[-1].us if word else FAULT_AT_US
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - FAULT_AT_US
    must(zero < LOST_US, f"its word is zero after {zero:.0f} us only")
    drives_again(robot, FAULT_AT_US + 140_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests when heard again; drives again when armed again"}


@row("F24", needs="remote")
def lost_wheel(robot):
    """The first motor is silent for good while a stick is held: the other wheels brake."""
    driving(robot)
    robot.world.fault("silent", 0, FAULT_AT_US, FAULT_AT_US + 600_000)
    robot.run(FAULT_AT_US + 500_000)
    zero = first_word(robot, FAULT_AT_US, LOST_US)
    turning = [abs(robot.world.state(motor)[0]) for motor in range(1, 4)]
    must(max(turning) < STANDS_RPM, f"the other wheels turn with {turning} rpm 500 ms after the motor was lost")
    return {"zero_us": zero, "stale": len(robot.stale(FAULT_AT_US)), "note": "the other wheels brake"}


@row("F15")
def power_loss(robot):
    """The first ESC has no supply for 130 ms while its motor turns, and starts afresh: no current until it is armed again."""
    driving(robot)
    back = FAULT_AT_US + 130_000
    robot.world.fault("power", 0, FAULT_AT_US, back)
    robot.run(back + 40_000)
    word = [frame for frame in robot.commands(FAULT_AT_US) if any(frame.data[:2])]
    last = word[-1].us if word else FAULT_AT_US
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - FAULT_AT_US
    must(zero < LOST_US, f"its word is zero after {zero:.0f} us only")
    must(not any(any(frame.data[:2]) for frame in robot.commands(back)), "it is driven though nobody armed it again")
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests when heard again"}


@row("F19")
def esc_error(robot):
    """The first ESC reports that its position sensor sends nothing (code 4)."""
    driving(robot)
    robot.world.fault("code:4", 0, FAULT_AT_US, FAULT_AT_US + 40_000)
    robot.run(FAULT_AT_US + 60_000)
    words = [frame.us for frame in robot.commands(FAULT_AT_US) if any(frame.data[:2])]
    last = words[-1] if words else FAULT_AT_US
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - FAULT_AT_US
    must(zero < 3 * CYCLE_US + 300, f"its word is zero after {zero:.0f} us only")
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests until armed again"}


def _broken_feedback(robot, kind, note):
    """The feedback of the first motor is of no use for 60 ms: it counts as silent."""
    driving(robot)
    robot.world.fault(kind, 0, FAULT_AT_US, FAULT_AT_US + 60_000)
    robot.run(FAULT_AT_US + 30_000)
    zero = first_word(robot, FAULT_AT_US, LOST_US)
    return {"zero_us": zero, "stale": len(robot.stale(FAULT_AT_US)), "note": note}


@row("F01")
def short_frames(robot):
    """The feedback of the first motor has seven bytes."""
    return _broken_feedback(robot, "length:7", "refused; as silent")


@row("F06")
def wrong_angle(robot):
    """The angle in the feedback of the first motor is 9000."""
    return _broken_feedback(robot, "angle:9000", "refused; as silent")


@row("F25")
def all_silent(robot):
    """No motor is heard for 110 ms."""
    driving(robot)
    for motor in range(len(robot.program.things)):
        robot.world.fault("silent", motor, FAULT_AT_US, FAULT_AT_US + 110_000)
    robot.run(FAULT_AT_US + 130_000)
    result = rested(robot, FAULT_AT_US, LOST_US, "zeros go on being sent; at rest until armed again")
    rests(robot, FAULT_AT_US + LOST_US, FAULT_AT_US + 130_000)
    return result


@row("F24")
def short_silence(robot):
    """The first motor is silent for 30 ms: late, not lost. Its word is zero, and it goes on by itself."""
    driving(robot)
    robot.world.fault("silent", 0, FAULT_AT_US, FAULT_AT_US + 30_000)
    robot.run(FAULT_AT_US + 30_000)
    zero = first_word(robot, FAULT_AT_US, LOST_US)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 60_000, "goes on by itself") | {"zero_us": zero}


def _esc_reports(robot, code):
    driving(robot)
    robot.world.fault(f"code:{code}", 0, FAULT_AT_US, FAULT_AT_US + 20_000)
    robot.run(FAULT_AT_US + 40_000)
    zero = first_word(robot, FAULT_AT_US, REPORTED_US)
    return {"zero_us": zero, "stale": len(robot.stale(FAULT_AT_US)), "note": "rests until armed again"}


@row("F19")
def esc_voltage(robot):
    """The first ESC reports a supply that is too high (code 2)."""
    return _esc_reports(robot, 2)


@row("F19")
def esc_phase(robot):
    """The first ESC reports a phase that is open (code 3)."""
    return _esc_reports(robot, 3)


@row("F19")
def esc_unlisted(robot):
    """The first ESC reports a code that no list has (77)."""
    return _esc_reports(robot, 77)


@row("F19")
def esc_warning(robot):
    """The first ESC warns of its temperature (code 8)."""
    driving(robot)
    robot.world.fault("code:8", 0, FAULT_AT_US, FAULT_AT_US + 20_000)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 35_000, "goes on")


@row("F18")
def hot_motor(robot):
    """The first motor is at 185 C, beyond its limit: no output; below the warning again, it goes on."""
    driving(robot)
    robot.world.heat(0, 185)
    robot.run(FAULT_AT_US + 25_000)
    zero = first_word(robot, FAULT_AT_US, REPORTED_US)
    robot.world.heat(0, 60)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 50_000, "no output while hot; goes on by itself") | {"zero_us": zero}


@row("F21")
def blocked_motor(robot):
    """The shaft of the first motor is held for 60 ms."""
    driving(robot)
    robot.world.fault("blocked", 0, FAULT_AT_US, FAULT_AT_US + 60_000)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 80_000, "goes on")


@row("F22", needs="remote")
def runaway(robot):
    """The first motor turns against its command: relaxed, and latched."""
    driving(robot)
    robot.world.fault("reversed", 0, FAULT_AT_US, FAULT_AT_US + 300_000)
    robot.run(FAULT_AT_US + 230_000)
    zero = first_word(robot, FAULT_AT_US, 200_000)
    return {"zero_us": zero, "stale": len(robot.stale(FAULT_AT_US)), "note": "rests until armed again"}


@row("F23")
def frozen_feedback(robot):
    """The first ESC repeats one frame for 60 ms."""
    driving(robot)
    robot.world.fault("frozen", 0, FAULT_AT_US, FAULT_AT_US + 60_000)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 80_000, "goes on")


@row("F07", "fresh", things=("motor m3508 8 can1",))
def foreign_esc(robot):
    """An ESC with the id 8, which the program does not know, is on the line from power-on."""
    driving(robot)
    return goes_on(robot, FAULT_AT_US - 100_000, FAULT_AT_US + 20_000, "counted apart; goes on")
