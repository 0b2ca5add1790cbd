"""What goes wrong on the board, one function a fault. Each returns what it measured, and raises if the program does wrong."""
from robots import ARM_AT_US, COMMAND, CYCLE_US, DRIVE_AT_US, FAULT_AT_US

# Feedback is lost after 10 ms; the tick that finds out comes at most a cycle later, its frame 0.3 ms after that.
LOST_US = 10_000 + CYCLE_US + 300
# The watchdogs of all programs: 20 ms, and 32 kHz in the model.
WATCHDOG_US = 20_000
# From reset to the first frame: clocks, drivers, the first tick.
START_US = 4_000
REMOTE_LOST_US = 100_000 + 14_000 + 10_000


class Wrong(Exception):
    """The program did what it must not do."""


def must(condition, text):
    if not condition:
        raise Wrong(text)


def start(robot):
    """Power-on, arming, driving: zeros first, nothing but zeros until it is armed."""
    busy = []
    for cycle in range(51):
        robot.at(FAULT_AT_US - 50_000 + cycle * CYCLE_US, lambda: busy.append((robot.core.busy, robot.core.interrupted)))
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
    last = busy[-1]
    return {
        "zero_us": frames[0].us,
        "stale": len(robot.stale()),
        "note": "zeros until it is armed",
        "figures": {
            "jitter_us": robot.jitter_us(FAULT_AT_US - 50_000, FAULT_AT_US),
            "mean": (last[0] - busy[0][0]) / 50,
            "busiest": max(after[0] - before[0] for before, after in zip(busy, busy[1:])),
            "interrupts": (last[1] - busy[0][1]) / 50,
        },
    }


def _driving(robot, until=FAULT_AT_US):
    robot.run(until)
    must(robot.driven(until - 3 * CYCLE_US, until), "it does not drive before the fault")


def _rests(robot, since, until):
    must(not robot.driven(since, until), f"it drives at {since / 1000:.1f} ms, though nobody armed it again")
    must(robot.commands(since, until), "no frames of zeros")


def _drives_again(robot, from_us):
    robot.arm_again(from_us)
    until = from_us + 300_000
    robot.run(until)
    must(robot.driven(until - 20_000, until), "it does not drive after it was armed again")


def pulled_plug(robot, pulled_us=150_000):
    """The plug of the line is out: what was held leaves when it is back, and then zeros."""
    _driving(robot)
    robot.wire.pull()
    back = FAULT_AT_US + pulled_us
    robot.run(back)
    must(not robot.commands(FAULT_AT_US, back), "a frame was acknowledged by nobody")
    must(robot.chip.can.is_error_passive(), "the controller is not error passive")
    robot.wire.plug()
    robot.run(back + 50_000)
    zero, held = robot.zero_after(back), len(robot.driven(back))
    must(zero is not None and zero < 2 * CYCLE_US, f"no zeros after {zero} us")
    must(held <= robot.held, f"{held} frames from before leave, {robot.held} are known")
    must(not robot.resets, "it was reset")
    _rests(robot, back + 5_000, back + 50_000)
    _drives_again(robot, back + 50_000)
    return {"zero_us": zero, "stale": held, "note": "from when the plug is back; drives again when armed again"}


def short_pull(robot):
    """The plug is out for 5 ms, shorter than it takes to lose the feedback: the robot goes on, with frames of now."""
    _driving(robot)
    robot.wire.pull()
    back = FAULT_AT_US + 5_000
    robot.run(back)
    robot.wire.plug()
    robot.run(back + 50_000)
    stale = robot.stale(back)
    must(len(stale) <= robot.held, f"{len(stale)} stale frames")
    must(robot.driven(back + 40_000), "it does not go on")
    return {"zero_us": None, "stale": len(stale), "note": "goes on"}


