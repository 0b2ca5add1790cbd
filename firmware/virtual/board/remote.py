"""A DR16 receiver on a serial line: a DBUS frame of 18 bytes each 14 ms, at 100 kbit/s with even parity."""

PERIOD_US = 14_000
BYTE_US, BAUD = 120, 100_000
REST = 1024
FULL = 660
UP, MIDDLE, DOWN = 1, 3, 2


def dbus_frame(channels, right_switch, left_switch=MIDDLE):
    """Right x, right y, left x, left y, each -1 to 1; mouse and keys rest."""
    bits = sum((REST + round(FULL * share)) << 11 * place for place, share in enumerate(channels))
    bits |= right_switch << 44 | left_switch << 46
    return bits.to_bytes(18, "little")


class Remote:
    """Sends as long as it is heard. Sticks and switch are what the next frame has."""

    def __init__(self, board, usart):
        self.board, self.usart = board, usart
        self.channels, self.switch, self.left_switch = [0.0, 0.0, 0.0, 0.0], MIDDLE, MIDDLE
        self.is_heard, self.baud = True, BAUD
        self.cut_after = None
        self.spoil = None
        # The place of a byte that gets a framing error, once.
        self.flaw = None
        self._send()

    def _send(self):
        clock = self.board.clock
        if self.is_heard:
            for place, byte in enumerate(dbus_frame(self.channels, self.switch, self.left_switch)):
                clock.after(clock.cycles(1 + place * BYTE_US), lambda byte=byte, place=place: self._byte(place, byte))
        clock.after(clock.cycles(PERIOD_US), self._send)

    def _byte(self, place, byte):
        if self.cut_after is not None and place >= self.cut_after:
            self.is_heard = False
            return
        if self.spoil is not None:
            byte = self.spoil(place, byte)
        if place == self.flaw:
            self.flaw = None
            self.board.chip.usarts[self.usart].disturb(byte, self.baud)
        elif byte is not None:
            self.byte(byte)

    def byte(self, byte):
        """Puts a byte on the line, whoever sends it."""
        self.board.chip.usarts[self.usart].receive(byte, self.baud)
