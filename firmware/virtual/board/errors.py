"""The error counters of a CAN controller, as ISO 11898-1 has them: warning, passive, bus-off, recovery."""

WARNING, PASSIVE, BUS_OFF = 96, 128, 256


class ErrorCounters:
    def __init__(self):
        self.transmit = 0
        self.is_bus_off = False
        self.times_bus_off = 0

    def is_passive(self):
        return self.transmit >= PASSIVE

    def failed(self, kind):
        """An attempt failed. A passive node that hears no acknowledge, and no dominant bit either, counts it no more."""
        if kind == "acknowledge" and self.is_passive():
            return
        self.transmit = min(self.transmit + 8, BUS_OFF)
        if self.transmit >= BUS_OFF and not self.is_bus_off:
            self.is_bus_off = True
            self.times_bus_off += 1

    def succeeded(self):
        self.transmit = max(0, self.transmit - 1)

    def recover(self):
        self.transmit, self.is_bus_off = 0, False
