"""A HiPNUC IMU on a serial line: a frame 0x91 of 82 bytes each 10 ms, at 115200 baud, standing still with a yaw of zero."""
import struct

PERIOD_US = 10_000
BYTE_US = 87


def crc(covered):
    """CRC-16/XMODEM."""
    value = 0
    for byte in covered:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value


def frame(ms):
    data = bytearray(82)
    data[0:4] = (0x5A, 0xA5, 76, 0)
    data[6] = 0x91
    data[14:18] = struct.pack("<I", ms)
    data[26:30] = struct.pack("<f", 1.0)  # an acceleration of 1 g along z
    data[66:70] = struct.pack("<f", 1.0)  # the real part of the attitude
    data[4:6] = struct.pack("<H", crc(data[:4] + data[6:]))
    return bytes(data)


class Imu:
    def __init__(self, board, usart):
        self.board, self.usart = board, usart
        self.cut_after = None
        self._send()

    def _send(self):
        clock = self.board.clock
        data = frame(int(clock.us() / 1000))
        for place, byte in enumerate(data if self.cut_after is None else data[: self.cut_after]):
            clock.after(clock.cycles(1 + place * BYTE_US), lambda byte=byte: self._byte(byte))
        if self.cut_after is not None:
            self.cut_after = 0
        clock.after(clock.cycles(PERIOD_US), self._send)

    def _byte(self, byte):
        self.board.chip.usarts[self.usart].receive(byte, byte_us=BYTE_US)
