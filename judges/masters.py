"""The three judges behind one face. Each has a bus that is a function: it takes what the judge sends, and gives the answers."""

import contextlib
import ctypes
import io
import os
import select
import struct
import threading
import time

import numpy as np

PATIENCE_S = 20.0


def wait_for(what, condition):
    """Waits for a thread of a judge: only a judge that does not do its work at all runs out of this time."""
    end = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        if time.monotonic() > end:
            raise TimeoutError(what)
        time.sleep(0.0002)
    return found


class Bus:
    """Keeps what a judge sends, and answers by a function."""

    def __init__(self):
        self.sent = []
        self.respond = lambda identifier, data: []

    def take(self, identifier, data):
        self.sent.append((identifier, data))
        return self.respond(identifier, data)

    def drain(self):
        sent, self.sent = self.sent, []
        return sent


class Master:
    """What `damiao.py` asks of a judge. A method that is `None` is what the judge does not have."""

    name = ""
    #: Whether it truncates or rounds to the nearest count, and in which precision it calculates: see `exact.Rule`.
    is_nearest = False
    is_single = False
    #: Its name of each of our models.
    models = {}
    #: Models that have other ranges with this judge: its PMAX, VMAX and TMAX. They are compared if it can be given ours.
    other_ranges = {}
    give_ranges = None
    #: The ranges by which it decodes feedback, where it has one set for all models.
    feedback_model = None
    #: Whether fields outside their range are refused instead of saturated.
    refuses_outside = False
    #: The frame of a command of which each field is NaN; `None` where it is refused.
    of_nan = None

    decodes_in_turn = False
    #: The registers that it knows: kind and access.
    table = None
    #: What it raises for a value that it does not take.
    error = ValueError
    #: Whether it clears errors, stores registers, and tells the status of a drive.
    clears = stores = tells_status = True

    read = write = set_timeout = None

    def __init__(self):
        self.bus = Bus()

    @staticmethod
    def reads_as_register(frames):
        """Feedback that it takes for an answer about a register, and leaves out."""
        return np.zeros(len(frames), bool)

    def connect(self, model, respond):
        """Has the bus answer by a function, after which motors of one model alone are asked for."""
        self.bus.respond = respond

    def frames_of(self, action):
        """What it sends in an action."""
        self.bus.drain()
        action()
        return self.bus.drain()


