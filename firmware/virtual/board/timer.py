"""A general-purpose timer that counts up: prescaler, reload, four compare channels, update and compare interrupts."""
from .registers import Device

CR1, DIER, SR, EGR, CCMR, CNT, PSC, ARR, CCR = 0x00, 0x0C, 0x10, 0x14, 0x18, 0x24, 0x28, 0x2C, 0x34


class Timer(Device):
    def __init__(self, clock, nvic, irq, hz, is_wide):
        super().__init__()
        self.clock, self.nvic, self.irq, self.hz = clock, nvic, irq, hz
        self.mask = 0xFFFF_FFFF if is_wide else 0xFFFF
        self.values[ARR] = self.mask
        self.divider = 1
        self.start = 0
        self.base = 0
        self.runs = False
        self.seen = 0
        self.flags = 0
        self.event = None

    def _ticks(self):
        if not self.runs:
            return self.base
        return self.base + (self.clock.now - self.start) * self.hz // (self.clock.hz * self.divider)

    def _restart(self, count):
        self.base, self.start, self.seen = count, self.clock.now, count

    def _step(self):
        """Raises the flags of what was passed since the last look, and plans the next look."""
        ticks, period = self._ticks(), self.values[ARR] + 1
        if ticks != self.seen:
            if ticks // period != self.seen // period:
                self.flags |= 1
            for channel in range(4):
                compare = self.values.get(CCR + 4 * channel, 0)
                if (ticks - compare) // period != (self.seen - compare) // period:
                    self.flags |= 2 << channel
            self.seen = ticks
        self._plan(ticks, period)
        self.nvic.set_line(self.irq, bool(self.flags & self.values.get(DIER, 0) & 0x1F))

    def _plan(self, ticks, period):
        self.clock.cancel(self.event)
        self.event = None
        wanted = self.values.get(DIER, 0) & 0x1F & ~self.flags
        if not self.runs or not wanted:
            return
        ways = [period - ticks % period] if wanted & 1 else []
        for channel in range(4):
            if wanted >> (1 + channel) & 1:
                compare = self.values.get(CCR + 4 * channel, 0)
                ways.append((compare - ticks - 1) % period + 1)
        target = ticks - self.base + min(ways)
        cycle = self.start + -(-target * self.clock.hz * self.divider // self.hz)
        self.event = self.clock.at(max(cycle, self.clock.now + 1), self._step)

    def read(self, offset):
        if offset == CNT:
            return self._ticks() % (self.values[ARR] + 1)
        if offset == SR:
            self._step()
            return self.flags
        return super().read(offset)

    def write(self, offset, value):
        self._step()
        if offset == SR:
            self.flags &= value
        elif offset == EGR:
            if value & 1:
                self.divider = (self.values.get(PSC, 0) & 0xFFFF) + 1
                self._restart(0)
                if not self.values.get(CR1, 0) & 4:
                    self.flags |= 1
            self.flags |= value & 0x1E
        elif offset == CNT:
            self._restart(value)
        elif offset == CR1:
            if bool(value & 1) != self.runs:
                ticks = self._ticks()
                self.runs = bool(value & 1)
                self._restart(ticks)
            self.values[CR1] = value
        else:
            self.values[offset] = value & self.mask if offset in (ARR,) or offset >= CCR else value
        self._step()
