"""FDCAN with classic frames: message RAM, buffers in queue or FIFO order, two FIFOs, cancel, errors. Registers as in RM0468."""
import struct

from .errors import PASSIVE, WARNING, ErrorCounters
from .registers import Device
from .wire import RECOVERY_BITS

CREL, ENDN, TEST, CCCR, TSCV, ECR, PSR, IR, IE, ILS, ILE = 0x00, 0x04, 0x10, 0x18, 0x24, 0x40, 0x44, 0x50, 0x54, 0x58, 0x5C
GFC, SIDFC, TXBC, TXFQS, TXBRP, TXBAR, TXBCR, TXBTO, TXBCF = 0x80, 0x84, 0xC0, 0xC4, 0xCC, 0xD0, 0xD4, 0xD8, 0xDC
TXBTIE = 0xE0
RXFC, RXFS, RXFA = (0xA0, 0xB0), (0xA4, 0xB4), (0xA8, 0xB8)
INIT, CCE, CSR, CSA = 1, 2, 1 << 4, 1 << 3
NEW, LOST, COMPLETE, CANCELLED, BUS_OFF = (1 << 0, 1 << 4), (1 << 3, 1 << 7), 1 << 9, 1 << 10, 1 << 25
ACKNOWLEDGE_ERROR, BIT_ERROR, UNCHANGED = 3, 5, 7
ELEMENT_BYTES = 72
"""Of a frame with room for 64 bytes, which is what embassy sets."""


class MessageRam(Device):
    def word(self, offset):
        return self.values.get(offset, 0)

    def words(self, offset, count):
        return [self.word(offset + 4 * at) for at in range(count)]


class Fifo:
    def __init__(self):
        self.get = self.put = self.fill = 0


class Pending:
    """A buffer whose frame is to be sent."""

    def __init__(self, place, order, born):
        self.place, self.order, self.born = place, order, born
        self.is_on_wire = self.is_cancelled = False