class DamiaoMotor(Master):
    """damiao-motor, in Python. Its bus is an object with `send` and `recv`, in place of that of python-can."""

    name = "damiao-motor"
    models = {
        "DM-J3507": "3507",
        "DM-J4310": "4310",
        "DM-J4310P": "4310P",
        "DM-J4340": "4340",
        "DM-J4340P": "4340P",
        "DM-J6006": "6006",
        "DM-J8006": "8006",
        "DM-J8009": "8009",
        "DM-J10010": "10010",
        "DM-J10010L": "10010L",
        "DM-H3510": "H3510",
        "DM-H6215": "G6215",
    }

    def __init__(self):
        super().__init__()
        from damiao_motor.core import motor
        from damiao_motor.core.controller import DaMiaoController

        self.table = {
            number: (info.data_type, info.access) for number, info in motor.REGISTER_TABLE.items()
        }
        self.presets = motor.MOTOR_TYPE_PRESETS
        self.queue = []
        with contextlib.redirect_stderr(io.StringIO()):
            self.controller = DaMiaoController(channel="judges", bustype="virtual")
        self.controller.bus.shutdown()
        self.controller.bus = self
        self.motors, self.given = {}, {}

    # The bus, as python-can has it.
    def send(self, message):
        import can

        for identifier, data in self.bus.take(message.arbitration_id, bytes(message.data)):
            self.queue.append(
                can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
            )

    def recv(self, timeout=None):
        return self.queue.pop(0) if self.queue else None

    def shutdown(self):
        pass

    def motor(self, model, identifier=1):
        key = model, identifier
        if key not in self.motors:
            # One with this id at a time: the controller tells them apart by it.
            self.controller.motors.pop(identifier, None)
            self.motors[key] = self.controller.add_motor(
                identifier, identifier + 0x10, self.models[model], **self.given.get(model, {})
            )
        return self.motors[key]

    def give_ranges(self, model, ranges):
        p, v, t = ranges
        self.given[model] = dict(p_min=-p, p_max=p, v_min=-v, v_max=v, t_min=-t, t_max=t)
        self.motors.pop((model, 1), None)

    def ranges(self, model):
        preset = self.presets[self.models[model]]
        assert all(preset[f"{name}_min"] == -preset[f"{name}_max"] for name in "pvt")
        return tuple(preset[f"{name}_max"] for name in "pvt")

    def encode(self, model, values):
        encode = self.motor(model).encode_cmd_msg
        frames = b"".join([encode(p, v, t, kp, kd) for p, v, kp, kd, t in values.tolist()])
        return np.frombuffer(frames, np.uint8).reshape(-1, 8)

    def command(self, model, identifier, mode, values):
        motor = self.motor(model, identifier)
        send = {
            "mit": motor.send_cmd_mit,
            "position-velocity": motor.send_cmd_pos_vel,
            "velocity": motor.send_cmd_vel,
            "force-position": motor.send_cmd_force_pos,
        }[mode]
        send(*values)

    def switch(self, model, identifier, verb):
        motor = self.motor(model, identifier)
        {
            "enable": motor.enable,
            "disable": motor.disable,
            "clear": motor.clear_error,
            "zero": motor.set_zero_position,
            "store": motor.store_parameters,
            "refresh": motor.request_motor_feedback,
        }[verb]()

    def ask(self, model, identifier, number):
        self.motor(model, identifier).request_register_reading(number)

    def read(self, model, identifier, number):
        motor = self.motor(model, identifier)
        # It keeps what it has read once.
        motor.registers.clear()
        return motor.get_register(number, timeout=PATIENCE_S)

    def write(self, model, identifier, number, value):
        self.motor(model, identifier).write_register(number, value)

    def set_mode(self, model, identifier, number):
        self.write(model, identifier, 10, number)

    def set_timeout(self, model, identifier, milliseconds):
        self.motor(model, identifier).set_can_timeout(milliseconds)

    def decode(self, model, frames):
        decode = self.motor(model).decode_sensor_feedback
        keys = "pos", "vel", "torq", "status_code", "can_id", "t_mos", "t_rotor"
        data = frames.tobytes()
        found = [decode(data[at : at + 8]) for at in range(0, len(data), 8)]
        # It would enable a drive whose last feedback says that it is disabled.
        self.motor(model).state = {}
        return np.array([[state[key] for key in keys] for state in found]).T

    def state(self, model, identifier):
        motor = self.motor(model, identifier)
        # The answer to a register that was written reads as feedback to it. All of them are in before this one is asked for.
        wait_for("the queue", lambda: not self.queue)
        time.sleep(0.003)
        before = motor.state
        motor.request_motor_feedback()
        wait_for("feedback", lambda: motor.state is not before)
        state = motor.state
        return state["status_code"], state["pos"], state["vel"], state["torq"]

    def close(self):
        self.bus.respond = lambda identifier, data: []
        self.controller.shutdown()


class SocketCan(Master):
    """A judge that opens CAN sockets: `socketcan.c` has their other ends."""

    opened = 0
    end = None

    def __init__(self):
        super().__init__()
        self.lock = threading.Lock()

    def open(self):
        """The other end of the socket that the judge has opened last."""
        end = 200 + SocketCan.opened
        SocketCan.opened += 1
        os.set_blocking(end, False)
        return end

    def receive(self):
        """What it has sent: each a `struct can_frame`."""
        frames = []
        with contextlib.suppress(BlockingIOError):
            while True:
                frames.append(os.read(self.end, 16))
        return frames

    def feed(self, identifier, data):
        os.write(self.end, struct.pack("<IB3x", identifier, 8) + data)

    def flush(self):
        """Has the bus answer what the judge has sent, until nothing more comes."""
        with self.lock:
            while frames := self.receive():
                for frame in frames:
                    assert len(frame) == 16 and frame[4] == 8
                    for answer in self.bus.take(struct.unpack_from("<I", frame)[0], frame[8:]):
                        self.feed(*answer)

    def frames_of(self, action):
        self.flush()
        self.bus.drain()
        action()
        self.flush()
        return self.bus.drain()


