"""What is only ready, or only remembered: clocks, power, flash, pins; and the independent watchdog."""
from .registers import Device


class Ready(Device):
    """Registers in which some bits follow others at once: an oscillator that was switched on is ready."""

    def __init__(self, values=(), follows=(), fixed=()):
        super().__init__()
        self.values.update(values)
        self.follows, self.fixed = dict(follows), dict(fixed)

    def read(self, offset):
        value = self.values.get(offset, 0)
        for switch, ready in self.follows.get(offset, ()):
            value = value & ~ready | (ready if value & switch else 0)
        copy = self.fixed.get(offset)
        return copy(self, value) if copy else value


class Gpio(Device):
    """A port: outputs by ODR and BSRR with a record of each change, inputs as the scenario sets them."""

    def __init__(self, name, clock, log):
        super().__init__()
        self.name, self.clock, self.log = name, clock, log
        self.inputs = 0xFFFF

    def read(self, offset):
        if offset == 0x10:
            return self.inputs
        return super().read(offset)

    def write(self, offset, value):
        if offset == 0x18:
            old = self.values.get(0x14, 0)
            value, offset = old & ~(value >> 16) | value & 0xFFFF, 0x14
        if offset == 0x14:
            changed = self.values.get(0x14, 0) ^ value
            for pin in range(16):
                if changed >> pin & 1:
                    self.log.append((self.clock.us(), f"P{self.name}{pin}", value >> pin & 1))
        self.values[offset] = value


class Watchdog(Device):
    """IWDG: counts down at 32 kHz, and resets the chip at zero. Only a reset stops it."""

    def __init__(self, clock, bite):
        super().__init__()
        self.clock, self.bite = clock, bite
        self.values[0x08] = 0xFFF
        self.event = None
        self.pets = []

    def timeout_us(self):
        return (self.values[0x08] + 1) * (4 << (self.values.get(0x04, 0) & 7)) * 1e6 / 32_000

    def read(self, offset):
        return 0 if offset == 0x0C else super().read(offset)

    def write(self, offset, value):
        if offset != 0:
            self.values[offset] = value
            return
        if value == 0xAAAA:
            self.pets.append(self.clock.us())
        if value == 0xCCCC or value == 0xAAAA and self.event is not None:
            self.clock.cancel(self.event)
            self.event = self.clock.after(self.clock.cycles(self.timeout_us()), self.bite)