class FdCan(Device):
    def __init__(self, clock, nvic, wire, irqs, ram):
        super().__init__()
        self.clock, self.nvic, self.wire, self.irqs, self.ram = clock, nvic, wire, irqs, ram
        wire.controller = self
        self.values[CCCR] = INIT
        self.counters = ErrorCounters()
        self.fifos = (Fifo(), Fifo())
        self.pending = {}
        self.orders = 0
        self.overruns = 0
        self.code = UNCHANGED
        self.recovering = None

    # The side of the wire.

    def loops_back(self):
        return bool(self.values[CCCR] & 1 << 7 and self.values.get(TEST, 0) & 1 << 4)

    def is_silent(self):
        return bool(self.values[CCCR] & 1 << 5)

    def _is_running(self):
        return not self.values[CCCR] & INIT and not self.counters.is_bus_off

    def _element(self, pending):
        base = (self.values.get(TXBC, 0) & 0xFFFC) + ELEMENT_BYTES * pending.place
        header, control, *data = self.ram.words(base, 4)
        return header >> 18 & 0x7FF, struct.pack("<II", *data)[: min(control >> 16 & 0xF, 8)]

    def candidate(self):
        if not self._is_running():
            return None
        best = None
        is_queue = self.values.get(TXBC, 0) >> 30 & 1
        for pending in self.pending.values():
            identifier, data = self._element(pending)
            key = (identifier, pending.place) if is_queue else (pending.order, 0)
            if best is None or key < best[0]:
                best = (key, (identifier, data, pending.born, pending))
        return best and best[1]

    def holds(self, pending):
        return self.wire.controller is self and self.pending.get(pending.place) is pending

    def begins(self, pending):
        pending.is_on_wire = True

    def succeeded(self, pending):
        self.counters.succeeded()
        self.code = 0
        self._finish(pending, was_sent=True)

    def failed(self, pending, kind):
        pending.is_on_wire = False
        self.counters.failed(kind)
        self.code = ACKNOWLEDGE_ERROR if kind == "acknowledge" else BIT_ERROR
        if pending.is_cancelled:
            self._finish(pending, was_sent=False)
        if self.counters.is_bus_off and not self.values[CCCR] & INIT:
            # The controller stops; the program has to clear INIT.
            self.values[CCCR] |= INIT
            self._raise(BUS_OFF)

    def is_error_passive(self):
        return self.counters.is_passive()

    def _finish(self, pending, was_sent):
        del self.pending[pending.place]
        bit = 1 << pending.place
        if was_sent:
            self.values[TXBTO] = self.values.get(TXBTO, 0) | bit
        if pending.is_cancelled or not was_sent:
            self.values[TXBCF] = self.values.get(TXBCF, 0) | bit
        self._raise(COMPLETE if was_sent and self.values.get(TXBTIE, 0) & bit else 0)

    def _recovered(self):
        self.recovering = None
        if self.wire.is_shorted:
            self._recover()
            return
        self.counters.recover()
        self.wire.kick()

    def _recover(self):
        if self.recovering is None:
            self.recovering = self.clock.after(RECOVERY_BITS * self.wire.bit, self._recovered)

    def hear(self, identifier, data):
        number = self._filter(identifier) if self._is_running() else None
        if number is None:
            return
        fifo, config = self.fifos[number], self.values.get(RXFC[number], 0)
        depth = config >> 16 & 0x7F
        if fifo.fill >= depth:
            self.overruns += 1
            self._raise(LOST[number])
            return
        base = (config & 0xFFFC) + ELEMENT_BYTES * fifo.put
        words = (identifier << 18, len(data) << 16 | self._timestamp(), *struct.unpack("<II", data.ljust(8, b"\0")))
        for at, word in enumerate(words):
            self.ram.values[base + 4 * at] = word
        fifo.put, fifo.fill = (fifo.put + 1) % depth, fifo.fill + 1
        self._raise(NEW[number])

    def _filter(self, identifier):
        """The FIFO of a standard data frame: by the first element that matches, or by the global filter."""
        config = self.values.get(SIDFC, 0)
        for place in range(config >> 16 & 0xFF):
            element = self.ram.word((config & 0xFFFC) + 4 * place)
            kind, action, first, second = element >> 30, element >> 27 & 7, element >> 16 & 0x7FF, element & 0x7FF
            matches = (first <= identifier <= second, identifier in (first, second), not (identifier ^ first) & second, False)
            if action and matches[kind]:
                return {1: 0, 2: 1, 5: 0, 6: 1}.get(action)
        return {0: 0, 1: 1}.get(self.values.get(GFC, 0) >> 4 & 3)

    # The side of the core.

    def _timestamp(self):
        return self.clock.now // self.wire.bit & 0xFFFF

    def _raise(self, flags):
        self.values[IR] = self.values.get(IR, 0) | flags
        self._lines()

    def _lines(self):
        waiting, second = self.values.get(IR, 0) & self.values.get(IE, 0), self.values.get(ILS, 0)
        lines = (waiting & ~second, waiting & second)
        for number, irq in enumerate(self.irqs):
            self.nvic.set_line(irq, bool(lines[number] and self.values.get(ILE, 0) >> number & 1))

    def _size(self):
        return self.values.get(TXBC, 0) >> 24 & 0x3F

    def read(self, offset):
        if offset == CREL:
            return 0x3214_1218
        if offset == ENDN:
            return 0x8765_4321
        if offset == TSCV:
            return self._timestamp()
        if offset == ECR:
            return min(self.counters.transmit, 255)
        if offset == PSR:
            transmit, code = self.counters.transmit, self.code
            self.code = UNCHANGED
            return code | (transmit >= PASSIVE) << 5 | (transmit >= WARNING) << 6 | self.counters.is_bus_off << 7
        if offset == TXBRP:
            return sum(1 << place for place in self.pending)
        if offset == TXFQS:
            free = [place for place in range(self._size()) if place not in self.pending]
            return len(free) | (free[0] if free else 0) << 16 | (not free) << 21
        if offset in RXFS:
            number = RXFS.index(offset)
            fifo, depth = self.fifos[number], self.values.get(RXFC[number], 0) >> 16 & 0x7F
            return fifo.fill | fifo.get << 8 | fifo.put << 16 | (fifo.fill == depth) << 24
        return super().read(offset)

    def write(self, offset, value):
        if offset == CCCR:
            self._write_control(value)
        elif offset == IR:
            self.values[IR] = self.values.get(IR, 0) & ~value
        elif offset == TXBAR:
            self._request(value)
        elif offset == TXBCR:
            for pending in [pending for place, pending in self.pending.items() if value >> place & 1]:
                pending.is_cancelled = True
                if not pending.is_on_wire:
                    self._finish(pending, was_sent=False)
        elif offset in RXFA:
            fifo = self.fifos[RXFA.index(offset)]
            depth = self.values.get(RXFC[RXFA.index(offset)], 0) >> 16 & 0x7F
            if fifo.fill and value & 0x3F == fifo.get:
                fifo.get, fifo.fill = (fifo.get + 1) % depth, fifo.fill - 1
        elif offset not in (TXFQS, TXBRP, TXBTO, TXBCF, ECR, PSR):
            self.values[offset] = value
        self._lines()

    def _write_control(self, value):
        was = self.values[CCCR]
        value = value & ~CSA | (CSA if value & CSR else 0)
        self.values[CCCR] = value
        if was & INIT and not value & INIT:
            if self.counters.is_bus_off:
                self._recover()
            else:
                self.wire.kick()

    def _request(self, value):
        for place in range(self._size()):
            if value >> place & 1 and place not in self.pending:
                self.orders += 1
                self.pending[place] = Pending(place, self.orders, self.clock.us())
                for register in (TXBTO, TXBCF):
                    self.values[register] = self.values.get(register, 0) & ~(1 << place)
        self.wire.kick()