class Motorbridge(SocketCan):
    """motorbridge, in Rust as a shared library."""

    name = "motorbridge"
    is_single = True
    models = DamiaoMotor.models
    # Full negative torque.
    of_nan = bytes(8)
    # It looks at the number within a frame as well as at its id: the frames have those of fifteen motors in turn.
    decodes_in_turn = True

    def __init__(self):
        super().__init__()
        # `judges/run` sets it: it waits after each frame otherwise.
        assert os.environ["MOTORBRIDGE_TX_GAP_US"] == "0"
        from motorbridge.abi import CState
        from motorbridge.core import Controller
        from motorbridge.damiao_registers import DAMIAO_RW_REGISTERS
        from motorbridge.errors import CallError

        kinds = {"f32": "float", "u32": "uint32"}
        self.table = {
            number: (kinds[spec.data_type], spec.access)
            for number, spec in DAMIAO_RW_REGISTERS.items()
        }
        self.error = CallError
        self.new_state, self.new_controller = CState, Controller
        self.controllers = {}
        self.motors = {}
        self.thread = None

    def use(self, model):
        """Each model has a controller and a socket of its own, as a controller has one motor of an id. The socket is opened with
        the first motor."""
        if model not in self.controllers:
            controller = self.new_controller(model)
            self.motors[model, 1] = controller.add_damiao_motor(1, 0x11, self.models[model])
            self.controllers[model] = controller, self.open()
        controller, self.end = self.controllers[model]
        return controller

    def connect(self, model, respond):
        super().connect(model, respond)
        self.use(model)
        if self.thread is None:
            self.thread = threading.Thread(target=self.run, daemon=True)
            self.thread.start()

    def run(self):
        """It waits for answers, so a thread is the bus."""
        while True:
            select.select([self.end], [], [])
            self.flush()

    def motor(self, model, identifier=1):
        key = model, identifier
        controller = self.use(model)
        if key not in self.motors:
            self.motors[key] = controller.add_damiao_motor(
                identifier, 0x10 + identifier, self.models[model]
            )
        return self.motors[key]

    def ranges(self, model):
        """It tells them by feedback that is at its ends."""
        values = self.decode(model, np.array([[0x11] + [0xFF] * 7], np.uint8))
        return tuple(values[:3, 0].tolist())

    def encode(self, model, values):
        self.use(model)
        send = self.motor(model).send_mit
        frames = []
        # A socket holds some hundred.
        for at in range(0, len(values), 50):
            for row in values[at : at + 50].tolist():
                send(*row)
            frames += self.receive()
        return np.frombuffer(b"".join(frames), np.uint8).reshape(-1, 16)[:, 8:]

    def command(self, model, identifier, mode, values):
        motor = self.motor(model, identifier)
        send = {
            "mit": motor.send_mit,
            "position-velocity": motor.send_pos_vel,
            "velocity": motor.send_vel,
            "force-position": motor.send_force_pos,
        }[mode]
        send(*values)

    def switch(self, model, identifier, verb):
        motor = self.motor(model, identifier)
        {
            "enable": motor.enable,
            "disable": motor.disable,
            "clear": motor.clear_error,
            "zero": motor.set_zero_position,
            "store": motor.store_parameters,
            "refresh": motor.request_feedback,
        }[verb]()

    def patiently(self, action):
        """It waits 50 ms for an answer, which is short on a machine with other work."""
        for _ in range(20):
            try:
                return action()
            except self.error as error:
                if "not received" not in str(error):
                    raise
        return action()

    def ask(self, model, identifier, number):
        self.read(model, identifier, number)

    def read(self, model, identifier, number):
        motor = self.motor(model, identifier)
        if self.table[number][0] == "float":
            return motor.get_register_f32(number, 10_000)
        return motor.get_register_u32(number, 10_000)

    def write(self, model, identifier, number, value):
        motor = self.motor(model, identifier)
        if self.table[number][0] == "float":
            self.patiently(lambda: motor.write_register_f32(number, value))
        else:
            self.patiently(lambda: motor.write_register_u32(number, int(value)))

    def set_mode(self, model, identifier, number):
        motor = self.motor(model, identifier)
        self.patiently(lambda: motor.ensure_mode(number, 10_000))

    def set_timeout(self, model, identifier, milliseconds):
        motor = self.motor(model, identifier)
        self.patiently(lambda: motor.set_can_timeout_ms(milliseconds))

    @staticmethod
    def reads_as_register(frames):
        """Feedback that it takes for an answer about a register, and leaves out."""
        return (frames[:, 1] <= 0x0F) & ((frames[:, 2] == 0x33) | (frames[:, 2] == 0x55))

    def decode(self, model, frames):
        controller = self.use(model)
        motors = [self.motor(model, number) for number in range(1, 16)]
        read = motors[0]._abi.lib.motor_handle_get_state
        left_out = self.reads_as_register(frames)
        states = (self.new_state * len(frames))()
        data = frames.tobytes()
        size = ctypes.sizeof(self.new_state)
        address = ctypes.addressof(states)
        for at in range(0, len(frames), len(motors)):
            batch = motors[: len(frames) - at]
            for place in range(len(batch)):
                self.feed(0x11 + place, data[8 * (at + place) : 8 * (at + place + 1)])
            controller.poll_feedback_once()
            for place, motor in enumerate(batch):
                state = self.new_state.from_address(address + (at + place) * size)
                assert read(motor._ptr, ctypes.byref(state)) == 0
                # A thread of its own may have the frame in hand: its temperatures are those of the frame when it is done.
                last = data[8 * (at + place) + 6], data[8 * (at + place) + 7]
                if (state.t_mos, state.t_rotor) != last and not left_out[at + place]:
                    for _ in range(5_000):
                        time.sleep(0.001)
                        read(motor._ptr, ctypes.byref(state))
                        if (state.t_mos, state.t_rotor) == last:
                            break
        found = np.frombuffer(states, np.dtype(self.new_state))
        names = "pos", "vel", "torq", "status_code", "can_id", "t_mos", "t_rotor"
        return np.array([found[name].astype(np.float64) for name in names])

    def state(self, model, identifier):
        motor = self.motor(model, identifier)
        # Its answer is on the socket when this returns, and soon read by a thread of the judge.
        self.frames_of(motor.request_feedback)
        time.sleep(0.01)
        self.use(model).poll_feedback_once()
        state = motor.get_state()
        return state.status_code, state.pos, state.vel, state.torq

    def close(self):
        for controller, _ in self.controllers.values():
            controller.close()


