"""A board: chip, wire, motors; what happens to them, and what is measured."""
from unicorn import arm_const as arm

from .bxcan import BxCan
from .chip_parts import Gpio, Ready, Watchdog
from .clock import Clock
from .core import Core
from .image import Image
from .nvic import Nvic
from .registers import Registers
from .timer import Timer
from .usart import Usart
from .wire import Wire
from .world import World


class Stm32f407:
    """What the programs for the development board C read and write of its chip."""

    HZ = 168_000_000
    MODEL = arm.UC_CPU_ARM_CORTEX_M4
    RAM = ((0x2000_0000, 0x2_0000), (0x1000_0000, 0x1_0000))
    RANGES = ((0x4000_0000, 0x10_0000), (0x5000_0000, 0x10_0000), (0xE000_0000, 0x10_0000))
    CPUID = 0x410F_C241
    # Address, interrupt, whether it is 32 bits wide. Those on APB2 count 168 MHz, the others 84 MHz.
    TIMERS = (
        (0x4000_0000, 28, True), (0x4000_0400, 29, False), (0x4000_0800, 30, False), (0x4000_0C00, 50, True),
        (0x4000_1800, 43, False), (0x4000_1C00, 44, False), (0x4000_2000, 45, False),
        (0x4001_4000, 24, False), (0x4001_4400, 25, False), (0x4001_4800, 26, False),
    )
    USARTS = {1: (0x4001_1000, 37), 2: (0x4000_4400, 38), 3: (0x4000_4800, 39), 6: (0x4001_1400, 71)}

    def __init__(self, board):
        clock, registers, nvic = board.clock, board.registers, board.nvic
        registers.add(0xE000_E000, nvic, 0x1000)
        for base, irq, is_wide in self.TIMERS:
            hz = 168_000_000 if base >= 0x4001_0000 else 84_000_000
            registers.add(base, Timer(clock, nvic, irq, hz, is_wide))
        self.usarts = {}
        for name, (base, irq) in self.USARTS.items():
            self.usarts[name] = Usart(clock, nvic, irq)
            registers.add(base, self.usarts[name])
        self.ports = {}
        for place in range(9):
            name = "ABCDEFGHI"[place]
            self.ports[name] = Gpio(name, clock, board.pins)
            registers.add(0x4002_0000 + 0x400 * place, self.ports[name])
        self.can = BxCan(clock, nvic, board.wire, (19, 20, 21, 22))
        registers.add(0x4000_6400, self.can)
        self.watchdog = Watchdog(clock, board.bite)
        registers.add(0x4000_3000, self.watchdog)
        # RCC: HSI, HSE and PLL are ready when they are on, SWS follows SW, the LSI too.
        switched = {0x00: ((1, 2), (1 << 16, 1 << 17), (1 << 24, 1 << 25), (1 << 26, 1 << 27)), 0x70: ((1, 2),), 0x74: ((1, 2),)}
        follow = {0x08: lambda _, value: value & ~0xC | (value & 3) << 2}
        registers.add(0x4002_3800, Ready({0x00: 0x83}, switched, follow))
        # PWR: the regulator is ready.
        registers.add(0x4000_7000, Ready({0x00: 0xC000}, fixed={0x04: lambda _, value: value | 0x4000}))
        # DBGMCU: the chip.
        registers.add(0xE004_2000, Ready({0x00: 0x1007_6413}))


class Board:
    def __init__(self, chip, image, world, motors):
        self.chip_type, self.image = chip, Image(image)
        self.clock = Clock(chip.HZ)
        self.wire = Wire(self.clock)
        self.pins = []
        self.resets = []
        self.nvic = self.registers = self.chip = self.core = None
        self._power_on()
        self.world = World(world, motors, self.clock, self.wire)

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

    def sent(self, since=0.0, until=1e12, sender="board"):
        return [frame for frame in self.wire.record if frame.sender == sender and since <= frame.us < until]
