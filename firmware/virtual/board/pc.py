"""A PC with VOFA+ on a serial line: lines out, JustFloat frames in, from its manual."""
import struct

TAIL = struct.pack("<f", float("inf"))
BAUD = 115_200
BYTE_US = 10e6 / BAUD


class Pc:
    def __init__(self, board, port):
        self.board, self.port = board, port
        self.heard = bytearray()
        board.serial[port].append(self._hear)

    def _hear(self, byte, baud):
        # With another baud rate, a PC reads other bytes.
        self.heard.append(byte if abs(baud / BAUD - 1) < 0.02 else byte ^ 0xFF)

    def say(self, data):
        """Sends bytes one behind the other, from now on."""
        clock = self.board.clock
        for place, byte in enumerate(data):
            clock.after(clock.cycles(1 + BYTE_US * place), lambda byte=byte: self.board.chip.usarts[self.port].receive(byte, BAUD))

    def curves(self):
        """The values of the newest whole frame."""
        end = self.heard.rfind(TAIL)
        begin = self.heard.rfind(TAIL, 0, end) + len(TAIL)
        values = bytes(self.heard[begin:end]) if begin >= len(TAIL) else b""
        return struct.unpack(f"<{len(values) // 4}f", values)
