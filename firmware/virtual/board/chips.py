"""The chips: which devices stand at which addresses, with which interrupts."""
from unicorn import arm_const as arm

from .bxcan import BxCan
from .chip_parts import Gpio, Ready, Watchdog
from .dma import Dma, Multiplexer
from .fdcan import FdCan, MessageRam
from .timer import Timer
from .usart import Usart


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
    # Name, address, interrupt. Those on APB2 have a clock of 84 MHz, the others of 42 MHz.
    USARTS = {
        1: ("USART1", 0x4001_1000, 37), 2: ("USART2", 0x4000_4400, 38), 3: ("USART3", 0x4000_4800, 39),
        4: ("UART4", 0x4000_4C00, 52), 5: ("UART5", 0x4000_5000, 53), 6: ("USART6", 0x4001_1400, 71),
    }
    # The core-coupled RAM at 0x1000_0000 is out of reach for the DMA controllers.
    DMA_REACH = ((0x0800_0000, 0x20_0000), (0x2000_0000, 0x3_0000))

    def __init__(self, board):
        clock, registers, nvic = board.clock, board.registers, board.nvic
        registers.add(0xE000_E000, nvic, 0x1000)
        for base, irq, is_wide in self.TIMERS:
            hz = 168_000_000 if base >= 0x4001_0000 else 84_000_000
            registers.add(base, Timer(clock, nvic, irq, hz, is_wide))
        self.usarts = {}
        self.dmas = [Dma(number, board, self.DMA_REACH) for number in (1, 2)]
        for dma, base in zip(self.dmas, (0x4002_6000, 0x4002_6400)):
            registers.add(base, dma)
        for place, (name, base, irq) in self.USARTS.items():
            self.usarts[place] = Usart(clock, nvic, irq, 84_000_000 if base >= 0x4001_0000 else 42_000_000)
            self.usarts[place].attach_dma(name, base, self.dmas)
            self.usarts[place].listeners = board.serial[place]
            registers.add(base, self.usarts[place])
        self.ports = {}
        for place in range(9):
            name = "ABCDEFGHI"[place]
            self.ports[name] = Gpio(name, clock, board.pins)
            registers.add(0x4002_0000 + 0x400 * place, self.ports[name])
        first, second = board.wires
        self.can = BxCan(clock, nvic, first, (19, 20, 21, 22))
        registers.add(0x4000_6400, self.can)
        self.can2 = BxCan(clock, nvic, second, (63, 64, 65, 66), master=self.can)
        registers.add(0x4000_6800, self.can2)
        self.watchdog = Watchdog(clock, board.bite)
        registers.add(0x4000_3000, self.watchdog)
        # RCC: HSI, HSE and PLL are ready when they are on, SWS follows SW, the LSI too.
        switched = {0x00: ((1, 2), (1 << 16, 1 << 17), (1 << 24, 1 << 25), (1 << 26, 1 << 27)), 0x70: ((1, 2),), 0x74: ((1, 2),)}
        follow = {0x08: lambda _, value: value & ~0xC | (value & 3) << 2}
        registers.add(0x4002_3800, Ready({0x00: 0x83}, switched, follow))
        # PWR: the regulator is ready, and over-drive (which the F427 has) when it is on.
        registers.add(0x4000_7000, Ready({0x00: 0xC000}, fixed={0x04: lambda device, _: 0x4000 | device.values[0x00] & 0x3_0000}))
        # DBGMCU: the chip.
        registers.add(0xE004_2000, Ready({0x00: 0x1007_6413}))


class Stm32f427(Stm32f407):
    """The chip of the development board A: two more serial ports, and more RAM."""

    RAM = ((0x2000_0000, 0x3_0000), (0x1000_0000, 0x1_0000))
    USARTS = Stm32f407.USARTS | {7: ("UART7", 0x4000_7800, 82), 8: ("UART8", 0x4000_7C00, 83)}


