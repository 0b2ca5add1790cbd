"""The computer that leads the snake robot, by its protocol's table: a command of 79 bytes each 50 ms, telemetry of 121 back."""
import math
import struct

BAUD = 115_200
PERIOD_US = 50_000
PULSES = 65_536
JOINTS = 12
NONE, REZERO, DISABLE, ENABLE = 0, 1, 6, 9
COMMAND, TELEMETRY = 79, 121


def crc(covered):
    """CRC-16/MODBUS."""
    value = 0xFFFF
    for byte in covered:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return value


def command(degrees, rpm, gripper_deg, reset):
    data = bytearray((0xAA, 0x55, 0x01, 0x4B, 0x31, 0x10))
    for angle in degrees:
        data += struct.pack(">Bi", rpm, round(angle * PULSES / 360))
    for tag, value in zip((13, 14, 15), (gripper_deg, -gripper_deg, 180 + gripper_deg)):
        data += struct.pack(">Bh", tag, round(value))
    data += bytes((16, reset))
    data += struct.pack(">H", crc(data))
    assert len(data) == COMMAND, len(data)
    return bytes(data)


class Host:
    """Sends as long as `is_sending`; `wanted` gives the angles of the joints in degrees, the speed in rpm and that of the gripper."""

    def __init__(self, board, usart, wanted):
        self.board, self.usart, self.wanted = board, usart, wanted
        self.reset = NONE
        self.is_sending = True
        self.cut_after = None
        self.spoil = None
        # The place of a byte that gets a framing error, once.
        self.flaw = None
        self.sent = 0
        self.received = bytearray()
        self.telemetry = []
        """Time in us and angles of the joints in degrees, with those of the IMUs."""
        self.damaged = 0
        board.serial[usart].append(self._hear)
        self._send()

    def _send(self):
        clock = self.board.clock
        if self.is_sending:
            data = command(*self.wanted(clock.us()), self.reset)
            if self.cut_after is not None:
                data, self.cut_after, self.is_sending = data[: self.cut_after], None, False
            self.sent += 1
            for place, byte in enumerate(data):
                byte = self.spoil(place, byte) if self.spoil else byte
                clock.after(clock.cycles(1 + place * 1e7 / BAUD), lambda byte=byte, place=place: self._byte(place, byte))
        clock.after(clock.cycles(PERIOD_US), self._send)

    def _byte(self, place, byte):
        usart = self.board.chip.usarts[self.usart]
        if place == self.flaw:
            self.flaw = None
            usart.disturb(byte, BAUD)
        else:
            usart.receive(byte, BAUD)

    def _hear(self, byte, baud):
        if abs(baud / BAUD - 1) > 0.03:
            return
        data = self.received
        data.append(byte)
        while data and (data[0] != 0xBB or len(data) > 1 and data[1] != 0x66):
            del data[0]
        if len(data) < TELEMETRY:
            return
        whole = bytes(data[:TELEMETRY])
        if crc(whole[:-2]) != int.from_bytes(whole[-2:], "big"):
            self.damaged += 1
            del data[0]
            return
        data.clear()
        joints = [pulses * 360 / PULSES for pulses in struct.unpack(">12i", whole[3:51])]
        angles = struct.unpack("<12f", whole[71:119])
        self.telemetry.append((self.board.clock.us(), joints, angles))


def gait_deg(joint, seconds):
    """A serpentine wave: even joints swing sideways; the odd ones, a quarter later, half as far."""
    amplitude = 20 if joint % 2 == 0 else 10
    fade = min(1.0, seconds / 0.3)
    return fade * amplitude * math.sin(2 * math.pi * (0.7 * seconds - joint / 8))