class CanMotorControl(SocketCan):
    """can-motor-control, in Rust as a module."""

    name = "can-motor-control"
    is_nearest = True
    models = {
        "DM-J3507": "DM3507",
        "DM-J4310": "DM4310",
        "DM-J4310P": "DM4310_48V",
        "DM-J4340": "DM4340",
        "DM-J4340P": "DM4340_48V",
        "DM-J6006": "DM6006",
        "DM-J8006": "DM8006",
        "DM-J8009": "DM8009",
        "DM-J10010": "DM10010",
        "DM-J10010L": "DM10010L",
        "DM-H3510": "DMH3510",
        "DM-H6215": "DMH6215",
    }
    other_ranges = {"DM-J3507": (12.5, 50.0, 5.0)}
    # Whatever the model.
    feedback_model = "DM-J4340P"
    refuses_outside = True
    clears = stores = tells_status = False
    modes = {1: "mit", 2: "pos_vel", 3: "vel", 4: "pos_force"}

    def __init__(self):
        super().__init__()
        import can_motor_control
        from can_motor_control.damiao import DamiaoCodec, MotorType

        self.error = can_motor_control.CodecError
        builder = can_motor_control.Robot.builder()
        builder.add_bus("bus", can_motor_control.SocketCanBus("judges"), DamiaoCodec())
        # An arm for each id, 1 to 15, and after these one for each model.
        spec = can_motor_control.MotorSpec
        self.ids = {}
        for number in range(1, 16):
            kind = MotorType.DM4340_48V
            builder.add_arm(
                f"id {number}", bus="bus", motors=[spec(f"id {number}", kind, number, 0x10 + number)]
            )
        for place, (model, kind) in enumerate(self.models.items()):
            self.ids[model] = 0x40 + place
            motors = [spec(model, getattr(MotorType, kind), 0x40 + place, 0x60 + place)]
            builder.add_arm(model, bus="bus", motors=motors)
        self.robot = builder.build()
        self.robot.connect()
        self.end = self.open()

    def arm(self, model, identifier):
        assert model == self.feedback_model
        return self.robot[f"id {identifier}"]

    def ranges(self, model):
        """The largest values that it does not refuse."""
        arm, found = self.robot[model], []
        for field in (2, 3, 4):
            row = np.zeros((1, 5))
            lower, upper = 0.0, 1e6
            for _ in range(100):
                row[0, field] = middle = (lower + upper) / 2
                try:
                    arm.mit_control(row)
                    lower = middle
                except self.error:
                    upper = middle
                self.receive()
            found.append(round(lower, 9))
        return tuple(found)

    def encode(self, model, values):
        control = self.robot[model].mit_control
        rows = values[:, [2, 3, 0, 1, 4]].astype(np.float64)
        frames = []
        for at in range(len(rows)):
            control(rows[at : at + 1])
            frames.append(os.read(self.end, 16))
        frames = np.frombuffer(b"".join(frames), np.uint8).reshape(-1, 16)
        return frames[:, 8:]

    def refuses(self, model, row):
        try:
            self.robot[model].mit_control(row[[2, 3, 0, 1, 4]].astype(np.float64).reshape(1, 5))
        except self.error:
            return not self.receive()
        self.receive()
        return False

    def command(self, model, identifier, mode, values):
        arm = self.arm(model, identifier)
        if mode == "mit":
            p, v, kp, kd, t = values
            arm.mit_control(np.array([[kp, kd, p, v, t]], np.float64))
        elif mode == "velocity":
            arm.vel_control(np.array(values[:1], np.float64))
        else:
            control = arm.pos_vel_control if mode == "position-velocity" else arm.pos_force_control
            control(np.array([values], np.float64))
        self.flush()

    def switch(self, model, identifier, verb):
        arm = self.arm(model, identifier)
        {
            "enable": arm.enable_all,
            "disable": arm.disable_all,
            "zero": arm.set_zero_all,
            "refresh": arm.refresh,
        }[verb]()
        self.flush()

    def set_mode(self, model, identifier, number):
        self.arm(model, identifier).set_mode(self.modes[number])
        self.flush()

    @staticmethod
    def reads_as_register(frames):
        return (frames[:, 2] == 0x33) | (frames[:, 2] == 0x55)

    def decode(self, model, frames):
        arm, identifier = self.robot[model], self.ids[model] + 0x20
        motor, tick = arm[model], self.robot.tick
        data = frames.tobytes()
        found = []
        for at in range(0, len(data), 8):
            self.feed(identifier, data[at : at + 8])
            tick(0)
            found.append(
                (motor.position, motor.velocity, motor.torque)
                + (motor.temperature_mos, motor.temperature_rotor)
            )
        p, v, t, mos, rotor = np.array(found).T
        unknown = np.full(len(p), np.nan)
        return np.array([p, v, t, unknown, unknown, mos, rotor])

    def state(self, model, identifier):
        self.switch(model, identifier, "refresh")
        self.robot.tick(1000)
        motor = self.arm(model, identifier)[f"id {identifier}"]
        return None, motor.position, motor.velocity, motor.torque

    def close(self):
        pass


MASTERS = {master.name: master for master in (DamiaoMotor, Motorbridge, CanMotorControl)}
