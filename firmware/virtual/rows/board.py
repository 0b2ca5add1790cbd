"""What goes wrong on the board itself, and the board when nothing does."""
from robots import ARM_AT_US, CYCLE_US, FAULT_AT_US
from rows.judge import START_US, WATCHDOG_US, drives_again, driving, figures, goes_on, must, rested, rests, row, watched


@row("-", "fresh")
def start(robot):
    """Power-on, arming, driving: zeros first, nothing but zeros until it is armed."""
    busy = watched(robot, FAULT_AT_US)
    robot.run(FAULT_AT_US + 1)
    frames = robot.commands()
    must(frames and not any(frames[0].data), "the first frame is not zero")
    must(frames[0].us < START_US, f"the first frame came after {frames[0].us:.0f} us")
    must(not robot.driven(0, ARM_AT_US), "it drives before it was armed")
    moves = robot.driven(ARM_AT_US)
    must(moves, "it does not drive")
    must(robot.jitter_us(FAULT_AT_US - 50_000, FAULT_AT_US) < CYCLE_US / 4, "the cycle is not regular")
    rpm, _, _ = robot.world.state(0)
    must(abs(rpm) > 20, f"the motor turns with {rpm:.1f} rpm only")
    must(not robot.resets, "it was reset")
    return {
        "zero_us": frames[0].us,
        "stale": len(robot.stale()),
        "note": "zeros until it is armed",
        "figures": figures(busy, robot.jitter_us(FAULT_AT_US - 50_000, FAULT_AT_US)),
    }


@row("F27")
def dead_loop(robot):
    """The code of the control loop goes round for ever: the watchdog resets, zeros leave, nothing arms by itself."""
    driving(robot)
    robot.hang_control()
    robot.run(FAULT_AT_US + 60_000)
    must(len(robot.resets) == 1 and robot.resets[0][1] == "watchdog", f"resets: {robot.resets}")
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < WATCHDOG_US + CYCLE_US + START_US, f"no zeros after {zero} us")
    rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 60_000)
    drives_again(robot, FAULT_AT_US + 60_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "reset by the watchdog; at rest until armed again"}


@row("F27")
def brown_out(robot):
    """The supply of the board dips while it drives: a reset, zeros, nothing arms by itself though the key or switch stays."""
    driving(robot)
    robot.reset("brown-out")
    robot.run(FAULT_AT_US + 80_000)
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < START_US, f"no zeros after {zero} us")
    rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 80_000)
    must(len(robot.resets) == 1, f"resets: {robot.resets}")
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "at rest until armed again"}


@row("F27")
def three_resets(robot):
    """The supply dips three times, 15 ms apart: zeros after each, and nothing arms by itself."""
    driving(robot)
    for place in range(3):
        robot.at(FAULT_AT_US + place * 15_000, lambda: robot.reset("brown-out"))
    robot.run(FAULT_AT_US + 70_000)
    must(len(robot.resets) == 3, f"resets: {robot.resets}")
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < START_US + CYCLE_US, f"no zeros after {zero} us")
    rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 70_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "at rest until armed again"}


@row("F32")
def stalled(robot):
    """The core stands for 15 ms, shorter than the watchdog: as a debugger, or an interrupt that takes too long."""
    driving(robot)
    robot.core.stall_until = robot.clock.cycles(FAULT_AT_US + 15_000)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 50_000, "frames are lost; goes on")


@row("F27")
def dead_core(robot):
    """The core stands for 25 ms: the watchdog resets."""
    driving(robot)
    robot.core.stall_until = robot.clock.cycles(FAULT_AT_US + 25_000)
    robot.run(FAULT_AT_US + 60_000)
    must(len(robot.resets) == 1 and robot.resets[0][1] == "watchdog", f"resets: {robot.resets}")
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < WATCHDOG_US + CYCLE_US + START_US, f"no zeros after {zero} us")
    rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 60_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "reset by the watchdog; at rest until armed again"}
