"""bxCAN: three mailboxes, two FIFOs of three frames, filters, abort, errors. Registers as in RM0090, section 32.9."""
import struct
from collections import deque

from .errors import PASSIVE, WARNING, ErrorCounters
from .registers import Device
from .wire import RECOVERY_BITS

MCR, MSR, TSR, RF0R, RF1R, IER, ESR, BTR, FMR = 0x00, 0x04, 0x08, 0x0C, 0x10, 0x14, 0x18, 0x1C, 0x200
INRQ, SLEEP, TXFP, RFLM, ABOM, RESET = 1, 2, 1 << 2, 1 << 3, 1 << 6, 1 << 15
INAK, SLAK, ERRI = 1, 2, 1 << 2
ACKNOWLEDGE_ERROR, BIT_ERROR = 3, 5


class Mailbox:
    def __init__(self):
        self.identifier = 0
        self.length = 0
        self.data = bytearray(8)
        self.is_pending = self.is_on_wire = self.is_aborted = False
        self.order = 0
        self.born = 0.0

    def key(self):
        """Lower goes first: of a standard and an extended id with the same first 11 bits the standard one."""
        return self.identifier >> 1 & 0x7FFF_FFFF


class BxCan(Device):
    def __init__(self, clock, nvic, wire, irqs, master=None):
        super().__init__()
        self.clock, self.nvic, self.wire = clock, nvic, wire
        self.master = master
        """CAN1, which has the filters of both."""
        self.tx_irq, self.rx0_irq, self.rx1_irq, self.sce_irq = irqs
        wire.controller = self
        self.overruns = 0
        self.counters = ErrorCounters()
        self._reset()

    def _reset(self):
        self.mcr, self.msr, self.tsr = 0x0001_0002, 0x0C02, 0
        self.boxes = [Mailbox() for _ in range(3)]
        self.fifos = [deque(), deque()]
        self.flags = [0, 0]
        self.code = 0
        self.recovering = None
        self.orders = 0
        self.values = {BTR: 0x0123_0000} if self.master else {FMR: 0x2A1C_0E01, BTR: 0x0123_0000}

    # The side of the wire.

    def loops_back(self):
        return bool(self.values[BTR] & 1 << 30)

    def is_silent(self):
        return bool(self.values[BTR] & 1 << 31)

    def _is_running(self):
        return not self.msr & (INAK | SLAK) and not self.counters.is_bus_off

    def candidate(self):
        """The frame that takes part in the arbitration: its id, its bytes, its birth, its mailbox."""
        waiting = [box for box in self.boxes if box.is_pending and not box.is_on_wire]
        if not waiting or not self._is_running():
            return None
        oldest = self.mcr & TXFP
        box = min(waiting, key=lambda box: (box.order if oldest else box.key(), self.boxes.index(box)))
        return box.identifier >> 21, bytes(box.data[: box.length]), box.born, box

    def holds(self, box):
        return self.wire.controller is self and box in self.boxes

    def begins(self, box):
        box.is_on_wire = True

    def succeeded(self, box):
        self.counters.succeeded()
        self._empty(box, was_sent=True)
        self._lines()

    def failed(self, box, kind):
        box.is_on_wire = False
        self.counters.failed(kind)
        self.code = ACKNOWLEDGE_ERROR if kind == "acknowledge" else BIT_ERROR
        self._report_errors()
        if box.is_aborted:
            self._empty(box, was_sent=False)
        if self.counters.is_bus_off:
            self._recover()
        self._lines()

    def is_error_passive(self):
        return self.counters.is_passive()

    def _recover(self):
        """With ABOM the controller is back after 128 times 11 recessive bits."""
        if self.mcr & ABOM and self.recovering is None:
            self.recovering = self.clock.after(RECOVERY_BITS * self.wire.bit, self._recovered)

    def _recovered(self):
        self.recovering = None
        if self.wire.is_shorted:
            self._recover()
            return
        self.counters.recover()
        self.wire.kick()

    def hear(self, identifier, data):
        if not self._is_running():
            return
        number = self._filter(identifier)
        if number is None:
            return
        fifo = self.fifos[number]
        if len(fifo) == 3:
            self.overruns += 1
            self.flags[number] |= 1 << 4
            if not self.mcr & RFLM:
                fifo[2] = (identifier, data)
        else:
            fifo.append((identifier, data))
            if len(fifo) == 3:
                self.flags[number] |= 1 << 3
        self._lines()

    def _filter(self, identifier):
        """The FIFO for a standard data frame, or none: banks of 32 bits by mask or list, of 16 bits by mask or list."""
        values = (self.master or self).values
        if values[FMR] & 1:
            return None
        lists, wide, fifos, active = (values.get(at, 0) for at in (0x204, 0x20C, 0x214, 0x21C))
        first_of_second = values[FMR] >> 8 & 0x3F
        for bank in range(first_of_second, 28) if self.master else range(first_of_second):
            if not active >> bank & 1:
                continue
            words = values.get(0x240 + 8 * bank, 0), values.get(0x244 + 8 * bank, 0)
            if wide >> bank & 1:
                word, halves = identifier << 21, words
            else:
                word, halves = identifier << 5, [half for whole in words for half in (whole & 0xFFFF, whole >> 16)]
            if lists >> bank & 1:
                passes = word in halves
            else:
                passes = any((word ^ halves[at]) & halves[at + 1] == 0 for at in range(0, len(halves), 2))
            if passes:
                return fifos >> bank & 1
        return None

    # The side of the core.

    def _empty(self, box, was_sent):
        at = 8 * self.boxes.index(box)
        box.is_pending = box.is_on_wire = box.is_aborted = False
        self.tsr = self.tsr & ~(0xF << at) | (3 if was_sent else 1) << at

    def _report_errors(self):
        enabled, transmit = self.values.get(IER, 0), self.counters.transmit
        raised = enabled & 1 << 8 and transmit >= WARNING or enabled & 1 << 9 and transmit >= PASSIVE
        if raised or enabled & 1 << 10 and self.counters.is_bus_off or enabled & 1 << 11 and self.code:
            self.msr |= ERRI

    def _lines(self):
        enabled = self.values.get(IER, 0)
        self.nvic.set_line(self.tx_irq, bool(enabled & 1 and self.tsr & 0x01_0101))
        for number, irq in ((0, self.rx0_irq), (1, self.rx1_irq)):
            wanted, flags = enabled >> 1 + 3 * number, self.flags[number]
            pending = wanted & 1 and self.fifos[number]
            self.nvic.set_line(irq, bool(pending or wanted & 2 and flags & 8 or wanted & 4 and flags & 16))
        self.nvic.set_line(self.sce_irq, bool(enabled & 1 << 15 and self.msr & ERRI))

    def _status(self):
        tsr, free = self.tsr & 0x8F_8F8F, [at for at, box in enumerate(self.boxes) if not box.is_pending]
        for at, box in enumerate(self.boxes):
            tsr |= (not box.is_pending) << 26 + at | box.is_aborted << 8 * at + 7
        last = max(range(3), key=lambda at: (self.boxes[at].key(), self.boxes[at].order, at))
        tsr |= (free[0] if free else last) << 24
        if len(free) < 2:
            waiting = [at for at in range(3) if at not in free]
            tsr |= 1 << 29 + max(waiting, key=lambda at: (self.boxes[at].key(), self.boxes[at].order, at))
        return tsr

    def read(self, offset):
        if offset == MCR:
            return self.mcr
        if offset == MSR:
            return self.msr
        if offset == TSR:
            return self._status()
        if offset in (RF0R, RF1R):
            number = (offset - RF0R) // 4
            return len(self.fifos[number]) | self.flags[number]
        if offset == ESR:
            transmit = self.counters.transmit
            state = (transmit >= WARNING) | (transmit >= PASSIVE) << 1 | self.counters.is_bus_off << 2
            return state | self.code << 4 | min(transmit, 255) << 16
        if 0x180 <= offset < 0x1B0:
            box = self.boxes[(offset - 0x180) // 0x10]
            words = (box.identifier | box.is_pending, box.length, *struct.unpack("<II", box.data))
            return words[offset % 0x10 // 4]
        if 0x1B0 <= offset < 0x1D0:
            fifo = self.fifos[(offset - 0x1B0) // 0x10]
            if not fifo:
                return 0
            identifier, data = fifo[0]
            words = (identifier << 21, len(data), *struct.unpack("<II", data.ljust(8, b"\0")))
            return words[offset % 0x10 // 4]
        return self.values.get(offset, 0)

    def write(self, offset, value):
        if offset == MCR:
            self._write_mode(value)
        elif offset == MSR:
            self.msr &= ~(value & 0x1C)
        elif offset == TSR:
            self._write_status(value)
        elif offset in (RF0R, RF1R):
            number = (offset - RF0R) // 4
            self.flags[number] &= ~(value & 0x18)
            if value & 0x20 and self.fifos[number]:
                self.fifos[number].popleft()
        elif offset == ESR:
            self.code = value >> 4 & 7
        elif 0x180 <= offset < 0x1B0:
            self._write_mailbox(self.boxes[(offset - 0x180) // 0x10], offset % 0x10, value)
        else:
            self.values[offset] = value
        self._lines()

    def _write_mode(self, value):
        if value & RESET:
            self._reset()
            return
        self.mcr = value
        self.msr &= ~(INAK | SLAK)
        if value & INRQ:
            self.msr |= INAK
        elif value & SLEEP:
            self.msr |= SLAK
        else:
            self.wire.kick()

    def _write_status(self, value):
        for at, box in enumerate(self.boxes):
            if value & 1 << 8 * at:
                self.tsr &= ~(0xF << 8 * at)
            if value & 0x80 << 8 * at and box.is_pending:
                if box.is_on_wire:
                    box.is_aborted = True
                else:
                    self._empty(box, was_sent=False)

    def _write_mailbox(self, box, register, value):
        if box.is_pending:
            return  # write protected
        if register == 0:
            box.identifier = value & ~1
            if value & 1:
                self.orders += 1
                box.order, box.is_pending, box.born = self.orders, True, self.clock.us()
                self.tsr &= ~(0xF << 8 * self.boxes.index(box))
                self.wire.kick()
        elif register == 4:
            box.length = min(value & 0xF, 8)
        else:
            box.data[register - 8 : register - 4] = struct.pack("<I", value)
