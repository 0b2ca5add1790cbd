"""motorbridge, which nobody here wrote, drives a motor on a CAN interface: `master.py vcan0 damiao`.

It sets the time-out of the drive, enables it and commands a velocity in MIT mode for a second. Then it is silent for longer than the
time-out, and asks. Each line that it prints has what it read: status and velocity in rad/s.
"""

import sys
import time

from motorbridge.core import Controller

interface, family = sys.argv[1:]
controller = Controller(interface)


def report(word):
    time.sleep(0.05)
    controller.poll_feedback_once()
    state = motor.get_state()
    print(word, state.status_code, f"{state.vel:.3f}", flush=True)


if family == "damiao":
    motor = controller.add_damiao_motor(1, 0x11, "4310")
    motor.write_register_u32(9, 2_000)
    print("timeout", motor.get_register_u32(9, 5_000), flush=True)
else:
    motor = controller.add_robstride_motor(1, 0xFD, "rs-02")
    motor.robstride_write_param_u32(0x7028, 2_000)
    print("timeout", motor.robstride_get_param_u32(0x7028, 5_000), flush=True)
motor.enable()
for _ in range(200):
    motor.send_mit(0.0, 2.0, 0.0, 0.5, 0.0)
    time.sleep(0.005)
    controller.poll_feedback_once()
report("driven")
time.sleep(0.5)
if family == "damiao":
    motor.request_feedback()
else:
    # It has no other question that is answered by feedback.
    motor.send_mit(0.0, 0.0, 0.0, 0.0, 0.0)
report("silent")
