"""What goes wrong on the line and in the controller."""
from robots import COMMAND, CYCLE_US, FAULT_AT_US
from rows.judge import drives_again, driving, goes_on, must, rested, rests, row


@row("F54")
def pulled_plug(robot, pulled_us=115_000):
    """The plug of the line is out: what was held leaves when it is back, and then zeros."""
    driving(robot)
    robot.wire.pull()
    back = FAULT_AT_US + pulled_us
    robot.run(back)
    must(not robot.commands(FAULT_AT_US, back), "a frame was acknowledged by nobody")
    must(robot.chip.can.is_error_passive(), "the controller is not error passive")
    robot.wire.plug()
    robot.run(back + 20_000)
    zero, held = robot.zero_after(back), len(robot.driven(back))
    must(zero is not None and zero < 2 * CYCLE_US, f"no zeros after {zero} us")
    must(held <= robot.held, f"{held} frames from before leave, {robot.held} are known")
    must(not robot.resets, "it was reset")
    rests(robot, back + 5_000, back + 20_000)
    drives_again(robot, back + 20_000)
    return {"zero_us": zero, "stale": held, "note": "from when the plug is back; drives again when armed again"}


@row("F54")
def short_pull(robot):
    """The plug is out for 5 ms, shorter than it takes to lose the feedback: the robot goes on, with frames of now."""
    driving(robot)
    robot.wire.pull()
    back = FAULT_AT_US + 5_000
    robot.run(back)
    robot.wire.plug()
    robot.run(back + 30_000)
    stale = robot.stale(back)
    must(len(stale) <= robot.held, f"{len(stale)} stale frames")
    must(robot.driven(back + 20_000), "it does not go on")
    return {"zero_us": None, "stale": len(stale), "note": "goes on"}


@row("F54")
def bus_off(robot):
    """The line is held at one level for 115 ms: the controller goes bus-off, and is back by itself, with zeros."""
    driving(robot)
    robot.wire.short(True)
    back = FAULT_AT_US + 115_000
    robot.run(back)
    must(robot.chip.can.counters.is_bus_off, "the controller is not bus-off")
    robot.wire.short(False)
    robot.run(back + 40_000)
    must(not robot.chip.can.counters.is_bus_off, "the controller stays bus-off")
    zero, held = robot.zero_after(back), len(robot.driven(back))
    must(zero is not None and zero < 128 * 11 * 2 + 2 * CYCLE_US, f"no zeros after {zero} us")
    must(held <= robot.held, f"{held} frames from before leave, {robot.held} are known")
    rests(robot, back + 10_000, back + 40_000)
    return {"zero_us": zero, "stale": held, "note": "from when the line is free; recovery included"}


@row("F54")
def short_bus_off(robot):
    """The line is held at one level for 50 ms: bus-off. Feedback is late, not lost for good (100 ms), so the robot goes on."""
    driving(robot)
    robot.wire.short(True)
    back = FAULT_AT_US + 50_000
    robot.run(back)
    must(robot.chip.can.counters.is_bus_off, "the controller is not bus-off")
    robot.wire.short(False)
    robot.run(back + 60_000)
    stale = robot.stale(back)
    must(len(stale) <= robot.held, f"{len(stale)} stale frames, {robot.held} are known")
    must(robot.driven(back + 50_000), "it does not go on")
    must(not robot.resets, "it was reset")
    return {"zero_us": None, "stale": len(stale), "note": "goes on by itself"}


@row("F54")
def three_bus_offs(robot):
    """Bus-off three times, for 20 ms each, 30 ms apart: the controller recovers each time, and the robot goes on."""
    driving(robot)
    for place in range(3):
        since = FAULT_AT_US + place * 50_000
        robot.at(since, lambda: robot.wire.short(True))
        robot.at(since + 20_000, lambda: robot.wire.short(False))
    result = goes_on(robot, FAULT_AT_US, FAULT_AT_US + 180_000, "recovers each time; goes on by itself")
    must(robot.chip.can.counters.times_bus_off == 3, f"{robot.chip.can.counters.times_bus_off} bus-offs")
    return result


