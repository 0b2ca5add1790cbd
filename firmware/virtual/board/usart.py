"""A USART: receives a byte at a time or into a FIFO, with overrun, parity and idle line; sends; both by interrupt or by DMA."""
from collections import deque

from .registers import Device

RXNE, IDLE, ORE, PE, FE, NOISE, TXE, TC = 1 << 5, 1 << 4, 1 << 3, 1, 2, 4, 1 << 7, 1 << 6
ERRORS = IDLE | ORE | PE | FE | NOISE
FIFO_ENABLE, FIFO_BYTES = 1 << 29, 16
TRANSMITTER, RECEIVER = 1 << 3, 1 << 2
ERROR_INTERRUPT, DMA_RECEIVES, DMA_SENDS = 1, 1 << 6, 1 << 7
# Two ends whose bit times differ by more do not understand each other.
TOLERANCE = 0.03


class Usart(Device):
    """The registers of the STM32F4, or with `is_new` those of the STM32H7. `hz` is its clock."""

    def __init__(self, clock, nvic, irq, hz, is_new=False):
        super().__init__()
        self.clock, self.nvic, self.irq, self.hz = clock, nvic, irq, hz
        new, old = (0x1C, None, 0x00, 0x08, 0x0C, 0x24, 0x28, 0x20), (0x00, 0x04, 0x0C, 0x14, 0x08, None, None, None)
        self.sr, self.dr, self.cr1, self.cr3, self.brr, self.rdr, self.tdr, self.icr = new if is_new else old
        self.enabled = 1 << 0 if is_new else 1 << 13
        self.flags, self.bytes, self.byte, self.seen = TXE | TC, deque(), 0, 0
        self.idle = None
        self.overruns = 0
        self.shifting = self.holding = None
        self.listeners = []
        """Called with each byte that was sent, and its baud rate."""
        self.serve = lambda request: None
        self.name = ""

    def attach_dma(self, name, address, controllers):
        """Requests of this name and the data registers at these addresses, on each controller."""
        self.name = name
        for dma in controllers:
            receive, send = address + (self.dr or self.rdr or 0), address + (self.dr or self.tdr or 0)
            dma.peripherals[f"{name}_RX"] = (self._has_byte, receive, self._take)
            dma.peripherals[f"{name}_TX"] = (self._wants_byte, send, self._send)
        self.serve = lambda request: [dma.serve(request) for dma in controllers]

    def _has_byte(self):
        return bool(self.flags & RXNE and self.values.get(self.cr3, 0) & DMA_RECEIVES)

    def _wants_byte(self):
        return bool(self.flags & TXE and self.values.get(self.cr3, 0) & DMA_SENDS)

    def baud(self):
        divider = self.values.get(self.brr, 0) & 0xFFFF
        if self.values.get(self.cr1, 0) & 1 << 15:
            return 2 * self.hz / max(1, divider & ~0xF | (divider & 7) << 1)
        return self.hz / max(1, divider)

    def _is_on(self, half):
        control = self.values.get(self.cr1, 0)
        return bool(control & self.enabled and control & half)

    def _line(self):
        control, third = self.values.get(self.cr1, 0), self.values.get(self.cr3, 0)
        wanted = control & (RXNE | IDLE | TXE | TC) | (ORE if control & RXNE else 0) | (PE if control & 0x100 else 0)
        if third & ERROR_INTERRUPT and (third & DMA_RECEIVES or self.rdr is not None):
            wanted |= ORE | FE | NOISE
        self.nvic.set_line(self.irq, bool(self.flags & wanted))

    def disturb(self, byte, baud):
        """A byte arrives whose stop bit is low."""
        self.receive(byte, baud, FE)

    def receive(self, byte, baud, errors=0):
        """A byte arrives; `errors` are bits of the status register. The line is idle a byte later unless another one comes."""
        if not self._is_on(RECEIVER):
            return
        if abs(baud / self.baud() - 1) > TOLERANCE:
            byte, errors = byte ^ 0xFF, errors | FE
        control = self.values.get(self.cr1, 0)
        if len(self.bytes) >= (FIFO_BYTES if self.rdr is not None and control & FIFO_ENABLE else 1):
            self.flags |= ORE
            self.overruns += 1
        else:
            odd = bin(byte).count("1") & 1
            self.bytes.append(byte | (odd << 8 if control & 0x1400 == 0x1400 else 0))
            self.flags |= RXNE | errors
        self.clock.cancel(self.idle)
        # A byte is heard at its end. One that began before the line was idle for a frame is heard within two, so that is when it shows.
        self.idle = self.clock.after(int(23 * self.clock.hz / baud), self._idle)
        if self._has_byte():
            self.serve(f"{self.name}_RX")
        self._line()

    def _idle(self):
        self.flags |= IDLE
        self._line()

    def _take(self):
        """Reads the data register. In the old one this also clears the errors that were seen in the status before."""
        if self.bytes:
            self.byte = self.bytes.popleft()
        if not self.bytes:
            self.flags &= ~RXNE
        if self.rdr is None:
            self.flags &= ~(self.seen & ERRORS)
            self.seen = 0
        self._line()
        return self.byte

    def _send(self, byte):
        self.flags &= ~TC
        if self.shifting is None:
            self._shift(byte)
        else:
            self.holding = byte
            self.flags &= ~TXE
        self._line()

    def _shift(self, byte):
        self.shifting = byte & 0xFF
        bits = 11 if self.values.get(self.cr1, 0) & 1 << 12 else 10
        self.clock.after(int(bits * self.clock.hz / self.baud()), self._shifted)

    def _shifted(self):
        byte, self.shifting = self.shifting, None
        is_on = self._is_on(TRANSMITTER)
        if self.holding is not None:
            held, self.holding = self.holding, None
            self._shift(held)
            self.flags |= TXE
        else:
            self.flags |= TC
        if is_on:
            for listener in self.listeners:
                listener(byte, self.baud())
        if self._wants_byte():
            self.serve(f"{self.name}_TX")
        self._line()

    def read(self, offset):
        if offset == self.sr:
            self.seen = self.flags
            return self.flags | (0x60_0000 if self.rdr is not None else 0)
        if offset == self.dr or offset == self.rdr:
            return self._take()
        return super().read(offset)

    def write_narrow(self, offset, _size, value):
        self.write(offset & ~3, value)

    def write(self, offset, value):
        if offset == self.icr:
            self.flags &= ~(value & (ERRORS | TC))
        elif offset == self.sr:
            if self.rdr is None:
                self.flags &= value | ~(TC | RXNE)
        elif offset == self.dr or offset == self.tdr:
            self._send(value)
        else:
            self.values[offset] = value
            if offset == self.cr3 and self._wants_byte():
                self.serve(f"{self.name}_TX")
            if offset == self.cr3 and self._has_byte():
                self.serve(f"{self.name}_RX")
        self._line()
