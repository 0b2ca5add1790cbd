"""A CAN line at 1 Mbit/s: arbitration by id, acknowledge, the errors of the controller, and a record of what left it."""
from collections import deque, namedtuple

Sent = namedtuple("Sent", "us sender id data born")
"""A frame that was acknowledged: when it was over, its sender, its bytes, and when its sender had made it ready."""

INTERMISSION_BITS = 3
# From the start of a frame to its ACK slot: all but the delimiter of the acknowledge and seven bits of end. Then six bits of an
# error flag, and eight of its delimiter.
AFTER_ACK_BITS, ERROR_BITS, SUSPEND_BITS = 8, 14, 8
RECOVERY_BITS = 128 * 11


def bits_of(identifier, data):
    """The length of a standard data frame with its stuff bits, without the intermission."""
    length = len(data)
    bits = [0] + [identifier >> at & 1 for at in range(10, -1, -1)] + [0, 0, 0] + [length >> at & 1 for at in range(3, -1, -1)]
    bits += [byte >> at & 1 for byte in data for at in range(7, -1, -1)]
    crc = 0
    for bit in bits:
        top = crc >> 14 & 1 ^ bit
        crc = crc << 1 & 0x7FFF ^ (0x4599 if top else 0)
    bits += [crc >> at & 1 for at in range(14, -1, -1)]
    stuffed, run, last = 0, 0, None
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, last, run = stuffed + 1, 1 - bit, 1
    return len(bits) + stuffed + 10


class Wire:
    """The line `can1` or `can2`: one controller, and all other nodes as queues by name: each queue offers its oldest frame."""

    def __init__(self, clock, name):
        self.clock, self.name = clock, name
        self.bit = clock.hz // 1_000_000
        self.controller = None
        self.others = {}
        self.busy = None
        self.is_plugged, self.is_shorted = True, False
        self.is_disturbed = False
        """Whether the line was held at one level since the present frame began."""
        self.record = []
        self.listeners = []
        self.attempts = 0
        self.collisions = 0
        """How often two nodes began the same id in the same bit: on a real line both frames are lost."""

    def offer(self, sender, identifier, data):
        """A node other than the controller has a frame to send. Without a line to the controller nobody sees it."""
        if self.is_plugged and not self.is_shorted:
            self.others.setdefault(sender, deque()).append((identifier, data, self.clock.us()))
            self.kick()

    def pull(self):
        self.is_plugged = False
        self.others.clear()

    def plug(self):
        self.is_plugged = True

    def short(self, is_shorted):
        """Holds the line at one level: each attempt of the controller ends at its first bit."""
        self.is_shorted = is_shorted
        self.is_disturbed |= is_shorted
        self.others.clear()

    def kick(self):
        """Begins a frame, when the line is free and a node has one."""
        if self.busy is not None:
            return
        best = None
        for sender, queue in self.others.items():
            if queue:
                key = (queue[0][0], 1, sender)
                best = key if best is None else min(best, key)
        mine = self.controller.candidate() if self.controller else None
        if mine is not None and best is not None and mine[0] == best[0]:
            self.collisions += 1
        if mine is not None and (best is None or mine[0] <= best[0]):
            self._attempt(*mine)
        elif best is not None:
            identifier, data, born = self.others[best[2]].popleft()
            done = lambda: self._delivered(best[2], identifier, data, born)
            self._occupy(bits_of(identifier, data), done)

    def _occupy(self, bits, done, pause=INTERMISSION_BITS):
        self.is_disturbed = self.is_shorted

        def over():
            done()
            self.busy = self.clock.after(pause * self.bit, free)

        def free():
            self.busy = None
            self.kick()

        self.busy = self.clock.after(bits * self.bit, over)

    def _attempt(self, identifier, data, born, token):
        self.attempts += 1
        controller, length = self.controller, bits_of(identifier, data)
        controller.begins(token)
        if controller.loops_back():
            # It hears itself, and needs no acknowledge; the line shows its frames unless it is silent too.
            def heard():
                if controller.holds(token):
                    controller.succeeded(token)
                    controller.hear(identifier, data)
                    self._show(Sent(self.clock.us(), "silent" if controller.is_silent() else "board", identifier, data, born))

            self._occupy(length, heard)
        elif self.is_shorted:
            self._occupy(1 + ERROR_BITS, lambda: controller.holds(token) and controller.failed(token, "bit"), self._pause(controller))
        else:
            def over():
                # The slot of the acknowledge is past the middle of it all: whoever is there then gives it.
                if not controller.holds(token):
                    return  # the chip was reset in the middle of it
                if self.is_disturbed:
                    controller.failed(token, "bit")
                elif self.is_plugged:
                    controller.succeeded(token)
                    self._show(Sent(self.clock.us(), "board", identifier, data, born))
                else:
                    controller.failed(token, "acknowledge")

            if self.is_plugged:
                self._occupy(length, over)
            else:
                self._occupy(length - AFTER_ACK_BITS + ERROR_BITS, over, self._pause(controller))

    def _show(self, sent):
        self.record.append(sent)
        for listener in self.listeners:
            listener(sent)

    @staticmethod
    def _pause(controller):
        return INTERMISSION_BITS + (SUSPEND_BITS if controller.is_error_passive() else 0)

    def _delivered(self, sender, identifier, data, born):
        if self.is_plugged and not self.is_disturbed:
            self._show(Sent(self.clock.us(), sender, identifier, data, born))
            if self.controller:
                self.controller.hear(identifier, data)