def silent_motor(robot):
    """The first motor is silent for 100 ms, and heard again: its word is zero in time, and stays zero until armed again."""
    _driving(robot)
    robot.world.fault("silent", 0, FAULT_AT_US, FAULT_AT_US + 100_000)
    robot.run(FAULT_AT_US + 200_000)
    word = [frame for frame in robot.commands(FAULT_AT_US) if any(frame.data[:2])]
    last = word[-1].us if word else FAULT_AT_US
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - FAULT_AT_US
    must(zero < LOST_US, f"its word is zero after {zero:.0f} us only")
    _drives_again(robot, FAULT_AT_US + 200_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests when heard again; drives again when armed again"}


def short_bus_off(robot):
    """The line is held at one level for 50 ms: bus-off. Feedback is late, not lost for good (100 ms), so the robot goes on."""
    _driving(robot)
    robot.wire.short(True)
    back = FAULT_AT_US + 50_000
    robot.run(back)
    must(robot.chip.can.counters.is_bus_off, "the controller is not bus-off")
    robot.wire.short(False)
    robot.run(back + 100_000)
    stale = robot.stale(back)
    must(len(stale) <= robot.held, f"{len(stale)} stale frames, {robot.held} are known")
    must(robot.driven(back + 90_000), "it does not go on")
    must(not robot.resets, "it was reset")
    return {"zero_us": None, "stale": len(stale), "note": "goes on by itself"}


def power_loss(robot):
    """The first ESC has no supply for 300 ms while its motor turns, and starts afresh: no current until it is armed again."""
    _driving(robot)
    back = FAULT_AT_US + 300_000
    robot.world.fault("power", 0, FAULT_AT_US, back)
    robot.run(back + 200_000)
    word = [frame for frame in robot.commands(FAULT_AT_US) if any(frame.data[:2])]
    last = word[-1].us if word else FAULT_AT_US
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - FAULT_AT_US
    must(zero < LOST_US, f"its word is zero after {zero:.0f} us only")
    _drives_again(robot, back + 200_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests when heard again; drives again when armed again"}


def flood(robot):
    """Another node fills the line with its most urgent frames for 150 ms: nobody else gets through."""
    _driving(robot)
    back = FAULT_AT_US + 150_000

    def fill():
        queue = robot.wire.others.get("foreign", ())
        for _ in range(20 - len(queue)):
            robot.wire.offer("foreign", 0x001, b"\xAA" * 8)
        if robot.clock.us() < back:
            robot.clock.after(robot.clock.cycles(CYCLE_US), fill)

    fill()
    robot.run(back + 100_000)
    # One frame may have been on the wire already; the flood ends up to 20 frames later.
    quiet = [frame for frame in robot.commands(FAULT_AT_US + 300, back)]
    must(not quiet, f"{len(quiet)} frames of ours went before more urgent ones")
    zero, stale = robot.zero_after(back), robot.stale(FAULT_AT_US)
    must(zero is not None and zero < 20 * 140 + 2 * CYCLE_US, f"no zeros after {zero} us")
    must(not stale, f"{len(stale)} stale frames")
    must(not robot.driven(back, back + 100_000), "it drives after the flood, though nobody armed it again")
    must(not robot.resets, "it was reset")
    _drives_again(robot, back + 100_000)
    return {"zero_us": zero, "stale": len(stale), "note": "from the end of the flood; drives again when armed again"}


def bus_off(robot):
    """The line is held at one level for 150 ms: the controller goes bus-off, and is back by itself, with zeros."""
    _driving(robot)
    robot.wire.short(True)
    back = FAULT_AT_US + 150_000
    robot.run(back)
    must(robot.chip.can.counters.is_bus_off, "the controller is not bus-off")
    robot.wire.short(False)
    robot.run(back + 100_000)
    must(not robot.chip.can.counters.is_bus_off, "the controller stays bus-off")
    zero, held = robot.zero_after(back), len(robot.driven(back))
    must(zero is not None and zero < 128 * 11 * 2 + 2 * CYCLE_US, f"no zeros after {zero} us")
    must(held <= robot.held, f"{held} frames from before leave, {robot.held} are known")
    _rests(robot, back + 10_000, back + 100_000)
    _drives_again(robot, back + 100_000)
    return {"zero_us": zero, "stale": held, "note": "from when the line is free; recovery included"}


def overrun(robot):
    """The core stands for 6 ms, as while its flash is erased: frames are lost in the controller, and the robot goes on."""
    _driving(robot)
    robot.core.stall_until = robot.clock.cycles(FAULT_AT_US + 6_000)
    robot.run(FAULT_AT_US + 60_000)
    lost = robot.chip.can.overruns
    must(lost > 0, "no frame was lost")
    must(not robot.resets, "it was reset")
    must(not robot.stale(FAULT_AT_US), "a stale frame left")
    must(robot.driven(FAULT_AT_US + 40_000), "it does not go on")
    return {"zero_us": None, "stale": 0, "note": "frames are lost in the controller; goes on"}


def esc_error(robot):
    """The first ESC reports that its position sensor sends nothing (code 4)."""
    _driving(robot)
    robot.world.fault("code:4", 0, FAULT_AT_US, FAULT_AT_US + 100_000)
    robot.run(FAULT_AT_US + 200_000)
    words = [frame.us for frame in robot.commands(FAULT_AT_US) if any(frame.data[:2])]
    last = words[-1] if words else FAULT_AT_US
    zeros = [frame.us for frame in robot.commands(last) if not any(frame.data[:2])]
    must(zeros, "its word never is zero")
    zero = zeros[0] - FAULT_AT_US
    must(zero < 3 * CYCLE_US + 300, f"its word is zero after {zero:.0f} us only")
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests until armed again"}


def second_master(robot):
    """Another node sends our command frames from power-on to 150 ms: arming is refused; a new gesture arms later."""
    def foreign():
        if robot.clock.us() < 150_000:
            robot.wire.offer("foreign", COMMAND, bytes(8))
            robot.clock.after(robot.clock.cycles(CYCLE_US), foreign)

    robot.at(20_000, foreign)
    robot.run(600_000)
    must(not robot.driven(0, 600_000), "it was armed beside a second master")
    # A second master counts as gone when it was not heard for a second.
    _drives_again(robot, 1_200_000)
    return {"zero_us": None, "stale": len(robot.stale()), "note": "arming refused; drives when armed a second after the last one"}


def dead_loop(robot):
    """The code of the control loop goes round for ever: the watchdog resets, zeros leave, nothing arms by itself."""
    _driving(robot)
    robot.hang_control()
    robot.run(FAULT_AT_US + 200_000)
    must(len(robot.resets) == 1 and robot.resets[0][1] == "watchdog", f"resets: {robot.resets}")
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < WATCHDOG_US + CYCLE_US + START_US, f"no zeros after {zero} us")
    _rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 200_000)
    _drives_again(robot, FAULT_AT_US + 200_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "reset by the watchdog; at rest until armed again"}


