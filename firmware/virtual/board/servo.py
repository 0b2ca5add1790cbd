"""A Feetech STS3032 on a serial line of 1 Mbaud, with an adapter that does not hear itself: registers and motion, by its manual."""

BAUD, BYTE_US = 1_000_000, 10
TORQUE, GOAL, SPEED, PRESENT = 40, 42, 46, 56
STEP_US = 1000


class Servo:
    def __init__(self, board, usart):
        self.board, self.usart = board, usart
        self.registers = bytearray(80)
        self.counts = 2048.0
        self.received = bytearray()
        self.answers = 0
        self.is_heard = True
        board.serial[usart].append(self._hear)
        self._step()

    def degrees(self):
        return self.counts * 360 / 4096

    def has_torque(self):
        return self.registers[TORQUE] == 1

    def _word(self, at):
        return int.from_bytes(self.registers[at : at + 2], "little")

    def _step(self):
        if self.has_torque():
            most = self._word(SPEED) * STEP_US / 1e6
            self.counts += max(-most, min(most, self._word(GOAL) - self.counts))
        self.board.clock.after(self.board.clock.cycles(STEP_US), self._step)

    def _hear(self, byte, baud):
        if abs(baud / BAUD - 1) > 0.03:
            return
        self.received.append(byte)
        data = self.received
        while data and (data[0] != 0xFF or len(data) > 1 and data[1] != 0xFF):
            del data[0]
        if len(data) < 4 or len(data) < 4 + data[3]:
            return
        whole = bytes(data[: 4 + data[3]])
        del data[: len(whole)]
        if sum(whole[2:]) & 0xFF == 0xFF and whole[2] == 1:
            self._obey(whole[4], whole[5:-1])

    def _obey(self, instruction, parameters):
        answer = b""
        if instruction == 3:
            self.registers[parameters[0] : parameters[0] + len(parameters) - 1] = parameters[1:]
        elif instruction == 2:
            self.registers[PRESENT : PRESENT + 2] = round(self.counts).to_bytes(2, "little")
            answer = bytes(self.registers[parameters[0] : parameters[0] + parameters[1]])
        else:
            return
        if not self.is_heard:
            return
        self.answers += 1
        body = bytes((1, len(answer) + 2, 0)) + answer
        frame = b"\xFF\xFF" + body + bytes((~sum(body) & 0xFF,))
        clock = self.board.clock
        for place, byte in enumerate(frame):
            clock.after(clock.cycles(50 + place * BYTE_US), lambda byte=byte: self._byte(byte))

    def _byte(self, byte):
        self.board.chip.usarts[self.usart].receive(byte, BAUD)
