"""A board: chip, wire, motors; what happens to them, and what is measured."""
from collections import defaultdict

from .clock import Clock
from .core import Core
from .image import Image
from .nvic import Nvic
from .registers import Registers
from .wire import Wire
from .world import World


class Board:
    def __init__(self, chip, image, world, motors):
        self.chip_type, self.image = chip, Image(image)
        self.clock = Clock(chip.HZ)
        self.wires = [Wire(self.clock, "can1"), Wire(self.clock, "can2")]
        self.wire = self.wires[0]
        self.pins = []
        self.serial = defaultdict(list)
        """Who hears what the USART of that number sends."""
        self.resets = []
        self.nvic = self.registers = self.chip = self.core = None
        self._power_on()
        self.world = World(world, motors, self.clock, self.wires)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.world.close()

    def _power_on(self):
        if self.chip is not None:
            self.clock.cancel(self.chip.watchdog.event)
        self.nvic, self.registers = Nvic(self.chip_type.CPUID), Registers()
        self.chip = self.chip_type(self)
        chip = self.chip_type
        self.core = Core(self.image, chip.MODEL, chip.RAM, self.clock, self.nvic, self.registers, chip.RANGES)

    def bite(self):
        self.reset("watchdog")

    def reset(self, why):
        """All registers as after power-on. The RAM is lost: nothing in the programs survives a reset."""
        self.resets.append((self.clock.us(), why))
        self.nvic.reset_requested = True

    def at(self, us, action):
        self.clock.at(self.clock.cycles(us), action)

    def run(self, until_us):
        until = self.clock.cycles(until_us)
        while self.clock.now < until:
            self.core.run(until)
            if self.nvic.reset_requested:
                if not self.resets or self.resets[-1][0] != self.clock.us():
                    self.resets.append((self.clock.us(), "firmware"))
                self._power_on()

    def press(self, port, pin, level):
        inputs = self.chip.ports[port].inputs
        self.chip.ports[port].inputs = inputs | 1 << pin if level else inputs & ~(1 << pin)

    def sent(self, since=0.0, until=1e12, sender="board", wire=0):
        return [frame for frame in self.wires[wire].record if frame.sender == sender and since <= frame.us < until]