class Stm32h723:
    """What the program for the DM-MC02 reads and writes of its chip, with 400 MHz."""

    HZ = 400_000_000
    MODEL = arm.UC_CPU_ARM_CORTEX_M7
    RAM = ((0x0000_0000, 0x1_0000), (0x2000_0000, 0x2_0000), (0x2400_0000, 0x5_0000), (0x3000_0000, 0x8000), (0x3800_0000, 0x4000))
    RANGES = tuple((base, 0x10_0000) for base in (0x4000_0000, 0x4800_0000, 0x5200_0000, 0x5800_0000, 0x5C00_0000, 0xE000_0000))
    CPUID = 0x411F_C271
    # All count 200 MHz.
    TIMERS = (
        (0x4000_0000, 28, True), (0x4000_0400, 29, False), (0x4000_0800, 30, False), (0x4000_0C00, 50, True),
        (0x4000_1800, 43, False), (0x4000_1C00, 44, False), (0x4000_2000, 45, False), (0x4001_4000, 116, False),
        (0x4000_E000, 161, True), (0x4000_E400, 162, True),
    )
    USARTS = {1: ("USART1", 0x4001_1000, 37), 3: ("USART3", 0x4000_4800, 39), 5: ("UART5", 0x4000_5000, 53)}
    # Not the RAM beside the core.
    DMA_REACH = ((0x0800_0000, 0x20_0000), (0x2400_0000, 0x5_0000), (0x3000_0000, 0x8000))

    def __init__(self, board):
        clock, registers, nvic = board.clock, board.registers, board.nvic
        registers.add(0xE000_E000, nvic, 0x1000)
        for base, irq, is_wide in self.TIMERS:
            registers.add(base, Timer(clock, nvic, irq, 200_000_000, is_wide))
        self.usarts = {}
        multiplexer = Multiplexer()
        registers.add(0x4002_0800, multiplexer)
        self.dmas = [Dma(number, board, self.DMA_REACH, multiplexer) for number in (1, 2)]
        for dma, base in zip(self.dmas, (0x4002_0000, 0x4002_0400)):
            registers.add(base, dma)
        for place, (name, base, irq) in self.USARTS.items():
            self.usarts[place] = Usart(clock, nvic, irq, 100_000_000, is_new=True)
            self.usarts[place].attach_dma(name, base, self.dmas)
            self.usarts[place].listeners = board.serial[place]
            registers.add(base, self.usarts[place])
        self.ports = {}
        for place in range(11):
            name = "ABCDEFGHIJK"[place]
            self.ports[name] = Gpio(name, clock, board.pins)
            registers.add(0x5802_0000 + 0x400 * place, self.ports[name])
        ram = MessageRam()
        registers.add(0x4000_AC00, ram, 0x2800)
        self.can = FdCan(clock, nvic, board.wires[0], (19, 21), ram)
        registers.add(0x4000_A000, self.can)
        self.watchdog = Watchdog(clock, board.bite)
        registers.add(0x5800_4800, self.watchdog)
        # RCC: oscillators and PLLs are ready when they are on, SWS follows SW, the LSI too.
        ready = ((1, 4), (1 << 7, 1 << 8), (1 << 12, 1 << 13), (1 << 16, 1 << 17), (1 << 24, 1 << 25), (1 << 26, 1 << 27), (1 << 28, 1 << 29))
        follow = {0x10: lambda _, value: value & ~0x38 | (value & 7) << 3}
        registers.add(0x5802_4400, Ready({0x00: 0x25}, {0x00: ready, 0x74: ((1, 2),)}, follow))
        # PWR: the regulators are ready, at the scale that was asked for.
        registers.add(
            0x5802_4800,
            Ready(fixed={0x04: lambda device, _: 1 << 13 | device.values.get(0x18, 0) & 0xC000, 0x18: lambda _, value: value | 1 << 13}),
        )
        # DBGMCU: the chip.
        registers.add(0x5C00_1000, Ready({0x00: 0x1001_6483}))
