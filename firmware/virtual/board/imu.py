"""A HiPNUC IMU on a serial line: a frame 0x91 of 82 bytes each period; it has the attitude that it is told."""
import math
import struct


def crc(covered):
    """CRC-16/XMODEM."""
    value = 0
    for byte in covered:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value


def frame(ms, yaw_deg=0.0, pitch_deg=0.0, yaw_rate=0.0, pitch_rate=0.0):
    """Pitch is about y: its nose goes down when it is positive. Rates in degrees a second."""
    data = bytearray(82)
    data[0:4] = (0x5A, 0xA5, 76, 0)
    data[6] = 0x91
    data[14:18] = struct.pack("<I", ms)
    data[26:30] = struct.pack("<f", 1.0)  # an acceleration of 1 g along z
    data[30:42] = struct.pack("<3f", 0.0, pitch_rate, yaw_rate)
    yaw, pitch = math.radians(yaw_deg) / 2, math.radians(pitch_deg) / 2
    w, x = math.cos(yaw) * math.cos(pitch), -math.sin(yaw) * math.sin(pitch)
    y, z = math.cos(yaw) * math.sin(pitch), math.sin(yaw) * math.cos(pitch)
    data[54:66] = struct.pack("<3f", 0.0, pitch_deg, yaw_deg)
    data[66:82] = struct.pack("<4f", w, x, y, z)
    data[4:6] = struct.pack("<H", crc(data[:4] + data[6:]))
    return bytes(data)


class Imu:
    """`attitude` gives the keyword arguments of `frame`."""

    def __init__(self, board, usart, attitude=dict, baud=115_200, period_us=10_000):
        self.board, self.usart, self.attitude, self.baud, self.period_us = board, usart, attitude, baud, period_us
        self.cut_after = None
        self.spoil = None
        self.sent = 0
        self.frozen = None
        """A frame that it repeats, as one whose processor hangs."""
        self._send()

    def frame_of(self, ms):
        """With the attitude of now, and this time."""
        return frame(ms, **self.attitude())

    def _send(self):
        clock = self.board.clock
        data = self.frozen or frame(int(clock.us() / 1000), **self.attitude())
        byte_us = 1e7 / self.baud
        if self.cut_after is not None:
            data, self.cut_after = data[: self.cut_after], 0
        self.sent += 1
        for place, byte in enumerate(data):
            byte = self.spoil(place, byte) if self.spoil else byte
            clock.after(clock.cycles(1 + place * byte_us), lambda byte=byte: self._byte(byte))
        clock.after(clock.cycles(self.period_us), self._send)

    def _byte(self, byte):
        self.board.chip.usarts[self.usart].receive(byte, self.baud)
