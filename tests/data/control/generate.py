#!/usr/bin/env python3
"""Writes the golden sequences of the controllers: `python3 tests/data/control/generate.py [FOLDER]`, beside itself by default.

Independent of the crate: double precision, written from the formulas in the documentation and, for `fhan`, from the paper in
its original form with sign functions. Nothing but the standard library. Every input is rounded to f32 first, so that the crate sees the
same numbers (nine digits give an f32 back exactly); `tests/control_golden.rs` holds the configurations under the same names and compares.
"""
import math
import pathlib
import struct
import sys

FOLDER = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).parent


def f32(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def write(name, header, rows):
    lines = [",".join(header)]
    lines += [",".join(cell if isinstance(cell, str) else f"{cell:.9g}" for cell in row) for row in rows]
    (FOLDER / name).write_text("\n".join(lines) + "\n")


def sign(value):
    return (value > 0) - (value < 0)


def shortest(way, period):
    return way - period * math.floor(way / period + 0.5) if period else way


class Pid:
    """The positional controller as the sums that define it, over the whole history."""

    def __init__(self, kp, ki, kd, lower=-1e30, upper=1e30, integral_limit=1e30, separation=1e30, full=None, none=None,
                 band=0.0, ks=0.0, kv=0.0, slew=None, period=None, cutoff=None, on_error=False, tracking=None,
                 wind_up=False):
        self.__dict__.update(locals())
        self.errors, self.measurements = [], []
        self.integral = self.rate = self.last = 0.0

    def weight(self, error):
        if abs(error) > self.separation:
            return 0.0
        if self.none is None:
            return 1.0
        return min(1.0, max(0.0, (self.none - abs(error)) / (self.none - self.full)))

    def __call__(self, setpoint, measurement, dt):
        error = shortest(setpoint - measurement, self.period)
        setpoint = measurement + error if self.period else setpoint  # the one next to the measurement
        growth = 0.0
        if self.errors:
            if self.on_error:
                raw = -shortest(error - self.errors[-1], self.period) / dt
            else:
                raw = shortest(measurement - self.measurements[-1], self.period) / dt
            growth = self.ki * dt * (error + self.errors[-1]) / 2 * self.weight(error)
        else:
            raw = 0.0
        if self.cutoff:
            time_constant = 1 / (2 * math.pi * self.cutoff)
            self.rate += (raw - self.rate) * dt / (dt + time_constant)
        else:
            self.rate = raw
        proportional = self.kp * error
        if abs(error) < self.band:
            proportional = 0.0
            if sign(growth) * sign(self.integral) >= 0:
                growth = 0.0
        grown = max(-self.integral_limit, min(self.integral_limit, self.integral + growth))
        wanted = proportional + grown - self.kd * self.rate + self.ks * sign(setpoint) + self.kv * setpoint
        output = wanted
        if self.slew:
            output = max(self.last - self.slew * dt, min(self.last + self.slew * dt, output))
        output = max(self.lower, min(self.upper, output))
        if output != wanted:
            if self.tracking:
                grown -= (wanted - output) * min(1.0, dt / self.tracking)
                grown = max(-self.integral_limit, min(self.integral_limit, grown))
            elif sign(wanted - output) == sign(growth) and not self.wind_up:
                grown = self.integral
        self.integral = grown
        self.errors.append(error)
        self.measurements.append(measurement)
        self.last = output
        return output


class Incremental:
    """The controller in differences, from three samples; at a limit, what I adds outward is left out."""

    def __init__(self, kp, ki, kd, lower=-1e30, upper=1e30, tracking=None):
        self.kp, self.ki, self.kd, self.lower, self.upper = kp, ki, kd, lower, upper
        self.r, self.x1, self.x2 = tracking, None, 0.0
        self.e, self.y, self.dt, self.sum = [], [], [], 0.0

    def __call__(self, setpoint, measurement, dt):
        if self.r:
            if self.x1 is None:
                self.x1 = measurement
            bend = -self.r ** 2 * (self.x1 - setpoint) - 2 * self.r * self.x2
            self.x1, self.x2 = self.x1 + dt * self.x2, self.x2 + dt * bend
            setpoint = self.x1
        self.e.append(setpoint - measurement)
        self.y.append(measurement)
        self.dt.append(dt)
        e, y = self.e, self.y
        others, growth = self.kp * e[0], 0.0
        if len(e) > 1:
            older = (y[-2] - y[-3]) / self.dt[-2] if len(y) > 2 else 0.0
            bend = (y[-1] - y[-2]) / dt - older
            others = self.kp * (e[-1] - e[-2]) - self.kd * bend
            growth = self.ki * dt * (e[-1] + e[-2]) / 2
        wanted = self.sum + others + growth
        output = max(self.lower, min(self.upper, wanted))
        outward = output != wanted and sign(wanted - output) == sign(growth)
        self.sum = wanted - growth if outward else wanted
        return output


LINEAR = [(0.0, 1.0), (0.15, -0.5), (0.3, 0.2)]
CASES = {
    "plain": (Pid(2.0, 15.0, 0.01), LINEAR),
    "output_limit": (Pid(4.0, 40.0, 0.01, lower=-1.5, upper=1.5), LINEAR),
    "output_range": (Pid(4.0, 40.0, 0.0, lower=-0.25, upper=1.5), LINEAR),
    "integral_limit": (Pid(1.0, 40.0, 0.0, integral_limit=0.5), LINEAR),
    "back_calculation": (Pid(4.0, 40.0, 0.01, lower=-1.5, upper=1.5, tracking=0.02), LINEAR),
    "without_anti_windup": (Pid(4.0, 40.0, 0.01, lower=-1.5, upper=1.5, wind_up=True), LINEAR),
    "integral_separation": (Pid(2.0, 30.0, 0.0, separation=0.6), LINEAR),
    "variable_integral": (Pid(2.0, 30.0, 0.0, full=0.2, none=0.8), LINEAR),
    "dead_band": (Pid(2.0, 30.0, 0.0, band=0.1), LINEAR),
    "feed_forward": (Pid(1.0, 5.0, 0.0, ks=0.2, kv=0.7), LINEAR),
    "slew_limit": (Pid(2.0, 15.0, 0.0, slew=20.0), LINEAR),
    "derivative_filter": (Pid(2.0, 15.0, 0.02, cutoff=40.0), LINEAR),
    "derivative_on_error": (Pid(2.0, 15.0, 0.005, on_error=True), LINEAR),
    "circle": (Pid(0.05, 0.2, 0.001, period=360.0), [(0.0, 350.0), (0.15, 20.0), (0.3, 300.0)]),
    "together": (
        Pid(4.0, 30.0, 0.02, lower=-1.5, upper=2.0, integral_limit=1.0, separation=0.9, full=0.2, none=0.8, band=0.02,
            ks=0.1, kv=0.3, slew=60.0, period=8.0, cutoff=80.0, tracking=0.05),
        [(0.0, 1.0), (0.15, -0.5), (0.3, 3.9)],
    ),
    "incremental": (Incremental(2.0, 15.0, 0.01), LINEAR),
    "incremental_limit": (Incremental(4.0, 40.0, 0.01, -1.5, 1.5), LINEAR),
    "incremental_tracking": (Incremental(2.0, 15.0, 0.0, tracking=60.0), LINEAR),
}


def pids():
    """Each controller closes the loop around a lag of 50 ms; the time step jitters."""
    rows = []
    for name, (controller, steps) in CASES.items():
        gain = 60.0 if name == "circle" else 1.0
        state, now = 0.0, 0.0
        for index in range(180):
            dt = f32(0.0025 + 0.0004 * math.sin(1.7 * index))
            now += dt
            setpoint = f32([value for start, value in steps if start <= now][-1])
            period = controller.period if isinstance(controller, Pid) else None
            measurement = f32(state % period if period else state)
            output = controller(setpoint, measurement, dt)
            rows.append((name, setpoint, measurement, dt, output))
            state += (gain * output - state) * dt / 0.05
    write("pid.csv", ("case", "setpoint", "measurement", "dt_s", "output"), rows)


def fsg(x, d):
    return (sign(x + d) - sign(x - d)) / 2


def fhan(x1, x2, r, h):
    """Han (2009), in the form with sign functions."""
    d = r * h * h
    a0 = h * x2
    y = x1 + a0
    a1 = math.sqrt(d * (d + 8 * abs(y)))
    a2 = a0 + sign(y) * (a1 - d) / 2
    a = (a0 + y) * fsg(y, d) + a2 * (1 - fsg(y, d))
    return -r * (a / d) * fsg(a, d) - r * sign(a) * (1 - fsg(a, d))


def differentiators():
    rows = []
    for index in range(200):
        x1 = f32(2.0 * math.sin(0.9 * index) ** 3)
        x2 = f32(5.0 * math.cos(2.3 * index) ** 5)
        r, h = f32(10.0 ** (index % 5 - 1)), f32((0.001, 0.01, 0.05)[index % 3])
        rows.append((x1, x2, r, h, fhan(x1, x2, r, h)))
    write("fhan.csv", ("x1", "x2", "r", "h", "fhan"), rows)

    rows = []
    optimal, linear = [0.0, 0.0], [0.0, 0.0]
    r, h0, dt, bandwidth = 50.0, f32(0.006), f32(0.002), 80.0
    for index in range(400):
        target = f32(1.0 if index < 200 else -0.5 + 0.2 * math.sin(0.1 * index))
        pull = fhan(optimal[0] - target, optimal[1], r, h0)
        optimal = [optimal[0] + dt * optimal[1], optimal[1] + dt * pull]
        bend = -bandwidth ** 2 * (linear[0] - target) - 2 * bandwidth * linear[1]
        linear = [linear[0] + dt * linear[1], linear[1] + dt * bend]
        rows.append((target, *optimal, *linear))
    write("differentiator.csv", ("target", "optimal", "optimal_rate", "linear", "linear_rate"), rows)


def filters():
    """Impulse responses; the biquads in direct form I."""
    rows = []
    for name, frequency, q in (("low_pass", 50.0, 0.7071), ("low_pass", 5.0, 2.0), ("notch", 60.0, 1.0), ("notch", 400.0, 5.0)):
        frequency, q = f32(frequency), f32(q)
        w = 2 * math.pi * frequency / 1000.0
        alpha = math.sin(w) / (2 * q)
        if name == "low_pass":
            b = [(1 - math.cos(w)) / 2, 1 - math.cos(w), (1 - math.cos(w)) / 2]
        else:
            b = [1.0, -2 * math.cos(w), 1.0]
        a = [1 + alpha, -2 * math.cos(w), 1 - alpha]
        x, y = [0.0] * 2, [0.0] * 2
        for index in range(100):
            x.append(1.0 if index == 0 else 0.0)
            y.append((sum(b[k] * x[-1 - k] for k in range(3)) - a[1] * y[-1] - a[2] * y[-2]) / a[0])
            rows.append((name, frequency, q, y[-1]))
    write("biquad.csv", ("kind", "frequency_hz", "q", "output"), rows)

    rows, value, cutoff = [], None, f32(30.0)
    for index in range(150):
        dt = f32(0.001 * (1 + index % 4))
        sample = f32(math.sin(0.2 * index) + (3.0 if index == 70 else 0.0))
        corner = 1 / (2 * math.pi * cutoff)
        value = sample if value is None else (dt * sample + corner * value) / (dt + corner)
        rows.append((sample, dt, value))
    write("low_pass.csv", ("sample", "dt_s", "output"), rows)


def profiles():
    """The peak speed by bisection, then the seven segments one after the other from the start."""
    rows = []
    for start, end, v, a, j in (
        (0.0, 5.0, 1.0, 2.0, 0.0), (2.0, -3.0, 1.0, 2.0, 0.0), (0.0, 0.1, 1.0, 2.0, 0.0), (-1.0, 999.0, 2.5, 10.0, 0.0),
        (0.0, 5.0, 1.0, 2.0, 20.0), (2.0, -3.0, 1.0, 2.0, 20.0), (0.0, 0.3, 1.0, 2.0, 20.0), (0.0, -0.01, 1.0, 2.0, 20.0),
        (0.0, 5.0, 1.0, 50.0, 20.0), (-1.0, 999.0, 2.5, 10.0, 100.0), (0.5, 0.75, 100.0, 2.0, 20.0),
    ):
        start, end, v, a, j = map(f32, (start, end, v, a, j))
        distance = abs(end - start)

        def rise(peak):
            if j == 0.0:
                return 0.0, peak / a
            if peak * j < a * a:
                return math.sqrt(peak / j), 0.0
            return a / j, peak / a - a / j

        def length(peak):
            jerk, full = rise(peak)
            return peak * (2 * jerk + full)

        low, high = 0.0, v
        if length(v) <= distance:
            low = v
        else:
            for _ in range(200):
                middle = (low + high) / 2
                low, high = (middle, high) if length(middle) <= distance else (low, middle)
        jerk, full = rise(low)
        cruise = (distance - length(low)) / low
        top = low / (jerk + full)
        slope = top / jerk if jerk else 0.0
        segments = [(jerk, slope), (full, 0.0), (jerk, -slope), (cruise, 0.0), (jerk, -slope), (full, 0.0), (jerk, slope)]
        total = sum(length for length, _ in segments)
        edges = [sum(length for length, _ in segments[:count]) for count in range(8)]
        for part in range(33):
            time = total * part / 32
            s = speed = 0.0
            acceleration = 0.0 if jerk else top
            left = time
            for index, (duration, rate) in enumerate(segments):
                if not jerk:
                    acceleration = (0.0, top, 0.0, 0.0, 0.0, -top, 0.0)[index]
                step = min(left, duration)
                s += speed * step + acceleration * step ** 2 / 2 + rate * step ** 3 / 6
                speed += acceleration * step + rate * step ** 2 / 2
                acceleration += rate * step
                left -= step
                if left <= 0:
                    break
            way = math.copysign(1.0, end - start)
            # A trapezoid's acceleration jumps between its parts: there it is not compared.
            jumps = not jerk and min(abs(time - edge) for edge in edges) < 1e-5 * total
            rows.append((start, end, v, a, j, time, total, start + way * s, way * speed,
                         "jumps" if jumps else way * acceleration))
    write("profile.csv",
          ("start", "end", "velocity", "acceleration", "jerk", "time_s", "duration_s", "position", "speed", "rate"), rows)


# Gain over the ultimate gain, integral and derivative time over the ultimate period, as the papers print them.
RULES = {
    "ZieglerNicholsP": (0.5, None, 0.0),
    "ZieglerNicholsPi": (0.45, 1 / 1.2, 0.0),
    "ZieglerNicholsPid": (0.6, 1 / 2, 1 / 8),
    "TyreusLuybenPi": (1 / 3.2, 2.2, 0.0),
    "TyreusLuybenPid": (1 / 2.2, 2.2, 1 / 6.3),
}


def tuning():
    rows = []
    for name, (gain, integral, derivative) in RULES.items():
        for ultimate, period in ((0.75, 0.0625), (12.0, 2.5)):
            kp = gain * ultimate
            ki = kp / (integral * period) if integral else 0.0
            rows.append((name, ultimate, period, kp, ki, kp * derivative * period))
    write("tuning.csv", ("rule", "ultimate_gain", "ultimate_period_s", "kp", "ki", "kd"), rows)


if __name__ == "__main__":
    pids()
    differentiators()
    filters()
    profiles()
    tuning()
