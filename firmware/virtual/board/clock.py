"""Time in cycles of the core, and the events that wait for it."""
import heapq


class Clock:
    def __init__(self, hz):
        self.hz = hz
        self.now = 0
        self._events = []
        self._order = 0
        self.limit = 0
        """Until when the core may run on."""

    def us(self, cycles=None):
        """Microseconds since power-on, as a float."""
        return (self.now if cycles is None else cycles) * 1e6 / self.hz

    def cycles(self, us):
        return int(us * self.hz / 1e6)

    def at(self, cycle, action):
        """Calls `action` at a cycle. Events of one cycle keep their order."""
        self._order += 1
        event = [cycle, self._order, action]
        heapq.heappush(self._events, event)
        self.limit = min(self.limit, cycle)
        return event

    def after(self, cycles, action):
        return self.at(self.now + max(1, cycles), action)

    @staticmethod
    def cancel(event):
        if event is not None:
            event[2] = None

    def next(self):
        """The cycle of the next event."""
        while self._events and self._events[0][2] is None:
            heapq.heappop(self._events)
        return self._events[0][0] if self._events else None

    def run_due(self):
        while self._events and self._events[0][0] <= self.now:
            action = heapq.heappop(self._events)[2]
            if action is not None:
                action()
