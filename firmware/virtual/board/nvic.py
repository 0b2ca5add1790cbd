"""Interrupt controller and system control block of a Cortex-M: pending, enabled, priorities, levels."""

IDLE = 0x100
"""The priority at which the core runs outside of any interrupt: below all others."""


class Nvic:
    """The page at 0xE000E000. Interrupt lines are levels; an interrupt is pended again when its line is still high at the return."""

    def __init__(self, cpuid):
        self.cpuid = cpuid
        self.enabled = 0
        self.pending = 0
        self.lines = 0
        self.priorities = {}
        self.system = {}
        self.active = []
        self.vtor = 0x0800_0000
        self.reset_requested = False
        self.event = False
        """The event register, which WFE waits for."""
        self.masked = ()
        """Interrupts that are not served, as if others took all the time."""
        self.best = None
        """The most urgent interrupt that is pending and enabled, with its priority first."""

    def set_line(self, irq, level):
        bit = 1 << irq
        if level:
            if not self.lines & bit:
                self.lines |= bit
                if irq not in self.active:
                    self.pending |= bit
                    self._judge()
        else:
            self.lines &= ~bit

    def _judge(self):
        waiting, best = self.pending & self.enabled, None
        while waiting:
            irq = (waiting & -waiting).bit_length() - 1
            waiting &= waiting - 1
            if irq in self.masked:
                continue
            candidate = (self.priorities.get(irq, 0), irq)
            if best is None or candidate < best:
                best = candidate
        self.best = best

    def mask(self, irqs=()):
        self.masked = irqs
        self._judge()

    def priority(self):
        """The priority at which the core runs now."""
        return min((self.priorities.get(irq, 0) for irq in self.active), default=IDLE)

    def enter(self):
        irq = self.best[1]
        self.pending &= ~(1 << irq)
        self.active.append(irq)
        self.event = True
        self._judge()
        return irq

    def leave(self):
        irq = self.active.pop()
        self.event = True
        if self.lines >> irq & 1:
            self.pending |= 1 << irq
        self._judge()

    def read(self, offset):
        if 0x100 <= offset < 0x200:
            return self.enabled >> 8 * (offset & 0x7C) & 0xFFFF_FFFF
        if 0x200 <= offset < 0x300:
            return self.pending >> 8 * (offset & 0x7C) & 0xFFFF_FFFF
        if 0x300 <= offset < 0x380:
            active = sum(1 << irq for irq in set(self.active))
            return active >> 8 * (offset & 0x7C) & 0xFFFF_FFFF
        if 0x400 <= offset < 0x500:
            return sum(self.priorities.get(offset - 0x400 + byte, 0) << 8 * byte for byte in range(4))
        if offset == 0xD00:
            return self.cpuid
        if offset == 0xD04:
            return self.active[-1] + 16 if self.active else 0
        if offset == 0xD08:
            return self.vtor
        return self.system.get(offset, 0)

    def write(self, offset, value):
        shifted = value << 8 * (offset & 0x7C)
        if 0x100 <= offset < 0x180:
            self.enabled |= shifted
        elif 0x180 <= offset < 0x200:
            self.enabled &= ~shifted
        elif 0x200 <= offset < 0x280:
            self.pending |= shifted
        elif 0x280 <= offset < 0x300:
            self.pending = self.pending & ~shifted | self.lines & shifted
        elif 0x400 <= offset < 0x500:
            for byte in range(4):
                self.priorities[offset - 0x400 + byte] = value >> 8 * byte & 0xF0
        elif offset == 0xD08:
            self.vtor = value
        elif offset == 0xD0C:
            self.reset_requested |= value >> 16 == 0x05FA and value >> 2 & 1 == 1
        else:
            self.system[offset] = value
            return
        self._judge()

    def write_narrow(self, offset, size, value):
        if 0x400 <= offset < 0x500:
            for byte in range(size):
                self.priorities[offset - 0x400 + byte] = value >> 8 * byte & 0xF0
            self._judge()
            return
        base, shift, mask = offset & ~3, 8 * (offset & 3), (1 << 8 * size) - 1
        self.write(base, self.read(base) & ~(mask << shift) | (value & mask) << shift)
