"""A USART that receives: a byte at a time or into a FIFO, overrun, parity, idle line. What is sent goes nowhere."""
from collections import deque

from .registers import Device

RXNE, IDLE, ORE, PE, FE, NOISE, TX_READY = 1 << 5, 1 << 4, 1 << 3, 1, 2, 4, 3 << 6
FIFO_ENABLE, FIFO_BYTES = 1 << 29, 16


class Usart(Device):
    """The registers of the STM32F4, or with `is_new` those of the STM32H7."""

    def __init__(self, clock, nvic, irq, is_new=False):
        super().__init__()
        self.clock, self.nvic, self.irq = clock, nvic, irq
        self.sr, self.dr, self.cr1, self.rdr, self.icr = (0x1C, None, 0x00, 0x24, 0x20) if is_new else (0x00, 0x04, 0x0C, None, None)
        # USART and receiver are switched on.
        self.on = 1 << 0 | 1 << 2 if is_new else 1 << 13 | 1 << 2
        self.flags, self.bytes, self.byte = TX_READY, deque(), 0
        self.idle = None
        self.overruns = 0

    def _line(self):
        control = self.values.get(self.cr1, 0)
        wanted = control & (RXNE | IDLE | TX_READY) | (ORE if control & RXNE else 0) | (PE if control & 0x100 else 0)
        self.nvic.set_line(self.irq, bool(self.flags & wanted))

    def receive(self, byte, errors=0, byte_us=115):
        """A byte arrives; `errors` are bits of the status register. The line is idle a byte later unless another one comes."""
        control = self.values.get(self.cr1, 0)
        if control & self.on != self.on:
            return
        if len(self.bytes) >= (FIFO_BYTES if self.rdr is not None and control & FIFO_ENABLE else 1):
            self.flags |= ORE
            self.overruns += 1
        else:
            odd = bin(byte).count("1") & 1
            self.bytes.append(byte | (odd << 8 if control & 0x1400 == 0x1400 else 0))
            self.flags |= RXNE | errors
        self.clock.cancel(self.idle)
        self.idle = self.clock.after(self.clock.cycles(byte_us), self._idle)
        self._line()

    def _idle(self):
        self.flags |= IDLE
        self._line()

    def read(self, offset):
        if offset == self.sr:
            return self.flags | (0x60_0000 if self.rdr is not None else 0)
        if offset == self.dr or offset == self.rdr:
            if self.bytes:
                self.byte = self.bytes.popleft()
            if not self.bytes:
                self.flags &= ~RXNE
            if self.rdr is None:
                self.flags &= ~(IDLE | ORE | PE | FE | NOISE)
            self._line()
            return self.byte
        return super().read(offset)

    def write(self, offset, value):
        if offset == self.icr:
            self.flags &= ~(value & (IDLE | ORE | PE | FE | NOISE))
        elif offset != self.sr and offset != self.dr:
            self.values[offset] = value
        self._line()