@row("F53")
def disturbed(robot):
    """Each 3 ms the line is disturbed for 40 us: frames are destroyed and repeated, far from bus-off."""
    driving(robot)
    for place in range(14):
        since = FAULT_AT_US + place * 3_070
        robot.at(since, lambda: robot.wire.short(True))
        robot.at(since + 40, lambda: robot.wire.short(False))
    attempts, frames = robot.wire.attempts, len(robot.sent())
    result = goes_on(robot, FAULT_AT_US, FAULT_AT_US + 70_000, "frames are repeated; goes on")
    must(robot.wire.attempts - attempts > len(robot.sent()) - frames, "no frame was destroyed")
    must(not robot.chip.can.counters.times_bus_off, "it went bus-off")
    return result


@row("F55")
def flood(robot):
    """Another node fills the line with its most urgent frames for 115 ms: nobody else gets through."""
    driving(robot)
    back = FAULT_AT_US + 115_000

    def fill():
        queue = robot.wire.others.get("foreign", ())
        for _ in range(20 - len(queue)):
            robot.wire.offer("foreign", 0x001, b"\xAA" * 8)
        if robot.clock.us() < back:
            robot.clock.after(robot.clock.cycles(CYCLE_US), fill)

    fill()
    robot.run(back + 40_000)
    # One frame may have been on the wire already; the flood ends up to 20 frames later.
    quiet = [frame for frame in robot.commands(FAULT_AT_US + 300, back)]
    must(not quiet, f"{len(quiet)} frames of ours went before more urgent ones")
    zero, stale = robot.zero_after(back), robot.stale(FAULT_AT_US)
    must(zero is not None and zero < 20 * 140 + 2 * CYCLE_US, f"no zeros after {zero} us")
    must(not stale, f"{len(stale)} stale frames")
    must(not robot.driven(back, back + 40_000), "it drives after the flood, though nobody armed it again")
    must(not robot.resets, "it was reset")
    return {"zero_us": zero, "stale": len(stale), "note": "from the end of the flood; at rest until armed again"}


def _others(robot, identifier, period_us, until):
    def offer():
        robot.wire.offer("foreign", identifier, b"\xAA" * 8)
        if robot.clock.us() < until:
            robot.clock.after(robot.clock.cycles(period_us), offer)

    offer()


@row("F55")
def busy_line(robot):
    """Another node sends an urgent frame each 400 us: ours lose the arbitration, and go between them."""
    driving(robot)
    _others(robot, 0x010, 400, FAULT_AT_US + 50_000)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 70_000, "arbitration is lost now and then; goes on")


@row("F55")
def calm_flood(robot):
    """Another node fills the line with its least urgent frames: ours go before them."""
    driving(robot)

    def fill():
        for _ in range(4 - len(robot.wire.others.get("foreign", ()))):
            robot.wire.offer("foreign", 0x7FF, b"\xAA" * 8)
        if robot.clock.us() < FAULT_AT_US + 40_000:
            robot.clock.after(robot.clock.cycles(300), fill)

    fill()
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 60_000, "ours go first; goes on")


@row("F04")
def unknown_ids(robot):
    """Another node sends frames of ids that nobody knows, 3000 a second."""
    driving(robot)
    _others(robot, 0x3A5, 333, FAULT_AT_US + 40_000)
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 60_000, "goes on")


@row("F12")
def overrun(robot):
    """The core stands for 6 ms, as while its flash is erased: frames are lost in the controller, and the robot goes on."""
    driving(robot)
    robot.core.stall_until = robot.clock.cycles(FAULT_AT_US + 6_000)
    robot.run(FAULT_AT_US + 50_000)
    lost = robot.chip.can.overruns
    must(lost > 0, "no frame was lost")
    must(not robot.resets, "it was reset")
    must(not robot.stale(FAULT_AT_US), "a stale frame left")
    must(robot.driven(FAULT_AT_US + 40_000), "it does not go on")
    return {"zero_us": None, "stale": 0, "note": "frames are lost in the controller; goes on"}


@row("F05", "fresh")
def second_master(robot):
    """Another node sends our command frames from power-on to 150 ms: arming is refused; a new gesture arms later."""
    def foreign():
        if robot.clock.us() < 150_000:
            robot.wire.offer("foreign", COMMAND, bytes(8))
            robot.clock.after(robot.clock.cycles(CYCLE_US), foreign)

    robot.at(20_000, foreign)
    robot.run(300_000)
    must(not robot.driven(0, 300_000), "it was armed beside a second master")
    # A second master counts as gone when it was not heard for a second.
    drives_again(robot, 1_100_000)
    return {"zero_us": None, "stale": len(robot.stale()), "note": "arming refused; drives when armed a second after the last one"}


