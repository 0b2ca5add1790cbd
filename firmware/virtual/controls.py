"""Defects that the rows have to find: each is planted into one row, which then has to fail. `run --controls` plants them."""
import struct

import scenarios
from board.bxcan import TSR, BxCan
from board.fdcan import TXBCR
from robots import FAULT_AT_US, PROGRAMS, Robot

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


PLANTS = (
    ("one-motor", scenarios.silent_motor, late_deadline),
    ("one-motor", scenarios.pulled_plug, deaf_to_abort),
    ("one-motor", scenarios.short_pull, deaf_to_abort),
    ("dm-mc02-embassy", scenarios.pulled_plug, deaf_to_abort),
    ("one-motor", scenarios.silent_motor, holds_commands),
    ("c-board-embassy", scenarios.remote_cut, holds_commands),
    ("c-board-rtic", scenarios.dead_loop, no_watchdog),
    ("one-motor", scenarios.brown_out, arms_by_itself),
    ("c-board-embassy", scenarios.start, starts_with_a_current),
)


def plant(task):
    """Returns what the row said of the defect; `None` if it said nothing."""
    place, builds, world = task
    name, scenario, defect = PLANTS[place]
    with Robot(PROGRAMS[name], builds, world) as robot:
        defect(robot)
        try:
            scenario(robot)
        except scenarios.Wrong as error:
            return str(error)
    return None
