"""The programs of firmware/boards on the virtual board: how each is armed and driven, and what is read off its pins."""
from board.board import Board
from board.chips import Stm32f407, Stm32h723
from board.imu import Imu
from board.pc import Pc
from board.remote import MIDDLE, UP, Remote
import machines

COMMAND = 0x200
CYCLE_US = 1000.0
# A frame that was made ready in its cycle leaves within the rest of it and a few frames of others.
FRESH_US = CYCLE_US + 300.0
ARM_AT_US, DRIVE_AT_US, FAULT_AT_US = 60_000, 110_000, 250_000


class Program:
    def __init__(self, name, package, chip, things, remote=None, key=None, held=0, control=None, transmit_irq=None, debug_port=None):
        self.name, self.package, self.chip, self.remote, self.key = name, package, chip, remote, key
        # Frames that may still leave when the line is back, and the interrupt in which the control loop runs.
        self.held, self.control = held, control
        self.things = things
        # The interrupts of its CAN controller; embassy's driver has a queue that the one for sending empties.
        self.receive_irqs = (19, 21) if chip is Stm32h723 else (20, 21)
        self.transmit_irq, self.debug_port = transmit_irq, debug_port
        self.has = {"loop", "remote" if remote else "key"} | ({"transmit irq"} if transmit_irq else set())
        self.has |= {"debug port"} if debug_port else set()
        # embassy serves both directions of an FDCAN in one interrupt: where it is not served, no frame of zeros leaves either.
        if chip is not Stm32h723:
            self.has.add("receive irq")
        self.fault_at_us = FAULT_AT_US

    def robot(self, builds, world, row):
        """From power-on, with what the row has beside it."""
        return Robot(self, builds, world, row.things, row.setup == "imu")


def wheels(count):
    return [f"motor m3508 {place + 1} can1" for place in range(count)]


PROGRAMS = {
    program.name: program
    for program in (
        Program("one-motor", "c-board-embassy", Stm32f407, wheels(1), key=("A", 0), transmit_irq=19),
        Program("c-board-embassy", "c-board-embassy", Stm32f407, wheels(4), remote=3, transmit_irq=19, debug_port=6),
        Program("c-board-rtic", "c-board-rtic", Stm32f407, wheels(4), remote=3, control=7),
        Program("dm-mc02-embassy", "dm-mc02-embassy", Stm32h723, wheels(4), remote=5),
        machines.Sentry,
        machines.Snake,
        machines.CheckEmbassy,
        machines.CheckHal,
        machines.CheckH7,
    )
}


class Robot(Board):
    """A board with its program, that is armed at 60 ms and asked to drive."""

    def __init__(self, program, builds, world, things=(), has_imu=False):
        self.program = program
        self.held = program.held
        super().__init__(program.chip, f"{builds}/{program.name}", world, [*program.things, *things])
        self.remote = Remote(self, program.remote) if program.remote else None
        self.pc = Pc(self, program.debug_port) if program.debug_port else None
        # All boards have the IMU on USART1.
        self.imu = Imu(self, 1) if has_imu else None
        self.at(ARM_AT_US, lambda: self.ask_to_arm(True))
        if self.remote:
            self.at(DRIVE_AT_US, lambda: self.stick(0.5))

    def ask_to_arm(self, is_asked):
        if self.program.key:
            self.press(*self.program.key, 0 if is_asked else 1)
        else:
            self.remote.switch = UP if is_asked else MIDDLE

    def arm_again(self, at_us):
        """Lets go, waits for longer than the 100 ms that a new gesture needs, and asks again; then the stick as before."""
        self.at(at_us, lambda: self.ask_to_arm(False))
        if self.remote:
            self.at(at_us, lambda: self.stick(0.0))
            self.at(at_us + 200_000, lambda: self.stick(0.5))
        self.at(at_us + 150_000, lambda: self.ask_to_arm(True))

    def hang_control(self):
        self.core.hang(self.program.control)

    def stick(self, share):
        self.remote.channels[1] = share

    def commands(self, since=0.0, until=1e12):
        return [frame for frame in self.sent(since, until) if frame.id == COMMAND]

    def driven(self, since=0.0, until=1e12):
        """The frames with a word that is not zero."""
        return [frame for frame in self.commands(since, until) if any(frame.data)]

    def first(self, frames):
        return frames[0].us if frames else None

    def zero_after(self, since):
        """How long after `since` the first frame of zeros leaves that no other frame follows, in us."""
        driven = self.driven(since)
        last = driven[-1].us if driven else since
        zeros = [frame for frame in self.commands(last) if not any(frame.data)]
        return zeros[0].us - since if zeros else None

    def stale(self, since=0.0):
        """Frames that drive and left later than a cycle after they were in the controller."""
        return [frame for frame in self.driven(since) if frame.us - frame.born > FRESH_US]

    def jitter_us(self, since, until):
        """The largest difference between the time of two commands that follow each other and a cycle."""
        ready = [frame.born for frame in self.driven(since, until)]
        return max(abs(after - before - CYCLE_US) for before, after in zip(ready, ready[1:]))