@row("F05")
def late_master(robot):
    """Another node sends zeros with our command id, each 3 ms, to a robot that drives."""
    driving(robot)

    def foreign():
        robot.wire.offer("foreign", COMMAND, bytes(8))
        if robot.clock.us() < FAULT_AT_US + 60_000:
            robot.clock.after(robot.clock.cycles(3 * CYCLE_US), foreign)

    foreign()
    return goes_on(robot, FAULT_AT_US, FAULT_AT_US + 80_000, "an edge; goes on, as configured")


@row("F49", "fresh")
def plugged_late(robot):
    """The plug is out at power-on, and in at 40 ms: arming at 60 ms is granted, and it drives."""
    robot.wire.pull()
    robot.run(40_000)
    must(not robot.commands(), "a frame was acknowledged by nobody")
    robot.wire.plug()
    robot.run(170_000)
    frames = robot.commands()
    must(not any(frames[0].data), "the first frame is not zero")
    must(robot.driven(160_000), "it does not drive")
    return {"zero_us": frames[0].us - 40_000, "stale": len(robot.stale()), "note": "zeros first; drives when armed"}


@row("F12", needs="receive irq")
def receive_starved(robot):
    """The receive interrupts of the controller are not served for 50 ms."""
    driving(robot)
    robot.nvic.mask(robot.program.receive_irqs)
    back = FAULT_AT_US + 50_000
    robot.run(back)
    must(robot.chip.can.overruns > 0, "no frame was lost")
    zeros = [frame.us for frame in robot.commands(FAULT_AT_US, back) if not any(frame.data)]
    must(zeros and zeros[0] - FAULT_AT_US < 15_000, "no zeros while nothing is heard")
    robot.nvic.mask()
    result = goes_on(robot, FAULT_AT_US, back + 40_000, "zeros while nothing is heard; goes on by itself")
    return result | {"zero_us": zeros[0] - FAULT_AT_US}


def _distance(frame, other):
    """Between the words of two commands."""
    words = [[int.from_bytes(data[place : place + 2], "big", signed=True) for place in (0, 2, 4, 6)] for data in (frame.data, other.data)]
    return sum(abs(one - another) for one, another in zip(*words))


@row("-", needs="transmit irq")
def transmit_starved(robot):
    """The transmit interrupt of the controller is not served for 50 ms: a queue before it stands."""
    driving(robot)
    robot.nvic.mask((robot.program.transmit_irq,))
    back = FAULT_AT_US + 50_000
    robot.run(back)
    robot.nvic.mask()
    result = goes_on(robot, FAULT_AT_US, FAULT_AT_US + 90_000, "the frame before the mailboxes leaves, then a fresh one; goes on")
    # The queue of the driver takes one frame, which waits there since the interrupt was last served; the mailboxes do not know its age.
    # Its words are those of then: nearer to the last ones before the fault than to those of its successor.
    before, after = robot.commands(FAULT_AT_US - 5 * CYCLE_US, FAULT_AT_US)[-1], robot.commands(back, back + 5_000)
    old = [frame for frame, next_one in zip(after, after[1:]) if _distance(frame, before) < _distance(frame, next_one)]
    must(old == after[: len(old)] and len(old) <= 1, f"{len(old)} frames are from before")
    must(after[1].us - after[0].us < 1_500, f"the second frame follows the first after {after[1].us - after[0].us} us")
    return result | {"stale": len(old)}


@row("F54")
def reset_unplugged(robot):
    """The plug is pulled, and the supply dips while it is out: zeros when it is back, and nothing else."""
    driving(robot)
    robot.wire.pull()
    robot.at(FAULT_AT_US + 10_000, lambda: robot.reset("brown-out"))
    back = FAULT_AT_US + 40_000
    robot.run(back)
    robot.wire.plug()
    robot.run(back + 60_000)
    must(not robot.driven(back), "it drives after a reset")
    zero = robot.zero_after(back)
    must(zero is not None and zero < 2 * CYCLE_US, f"no zeros after {zero} us")
    rests(robot, back + 5_000, back + 60_000)
    return {"zero_us": zero, "stale": 0, "note": "from when the plug is back; at rest until armed again"}
