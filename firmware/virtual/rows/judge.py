"""What a row is, and what it may say of a robot."""
from robots import ARM_AT_US, CYCLE_US, FAULT_AT_US

# Feedback is lost after 10 ms; the tick that finds out comes at most a cycle later, its frame 0.3 ms after that.
LOST_US = 10_000 + CYCLE_US + 300
# The watchdogs of all programs: 20 ms, and 32 kHz in the model.
WATCHDOG_US = 20_000
# From reset to the first frame: clocks, drivers, the first tick.
START_US = 4_000
REMOTE_LOST_US = 100_000 + 14_000 + 10_000
# A robot whose remote control is lost brakes for so long, and is disarmed then.
BRAKING_US = 1_000_000
# A wheel that is slower stands.
STANDS_RPM = 5

ROWS = []
"""Every row, in the order of the table."""


class Wrong(Exception):
    """The program did what it must not do."""


def row(number, setup="driven", needs="loop", things=()):
    """A function is a row. `number` is that of docs/faults.md, if it has one. It begins with a robot that drives, at the time
    of the fault, or from power-on (`setup="fresh"`), with an IMU that is heard (`"imu"`), or with more motors (`things`).
    `needs` is what the program has to have: `loop` is the bus of wheels that all but the machines have."""

    def register(function):
        function.number, function.setup, function.needs, function.things = number, setup, needs, things
        ROWS.append(function)
        return function

    return register


def of(program):
    """The rows of a program: those that need what it has."""
    return [row for row in ROWS if row.needs in program.has]


def must(condition, text):
    if not condition:
        raise Wrong(text)


def watched(robot, until):
    """Busy and interrupted cycles of the core at each cycle of the program, for the 50 ms before `until`."""
    busy = []
    for cycle in range(51):
        robot.at(until - 50_000 + cycle * CYCLE_US, lambda: busy.append((robot.core.busy, robot.core.interrupted)))
    return busy


def figures(busy, jitter_us):
    """The costs of a cycle, for the second table."""
    first, last = busy[0], busy[-1]
    return {
        "jitter_us": jitter_us,
        "mean": (last[0] - first[0]) / 50,
        "busiest": max(after[0] - before[0] for before, after in zip(busy, busy[1:])),
        "interrupts": (last[1] - first[1]) / 50,
    }


def driving(robot, until=FAULT_AT_US):
    robot.run(until)
    must(robot.driven(until - 3 * CYCLE_US, until), "it does not drive before the fault")


def rests(robot, since, until):
    must(not robot.driven(since, until), f"it drives at {since / 1000:.1f} ms, though nobody armed it again")
    must(robot.commands(since, until), "no frames of zeros")


def drives_again(robot, from_us):
    robot.arm_again(from_us)
    until = from_us + 300_000
    robot.run(until)
    must(robot.driven(until - 20_000, until), "it does not drive after it was armed again")


def goes_on(robot, since, until, note):
    """Runs to `until`: it drives there, was not reset, and nothing stale left since the fault."""
    robot.run(until)
    must(robot.driven(until - 10_000, until), "it does not go on")
    must(not robot.resets, "it was reset")
    stale = robot.stale(since)
    must(len(stale) <= robot.held, f"{len(stale)} stale frames")
    return {"zero_us": None, "stale": len(stale), "note": note}


def first_word(robot, since, limit_us):
    """How long until the word of the first motor is zero for good, in us."""
    word = [frame for frame in robot.commands(since) if any(frame.data[:2])]
    last = word[-1].us if word else since
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - since
    must(zero < limit_us, f"its word is zero after {zero:.0f} us only")
    return zero


def rested(robot, since, limit_us, note):
    """The first frame of zeros after which no other follows came in time, and nothing stale left."""
    zero, stale = robot.zero_after(since), robot.stale(since)
    must(zero is not None and zero < limit_us, f"no zeros after {zero} us")
    must(len(stale) <= robot.held, f"{len(stale)} stale frames")
    must(not robot.resets, "it was reset")
    return {"zero_us": zero, "stale": len(stale), "note": note}
