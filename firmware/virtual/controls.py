"""Defects that the rows have to find: each is planted into one row, which then has to fail. `run --controls` plants them."""
import struct

from rows import Wrong, board, line, motors, operator, sentry, snake
from board.bxcan import TSR, BxCan
from board.fdcan import TXBCR
from robots import FAULT_AT_US, PROGRAMS

FEEDBACK_LOST_US, LATE_US = struct.pack("<I", 10_000), struct.pack("<I", 60_000)


def late_deadline(robot):
    """The image itself is patched: the 10 ms after which feedback is lost, a constant of the safety core, are 60 ms."""
    found = [at + data.index(FEEDBACK_LOST_US) for at, data in robot.image.segments if FEEDBACK_LOST_US in data]
    assert found, "the constant is not in the image"
    for address in found:
        robot.core.uc.mem_write(address, LATE_US)


def deaf_to_abort(robot):
    """The controller ignores requests to abort."""
    can, write = robot.chip.can, robot.chip.can.write
    deaf = {TSR: ~0x80_8080} if isinstance(can, BxCan) else {TXBCR: 0}
    can.write = lambda offset, value: write(offset, value & deaf.get(offset, ~0))


def holds_commands(robot):
    """The line shows the last command that drove in the place of zeros, as of a program that never takes one back."""
    can, candidate, last = robot.chip.can, robot.chip.can.candidate, [None]

    def held():
        frame = candidate()
        if frame is None:
            return None
        identifier, data, born, box = frame
        last[0] = data if any(data) else last[0]
        return identifier, last[0] or data, born, box

    can.candidate = held


def no_watchdog(robot):
    """The watchdog does not bite."""
    robot.chip.watchdog.bite = lambda: None


def arms_by_itself(robot):
    """The program behaves as if its key were pressed anew after a reset."""
    robot.at(FAULT_AT_US + 30_000, lambda: robot.ask_to_arm(False))
    robot.at(FAULT_AT_US + 60_000, lambda: robot.ask_to_arm(True))


def starts_with_a_current(robot):
    """The first frame is not zero."""
    can, candidate = robot.chip.can, robot.chip.can.candidate

    def spoilt():
        frame = candidate()
        return frame and (frame[0], b"\x01" + frame[1][1:], *frame[2:])

    can.candidate = spoilt


def deaf_dma(robot):
    """The DMA controllers move nothing from 350 ms on."""
    def stop():
        for dma in robot.chip.dmas:
            dma.serve = lambda request: None

    robot.at(350_000, stop)


def holds_disables(robot):
    """The line shows questions in the place of frames that disable a joint."""
    can, candidate = robot.chip.can, robot.chip.can.candidate

    def held():
        frame = candidate()
        return frame and (frame[0], b"\x03\x07", *frame[2:]) if frame and frame[1] == snake.DISABLE else frame

    can.candidate = held


PLANTS = (
    ("one-motor", motors.silent_motor, late_deadline),
    ("one-motor", line.pulled_plug, deaf_to_abort),
    ("one-motor", line.short_pull, deaf_to_abort),
    ("dm-mc02-embassy", line.pulled_plug, deaf_to_abort),
    ("one-motor", motors.silent_motor, holds_commands),
    ("c-board-embassy", operator.remote_cut, holds_commands),
    ("c-board-rtic", board.dead_loop, no_watchdog),
    ("one-motor", board.brown_out, arms_by_itself),
    ("c-board-embassy", board.start, starts_with_a_current),
    ("sentry", sentry.closed_loop, deaf_dma),
    ("sentry", sentry.sentry_dead_loop, no_watchdog),
    ("snake", snake.host_cut, holds_disables),
)


def plant(task):
    """Returns what the row said of the defect; `None` if it said nothing."""
    place, builds, world = task
    name, row, defect = PLANTS[place]
    with PROGRAMS[name].robot(builds, world, row) as robot:
        defect(robot)
        try:
            row(robot)
        except Wrong as error:
            return str(error)
    return None
