"""The DMA controller of the STM32F4 and of the STM32H7: eight streams, circular or once, half and complete interrupts, and the
requests of the peripherals. Registers as in RM0090, section 10.5; the requests of the F4 as in its tables 42 and 43."""
from .registers import Device

CR, NDTR, PAR, M0AR = 0x00, 0x04, 0x08, 0x0C
ENABLE, CIRCULAR, PERIPHERAL_STEPS, MEMORY_STEPS = 1, 1 << 8, 1 << 9, 1 << 10
TO_MEMORY, TO_PERIPHERAL, MEMORY_TO_MEMORY = range(3)
# Bits of a stream in the status registers, and the enables in CR that belong to them.
ERROR, HALF, COMPLETE = 1 << 3, 1 << 4, 1 << 5
ENABLES = ((ERROR, 1 << 2), (HALF, 1 << 3), (COMPLETE, 1 << 4))
PLACES = (0, 6, 16, 22)
# Controller, stream, channel: the request. Those that a program for these boards can want.
F4_REQUESTS = {
    (1, 0, 4): "UART5_RX", (1, 1, 4): "USART3_RX", (1, 2, 4): "UART4_RX", (1, 3, 4): "USART3_TX", (1, 4, 4): "UART4_TX",
    (1, 4, 7): "USART3_TX", (1, 5, 4): "USART2_RX", (1, 6, 4): "USART2_TX", (1, 7, 4): "UART5_TX", (1, 0, 5): "UART8_TX",
    (1, 1, 5): "UART7_TX", (1, 3, 5): "UART7_RX", (1, 6, 5): "UART8_RX", (2, 1, 5): "USART6_RX", (2, 2, 4): "USART1_RX",
    (2, 2, 5): "USART6_RX", (2, 5, 4): "USART1_RX", (2, 6, 5): "USART6_TX", (2, 7, 4): "USART1_TX", (2, 7, 5): "USART6_TX",
}
# RM0468, table 121: inputs of DMAMUX1.
H7_REQUESTS = {41: "USART1_RX", 42: "USART1_TX", 43: "USART2_RX", 44: "USART2_TX", 45: "USART3_RX", 46: "USART3_TX",
               65: "UART5_RX", 66: "UART5_TX"}
F4_IRQS = {1: (11, 12, 13, 14, 15, 16, 17, 47), 2: (56, 57, 58, 59, 60, 68, 69, 70)}


class Multiplexer(Device):
    """DMAMUX1: which request each of the sixteen streams listens to."""

    def request(self, number, stream):
        return H7_REQUESTS.get(self.read(4 * (8 * (number - 1) + stream)) & 0x7F)


class Stream:
    def __init__(self):
        self.values = {}
        self.flags = 0
        self.length = self.left = 0


class Dma(Device):
    """`memory` reads and writes the RAM, `reach` are the ranges that the controller can reach: not the RAM beside the core."""

    def __init__(self, number, board, reach, multiplexer=None):
        super().__init__()
        self.number, self.board, self.reach, self.multiplexer = number, board, reach, multiplexer
        self.streams = [Stream() for _ in range(8)]
        self.peripherals = {}
        """By the name of the request: what tells whether it is pending, and takes or gives a byte."""

    def _request(self, place):
        if self.multiplexer:
            return self.multiplexer.request(self.number, place)
        return F4_REQUESTS.get((self.number, place, self.streams[place].values.get(CR, 0) >> 25 & 7))

    def serve(self, request):
        """A peripheral has a byte, or wants one: the stream that listens to it moves bytes as long as it does."""
        for place, stream in enumerate(self.streams):
            if stream.values.get(CR, 0) & ENABLE and self._request(place) == request:
                self._move(place, stream)

    def _move(self, place, stream):
        request = self._request(place)
        is_pending, address, data = self.peripherals[request]
        while stream.values[CR] & ENABLE and is_pending():
            control = stream.values[CR]
            direction = control >> 6 & 3
            if direction != (TO_MEMORY if request.endswith("RX") else TO_PERIPHERAL) or stream.values.get(PAR, 0) != address:
                self._fail(place, stream)
                return
            done = stream.length - stream.left
            memory = stream.values.get(M0AR, 0) + (done if control & MEMORY_STEPS else 0)
            if not any(base <= memory < base + size for base, size in self.reach):
                self._fail(place, stream)
                return
            if direction == TO_MEMORY:
                self.board.core.uc.mem_write(memory, bytes([data() & 0xFF]))
            else:
                data(self.board.core.uc.mem_read(memory, 1)[0])
            self._count(place, stream)

    def _fail(self, place, stream):
        stream.values[CR] &= ~ENABLE
        stream.flags |= ERROR
        self._line(place, stream)

    def _count(self, place, stream):
        stream.left -= 1
        if stream.left == stream.length // 2:
            stream.flags |= HALF
        if stream.left == 0:
            stream.flags |= COMPLETE
            if stream.values[CR] & CIRCULAR:
                stream.left = stream.length
            else:
                stream.values[CR] &= ~ENABLE
        self._line(place, stream)

    def _copy(self, place, stream):
        """Memory to memory: at once. The source is in PAR, the destination in M0AR."""
        control, uc = stream.values[CR], self.board.core.uc
        width = 1 << (control >> 11 & 3)
        source, target = stream.values.get(PAR, 0), stream.values.get(M0AR, 0)
        for at in range(stream.length):
            data = uc.mem_read(source + (at * width if control & PERIPHERAL_STEPS else 0), width)
            uc.mem_write(target + (at * width if control & MEMORY_STEPS else 0), bytes(data))
        stream.left = 0
        stream.flags |= HALF | COMPLETE
        stream.values[CR] &= ~ENABLE
        self._line(place, stream)

    def _line(self, place, stream):
        control = stream.values.get(CR, 0)
        raised = any(stream.flags & flag and control & enable for flag, enable in ENABLES)
        self.board.nvic.set_line(F4_IRQS[self.number][place], raised)

    def read(self, offset):
        if offset < 8:
            return sum(self.streams[4 * (offset // 4) + at].flags << PLACES[at] for at in range(4))
        place, register = divmod(offset - 0x10, 0x18)
        if offset < 0x10 or place >= 8:
            return 0
        stream = self.streams[place]
        return stream.left if register == NDTR else stream.values.get(register, 0x21 if register == 0x14 else 0)

    def write(self, offset, value):
        if 8 <= offset < 0x10:
            for at in range(4):
                place = 4 * (offset // 4 - 2) + at
                self.streams[place].flags &= ~(value >> PLACES[at] & 0x3D)
                self._line(place, self.streams[place])
            return
        place, register = divmod(offset - 0x10, 0x18)
        if offset < 0x10 or place >= 8:
            return
        stream = self.streams[place]
        if register == NDTR:
            stream.length = stream.left = value & 0xFFFF
            return
        was = stream.values.get(CR, 0)
        stream.values[register] = value
        if register == CR:
            if value & ENABLE and not was & ENABLE:
                # A stream that is switched on again begins anew.
                stream.length = stream.left
                self._begin(place, stream)
            elif was & ENABLE and not value & ENABLE:
                stream.flags |= COMPLETE
            self._line(place, stream)

    def _begin(self, place, stream):
        if stream.values[CR] >> 6 & 3 == MEMORY_TO_MEMORY:
            self._copy(place, stream)
            return
        if self._request(place) in self.peripherals:
            self._move(place, stream)