def brown_out(robot):
    """The supply of the board dips while it drives: a reset, zeros, nothing arms by itself though the key or switch stays."""
    _driving(robot)
    robot.reset("brown-out")
    robot.run(FAULT_AT_US + 200_000)
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < START_US, f"no zeros after {zero} us")
    _rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 200_000)
    must(len(robot.resets) == 1, f"resets: {robot.resets}")
    _drives_again(robot, FAULT_AT_US + 200_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "at rest until armed again"}


def remote_cut(robot):
    """The line of the remote control is cut in the middle of a frame."""
    _driving(robot)
    robot.remote.cut_after = 7
    robot.run(FAULT_AT_US + 300_000)
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < REMOTE_LOST_US, f"no zeros after {zero} us")
    _rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 300_000)
    # Heard again with the switch still at the top: nothing moves before it is turned anew.
    robot.remote.cut_after, robot.remote.is_heard = None, True
    robot.run(FAULT_AT_US + 400_000)
    _rests(robot, FAULT_AT_US + 310_000, FAULT_AT_US + 400_000)
    _drives_again(robot, FAULT_AT_US + 400_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "rests when heard again; drives again when armed again"}


def remote_noise(robot):
    """Two bits of each byte of the remote control are inverted: no frame is plausible."""
    _driving(robot)
    robot.remote.spoil = lambda place, byte: byte ^ 0x5A if place < 6 else byte
    robot.run(FAULT_AT_US + 300_000)
    zero = robot.zero_after(FAULT_AT_US)
    must(zero is not None and zero < REMOTE_LOST_US, f"no zeros after {zero} us")
    _rests(robot, FAULT_AT_US + zero + 1, FAULT_AT_US + 300_000)
    return {"zero_us": zero, "stale": len(robot.stale()), "note": "at rest"}


def imu_cut(robot):
    """The line of the IMU is cut in the middle of a frame while a stick is held: the robot stops until the sticks are let go."""
    robot.with_imu()
    _driving(robot)
    robot.imu.cut_after = 40
    robot.run(FAULT_AT_US + 800_000)
    speeds = [abs(robot.world.state(motor)[0]) for motor in range(4)]
    must(max(speeds) < 5, f"the wheels turn with {speeds} rpm, though the IMU is lost")
    # Heard again while the stick is still held: nothing moves before it is let go.
    robot.imu.cut_after = None
    robot.run(FAULT_AT_US + 1_200_000)
    speeds = [abs(robot.world.state(motor)[0]) for motor in range(4)]
    must(max(speeds) < 5, f"the wheels turn with {speeds} rpm before the stick is let go")
    robot.stick(0.0)
    robot.run(FAULT_AT_US + 1_300_000)
    robot.stick(0.5)
    robot.run(FAULT_AT_US + 1_600_000)
    must(abs(robot.world.state(0)[0]) > 20, "it does not drive after the stick was let go and pushed again")
    must(not robot.resets, "it was reset")
    return {"zero_us": None, "stale": len(robot.stale()), "note": "stands; drives when the stick is let go and pushed again"}


ALL = (start, pulled_plug, short_pull, silent_motor, power_loss, bus_off, short_bus_off, flood, overrun, esc_error, second_master, dead_loop, brown_out)
WITH_REMOTE = (remote_cut, remote_noise, imu_cut)


def of(program):
    return ALL + WITH_REMOTE if program.remote else ALL
