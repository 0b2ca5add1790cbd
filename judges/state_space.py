"""Compares state space with python-control (slycot) and wpimath: see README.md.

state_space.py PROGRAM control|wpimath [--count N] [--seed N] [--only design|filter|refused]
"""

import argparse
import os
import subprocess
import sys
import time
from decimal import Decimal, getcontext

# Threads gain nothing with six rows, and take the time of the other judges.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np  # noqa: E402

from figures import figure  # noqa: E402

#: Largest difference of a gain, as a share of its largest entry; of a discrete plant; of a state over all steps, as a share of its largest.
GAIN, PLANT, STATE = 1e-4, 1e-6, 1e-5
#: Largest condition number of the solution of a Riccati equation, in units without those of the states. Systems beyond are counted.
CONDITION = 1e8
#: Largest one with which the filters keep `STATE`; above, its difference may grow in proportion, up to that of a gain. Numbers of
#: 48 bits solve the equation within 1e-13, of which the gain gets the condition-fold: 1e-6, and the states of a slow filter some times that.
WELL = 1e7
#: Steps of a filter.
STEPS = 1_000
#: Systems in one run of the program: bounds the memory.
BLOCK = 2_000
#: States and inputs; as many measurements as inputs.
SIZES = [(states, inputs) for inputs in (1, 2) for states in range(1, 7)]
#: What wpimath has of these.
REGULATORS, FILTERS = [(1, 1), (2, 1), (2, 2), (3, 2)], [(1, 1), (2, 1), (2, 2)]
getcontext().prec = 60
NAMES = {
    "A": "`A` by zero-order hold",
    "B": "`B` by zero-order hold",
    "gain": "gain of the regulator",
    "observer": "gain of the observer (`A K`)",
    "gain from continuous": "gain from continuous matrices",
    "inversion": "effort of the plant inversion",
    "filter": "states of the Kalman filter over 1000 steps",
    "steady filter": "states of the steady observer over 1000 steps",
}
DEFECTS = {"design": ["hold", "cost", "noise"], "filter": ["noise", "start"]}


def require(condition, text):
    if not condition:
        sys.exit(f"state-space: {text}")


def rounded(values):
    return values.astype("<f4").astype(float)


def transposed(values):
    return np.swapaxes(values, -1, -2)


class Systems:
    """Random systems of one size, each entry an `f32`: continuous matrices, costs, noises, and the same plant in discrete time.

    Rates lie between 0.1 and 30 1/s, time steps between 1 and 100 ms, and each state has a unit of its own, a power of two, up to 256
    times that of another: the judges get the same systems without these units, which changes no bit of an `f32`. Half of the plants are unstable, and an eighth of the costs of single states is zero.
    """

    def __init__(self, random, count, states, inputs):
        n, m = states, inputs
        self.size = (n, m)
        rate = 10 ** random.uniform(-1, 1.5, (count, 1, 1))
        self.dt = rounded(10 ** random.uniform(-3, -1, count))
        # A step covers at most the time in which a rate changes its state by its own size.
        rate = np.minimum(rate, 1 / self.dt[:, None, None])
        self.unit = 2.0 ** random.integers(-4, 5, (count, n))
        to, per = self.unit[:, :, None], 1 / self.unit[:, None, :]
        shift = random.uniform(-1.5, 1, (count, 1, 1)) * np.eye(n)
        self.a = rounded(rate * (random.normal(0, 1, (count, n, n)) / np.sqrt(n) + shift) * to * per)
        self.b = rounded(rate * random.normal(0, 1, (count, n, m)) * to)
        self.c = rounded(random.normal(0, 1, (count, m, n)) * per)
        free = random.random((count, n)) < 0.125
        free[:, 0] = False
        weight = np.where(free, 0, 10 ** random.uniform(-1, 1, (count, n)))
        self.q = rounded(np.eye(n) * (weight / self.unit**2)[:, None, :])
        self.r = rounded(np.eye(m) * 10 ** random.uniform(-2, 2, (count, 1, m)))
        root = random.normal(0, 1, (count, n, n)) * self.unit[:, :, None]
        noise = rounded(root @ transposed(root))
        self.noise = np.maximum(noise, transposed(noise))
        root = random.normal(0, 1, (count, m, m)) + 2 * np.eye(m)
        noise = rounded(10 ** random.uniform(-1, 3, (count, 1, 1)) * (root @ transposed(root)))
        self.of_output = np.maximum(noise, transposed(noise))
        self.exact = [exponential(a, b, dt) for a, b, dt in zip(self.a, self.b, self.dt)]
        self.discrete_a = rounded(np.array([pair[0] for pair in self.exact]))
        self.discrete_b = rounded(np.array([pair[1] for pair in self.exact]))

    def design(self, program, is_discrete, *plant):
        """Returns A, B, gain, gain of the observer, gain of the discretised plant and effort of the inversion, of all systems."""
        a, b = (self.discrete_a, self.discrete_b) if is_discrete else (self.a, self.b)
        count, (n, m) = len(a), self.size
        parts = [a, b, self.c, self.q, self.r, self.noise, self.of_output, self.dt]
        rows = np.concatenate([part.reshape(count, -1) for part in parts], 1).astype("<f4")
        table = run(program, rows, "design", n, m, *plant).reshape(count, -1)
        shapes = [(n, n), (n, m), (m, n), (n, m), (m, n), (m,)]
        ends = np.cumsum([np.prod(shape) for shape in shapes])[:-1]
        return [part.reshape(count, *shape) for part, shape in zip(np.split(table, ends, 1), shapes)]


def exponential(a, b, dt):
    from scipy.linalg import expm

    n, m = b.shape
    whole = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * dt)
    return whole[:n, :n], whole[:n, n:]


def run(program, rows, *arguments):
    command = [program, "state-space", *map(str, arguments)]
    answer = subprocess.run(command, input=rows.tobytes(), stdout=subprocess.PIPE, check=True).stdout
    return np.frombuffer(answer, "<f4").astype(float)


def off(ours, theirs, scale=1.0):
    """Returns the largest difference of each system as a share of its largest entry, in units without those of the states."""
    ours, theirs = ours * scale, theirs * scale
    axes = tuple(range(1, theirs.ndim))
    return np.nan_to_num(np.abs(ours - theirs).max(axes) / np.abs(theirs).max(axes), nan=np.inf)


def exact_gain(a, b, q, r):
    """Returns the gain with 60 digits, by doubling, after its solution is proved: the equation holds to 30 digits, and the loop is stable."""
    number = np.vectorize(Decimal, otypes=[object])
    start, b, q, r = (number(part) for part in (a, b, q, r))
    one = number(np.eye(len(a)))
    loop, g, h = start, b @ solved(r, b.T), q
    for _ in range(40):
        w = one + g @ h
        of_loop, of_reach = solved(w, loop), solved(w, g)
        g, h, loop = g + loop @ of_reach @ loop.T, h + loop.T @ h @ of_loop, loop @ of_loop
        if np.abs(loop).max() < Decimal("1e-40"):
            break
    gain = solved(r + b.T @ h @ b, b.T @ h @ start)
    residual = start.T @ h @ (start - b @ gain) + q - h
    require(np.abs(residual).max() < Decimal("1e-30") * np.abs(h).max(), "the exact solution does not solve its equation")
    require(np.abs(np.linalg.eigvals((start - b @ gain).astype(float))).max() < 1, "the exact solution is not the stable one")
    return gain.astype(float), h.astype(float)


def solved(left, right):
    """Solves `left x = right` of decimal numbers."""
    table, n = np.hstack([left, right]), len(left)
    for column in range(n):
        pivot = column + np.argmax(np.abs(table[column:, column]))
        table[[column, pivot]] = table[[pivot, column]]
        table[column] = table[column] / table[column, column]
        for row in range(n):
            if row != column:
                table[row] = table[row] - table[row, column] * table[column]
    return table[:, n:]


class Control:
    """python-control, whose Riccati equations slycot solves."""

    sizes = SIZES

    def __init__(self):
        import control
        import slycot

        self.module = control
        self.errors = slycot.exceptions.SlycotError
        self.asked = self.decided = 0
        self.name = f"python-control {control.__version__}, slycot {slycot.__version__}"

    def regulator(self, a, b, q, r):
        """Returns gain and solution. Where two methods of python-control contradict each other, or one has none, 60 digits decide."""
        self.asked += 1
        try:
            gain, solution, _ = self.module.dlqr(a, b, q, r, method="slycot")
            other, _, _ = self.module.dlqr(a, b, q, r, method="scipy")
            if np.abs(gain - other).max() <= 1e-6 * np.abs(gain).max():
                return gain, solution
        except (self.errors, np.linalg.LinAlgError):
            pass
        self.decided += 1
        return exact_gain(a, b, q, r)

    def estimator(self, a, c, q, r):
        """The same of an estimator: the gain that corrects a prediction, A K, and the covariance before a measurement."""
        gain, solution = self.regulator(a.T, c.T, q, r)
        return gain.T, solution

    def design(self, systems, found):
        unit = systems.unit
        discrete = [self.sampled(*row) for row in zip(systems.a, systems.b, systems.dt)]
        a, b = (np.array(part) for part in zip(*discrete))
        worst = {
            "A": (off(found["continuous"][0], a, unit[:, None, :] / unit[:, :, None]), PLANT),
            "B": (off(found["continuous"][1], b, 1 / unit[:, :, None]), PLANT),
        }
        # In units that are those of no state: slycot does not balance, and the units are powers of two.
        to, per = unit[:, :, None], 1 / unit[:, None, :]
        plants = list(zip(systems.discrete_a / to / per, systems.discrete_b / to))
        q, c = systems.q * to * transposed(to), systems.c / per
        noise = systems.noise / to / transposed(to)
        discrete = [(a, b) for a, b in zip(np.array([pair[0] for pair in discrete]) / to / per, np.array([pair[1] for pair in discrete]) / to)]
        gains, ill = self.all(self.regulator(a, b, q, r) for (a, b), q, r in zip(plants, q, systems.r))
        worst["gain"] = (off(found["discrete"][2] * unit[:, None, :], gains) + ill, GAIN)
        rows = zip(plants, c, noise, systems.of_output)
        gains, ill = self.all(self.estimator(a, c, q, r) for (a, _), c, q, r in rows)
        # Theirs corrects the prediction: A K.
        ours = systems.discrete_a @ found["discrete"][3] / to
        worst["observer"] = (off(ours, gains) + ill, GAIN)
        gains, ill = self.all(self.regulator(a, b, q, r) for (a, b), q, r in zip(discrete, q, systems.r))
        worst["gain from continuous"] = (off(found["continuous"][4] * unit[:, None, :], gains) + ill, GAIN)
        return worst

    def all(self, answers):
        """Returns the gains, and a number for each system: NaN where its solution is too ill-conditioned to be compared."""
        gains, solutions = (np.array(part) for part in zip(*answers))
        return gains, np.where(np.linalg.cond(solutions) > CONDITION, np.nan, 0)

    def sampled(self, a, b, dt):
        n, m = b.shape
        plant = self.module.ss(a, b, np.zeros((1, n)), np.zeros((1, m)))
        discrete = self.module.c2d(plant, dt, "zoh")
        return discrete.A, discrete.B

    def plain(self, systems):
        """Returns A, B, C, noise, noise of the measurements, and the covariances of the steady filters, in units that are those of no state."""
        to, per = systems.unit[:, :, None], 1 / systems.unit[:, None, :]
        a, b, c = systems.discrete_a / to / per, systems.discrete_b / to, systems.c / per
        noise = systems.noise / to / transposed(to)
        rows = zip(a, c, noise, systems.of_output)
        return a, b, c, noise, systems.of_output, np.array([self.estimator(*row)[1] for row in rows])

    def steady(self, plain, unit, u, y):
        """Returns the states of the steady filter, as a simulated system of python-control."""
        control, states = self.module, []
        for a, b, c, _, r, p, unit, u, y in zip(*plain, unit, u, y):
            n = len(a)
            k = p @ c.T @ np.linalg.inv(c @ p @ c.T + r)
            left = np.eye(n) - k @ c
            # x[k + 1] = (1 - K C) (A x[k] + B u) + K y, and the result is x[k + 1].
            of_input = np.hstack([left @ b, k])
            observer = control.ss(left @ a, of_input, left @ a, of_input, True)
            states.append(control.forced_response(observer, inputs=np.hstack([u, y]).T).outputs.reshape(n, -1).T * unit)
        return np.array(states)

    def filter(self, systems, start, u, y):
        """Returns the states of the filter, with the covariances of its textbook form in `f64`, all systems together."""
        a, b, c, q, r = systems.discrete_a, systems.discrete_b, systems.c, systems.noise, systems.of_output
        x, p, states = np.zeros((len(a), a.shape[1])), start, []
        for step in range(u.shape[1]):
            x = np.einsum("sij,sj->si", a, x) + np.einsum("sij,sj->si", b, u[:, step])
            p = a @ p @ transposed(a) + q
            gain = transposed(np.linalg.solve(c @ p @ transposed(c) + r, c @ p))
            x = x + np.einsum("sij,sj->si", gain, y[:, step] - np.einsum("sij,sj->si", c, x))
            p = p - gain @ c @ p
            p = (p + transposed(p)) / 2
            states.append(x)
        return np.stack(states, 1)

    def refuses(self, a, b):
        n, m = b.shape
        try:
            gain = self.module.dlqr(a, b, np.eye(n), np.eye(m), method="slycot")[0]
        except self.errors:
            return True
        return np.abs(np.linalg.eigvals(a - b @ gain)).max() > 1 - 1e-6


class Wpimath:
    """robotpy-wpimath, in the sizes for which it has classes."""

    sizes = REGULATORS

    def __init__(self):
        from importlib.metadata import version

        import wpimath.controller
        import wpimath.estimator
        import wpimath.system

        self.controller, self.estimator, self.system = wpimath.controller, wpimath.estimator, wpimath.system
        self.name = f"robotpy-wpimath {version('robotpy-wpimath')}"

    def design(self, systems, found):
        n, m = systems.size
        regulator = getattr(self.controller, f"LinearQuadraticRegulator_{n}_{m}")
        rows = zip(systems.a, systems.b, systems.q, systems.r, systems.dt)
        gains = np.array([np.reshape(regulator(*row).K(), (m, n)) for row in rows])
        inversion = getattr(self.controller, f"LinearPlantInversionFeedforward_{n}_{m}")
        worst = {"gain from continuous": (off(found["continuous"][4], gains, systems.unit[:, None, :]), GAIN)}
        if n >= m:
            # With dt = 1 and a plant whose sampled B is the one of the discrete plant: a = 0.
            ones = np.ones(n)
            efforts = [inversion(np.zeros((n, n)), b, 1.0).calculate(0 * ones, ones) for b in systems.discrete_b]
            well = np.array([np.linalg.cond(b / np.abs(b).max(0)) < 1e3 for b in systems.discrete_b])
            # The same of ours: its A has no effect on a reference of zero.
            ours = found["discrete"][5][well]
            worst["inversion"] = (off(ours, np.reshape(efforts, (-1, m))[well]), GAIN)
        return worst

    def filter(self, systems, start, u, y):
        n, m = systems.size
        states = []
        for row, (p, u, y) in enumerate(zip(start, u, y)):
            # A plant that wpimath samples to exactly this one does not exist, so only noise and plant of its own sampling are given to us.
            plant = getattr(self.system, f"LinearSystem_{n}_{m}_{m}")(
                systems.a[row], systems.b[row], systems.c[row], np.zeros((m, m))
            )
            filter_ = getattr(self.estimator, f"KalmanFilter_{n}_{m}_{m}")(
                plant, tuple(systems.deviations[row]), tuple(systems.of_output_deviations[row]), systems.dt[row]
            )
            filter_.setP(p)
            found = np.empty((len(u), n))
            for step, (u, y) in enumerate(zip(u, y)):
                filter_.predict(u, systems.dt[row])
                filter_.correct(u, y)
                found[step] = np.reshape(filter_.xhat(), n)
            states.append(found)
        return np.array(states)

    def prepare(self, systems, random):
        """Gives the systems the noises that wpimath makes of deviations: those of a continuous plant, over a time step."""
        from scipy.linalg import expm

        count, (n, m) = len(systems.a), systems.size
        systems.deviations = 10 ** random.uniform(-1, 1, (count, n)) * systems.unit
        systems.of_output_deviations = 10 ** random.uniform(-1, 1, (count, m))
        for row, (a, dt) in enumerate(zip(systems.a, systems.dt)):
            noise = np.diag(systems.deviations[row] ** 2)
            whole = expm(np.block([[-a, noise], [np.zeros((n, n)), a.T]]) * dt)
            systems.noise[row] = whole[n:, n:].T @ whole[:n, n:]
        systems.noise = rounded((systems.noise + transposed(systems.noise)) / 2)
        systems.of_output = rounded(np.eye(m) * (systems.of_output_deviations**2 / systems.dt[:, None])[:, None, :])

    def refuses(self, a, b):
        return None


def compare_design(judge, program, systems, *plant):
    found = {
        "continuous": systems.design(program, False, *plant),
        "discrete": systems.design(program, True, *plant),
    }
    return judge.design(systems, found)


def signals(systems, random, program):
    """Returns inputs and measurements of a noisy plant that a regulator holds: rows of each system and step."""
    count, (n, m) = len(systems.a), systems.size
    gain = systems.design(program, True)[2]
    # A plant without a gain, because it is ill-conditioned, stays at zero: its measurements are noise.
    held = np.isfinite(gain).all((1, 2))[:, None]
    gain = np.nan_to_num(gain)
    root = np.linalg.cholesky(systems.noise + 1e-6 * np.trace(systems.noise, axis1=1, axis2=2)[:, None, None] * np.eye(n))
    of_output = np.linalg.cholesky(systems.of_output)
    x, inputs, outputs = systems.unit.copy(), np.empty((count, STEPS, m)), np.empty((count, STEPS, m))
    for step in range(STEPS):
        u = rounded(random.normal(0, 1, (count, m)) - np.einsum("sij,sj->si", gain, x))
        x = np.einsum("sij,sj->si", systems.discrete_a, x) + np.einsum("sij,sj->si", systems.discrete_b, u)
        x = held * (x + np.einsum("sij,sj->si", root, random.normal(0, 1, (count, n))))
        y = np.einsum("sij,sj->si", systems.c, x) + np.einsum("sij,sj->si", of_output, random.normal(0, 1, (count, m)))
        inputs[:, step], outputs[:, step] = u, rounded(y)
    return inputs, outputs


def ours_filtered(program, systems, start, u, y, is_discrete, *plant):
    count, (n, m) = len(u), systems.size
    a, b = (systems.discrete_a, systems.discrete_b) if is_discrete else (systems.a, systems.b)
    dt = 0 * systems.dt if is_discrete else systems.dt
    parts = [a, b, systems.c, systems.noise, systems.of_output, start, dt, np.concatenate([u, y], 2)]
    rows = np.concatenate([part[:count].reshape(count, -1) for part in parts], 1).astype("<f4")
    states = run(program, rows, "filter", n, m, STEPS, *plant).reshape(count, STEPS, 2, n)
    return states[:, :, 0], states[:, :, 1]


def compare_filter(judge, program, systems, random, *plant):
    if isinstance(judge, Wpimath):
        judge.prepare(systems, random)
    n = systems.size[0]
    start = rounded(np.eye(n) * (systems.unit**2 * 10 ** random.uniform(-1, 1, (len(systems.a), 1)))[:, None, :])
    u, y = signals(systems, random, program)
    filtered, observed = ours_filtered(program, systems, start, u, y, isinstance(judge, Control), *plant)
    per = 1 / systems.unit[:, None, :]
    values = off(filtered, judge.filter(systems, start, u, y), per)
    if not isinstance(judge, Control):
        return {"filter": (values, STATE)}
    few = slice(0, 40)
    plain = judge.plain(systems)
    # Above `WELL`, each difference as a share of what its condition allows.
    condition = np.linalg.cond(plain[-1])
    share = np.where(condition > CONDITION, np.nan, np.maximum(1, condition / WELL))
    states = judge.steady([part[few] for part in plain], systems.unit[few], u[few], y[few])
    return {
        "filter": (values / share, STATE),
        "steady filter": (off(observed[few], states, per[few]) / share[few], STATE),
    }


def compare(verb, judge, program, random, count):
    """Compares `count` systems, the same number of each size."""
    sizes = [size for size in judge.sizes if verb == "design" or isinstance(judge, Control) or size in FILTERS]
    all_of = {}
    for size in sizes:
        left = max(1, count // len(sizes))
        while left > 0:
            systems = Systems(random, min(BLOCK, left), *size)
            left -= BLOCK
            worst = compare_design(judge, program, systems) if verb == "design" else compare_filter(judge, program, systems, random)
            for name, (values, allowed) in worst.items():
                all_of.setdefault(name, (allowed, []))[1].append(values)
    for name, (allowed, values) in all_of.items():
        values = np.concatenate(values)
        ill = np.isnan(values)
        require(ill.sum() <= 2 + 0.01 * len(values), f"{verb}: {name}: {ill.sum()} of {len(values)} systems are ill-conditioned")
        values = values[~ill]
        left_out = f", {ill.sum()} ill-conditioned ones left out" if ill.any() else ""
        is_ours = name == "filter" and isinstance(judge, Control)
        who = "the textbook form in numpy" if is_ours else judge.name
        figure("state space", NAMES[name], who, len(values), allowed, values.max(), verb)
        print(f"  {verb}: {name} of {len(values)}{left_out}: within {values.max():.1e} (99.9 %: {np.quantile(values, 0.999):.1e}), allowed {allowed:.0e}")
    for name, (allowed, values) in all_of.items():
        worst = np.nanmax(np.concatenate(values))
        require(worst <= allowed, f"{verb}: {name} is off by {worst:.2e}")


def plant(judge, program, random):
    for verb, defects in DEFECTS.items():
        for defect in defects:
            if isinstance(judge, Wpimath) and (verb, defect) != ("filter", "noise") and defect != "cost":
                continue
            systems = Systems(random, 20, 2, 1)
            arguments = ["--plant", defect]
            if verb == "design":
                worst = compare_design(judge, program, systems, *arguments)
            else:
                worst = compare_filter(judge, program, systems, random, *arguments)
            is_found = any(not np.nanmax(values) <= allowed for values, allowed in worst.values())
            require(is_found, f"{verb}: the defect {defect} was not found")
    print("  found the planted defects")


def refused(judge, program, random, count):
    """Plants with a mode that grows and that no input reaches: no gain of ours, and none of the judge that stabilises."""
    for n, m in SIZES:
        systems = Systems(random, max(1, count // len(SIZES)), n, m)
        systems.discrete_a[:, -1, :-1] = 0
        systems.discrete_a[:, -1, -1] = rounded(random.uniform(1, 2, len(systems.a)))
        systems.discrete_b[:, -1] = 0
        gain = systems.design(program, True)[2]
        require(np.isnan(gain).all(), f"refused: a gain for a plant of {n} states that none stabilises")
        for a, b in zip(systems.discrete_a[:5], systems.discrete_b[:5]):
            require(judge.refuses(a, b) is not False, f"refused: the judge stabilises a plant of {n} states")
    print(f"  refused: {count} plants that no gain stabilises")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=["control", "wpimath"])
    parser.add_argument("--count", type=int, help="10 000 for wpimath, 240 for control")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    options = parser.parse_args()
    options.count = options.count or {"control": 240, "wpimath": 10_000}[options.judge]
    if options.only not in (None, "design", "filter", "refused"):
        return
    start = time.monotonic()
    judge = Control() if options.judge == "control" else Wpimath()
    print(f"state-space: {judge.name}")
    random = np.random.default_rng([options.seed, options.judge == "control"])
    plant(judge, options.program, random)
    for verb, share in (("design", 1), ("filter", 8 if options.judge == "control" else 10)):
        if options.only in (None, verb):
            compare(verb, judge, options.program, random, options.count // share)
    if options.judge == "control":
        print(f"  of {judge.asked} Riccati equations, 60 digits decided {judge.decided}")
        require(judge.decided < 0.03 * judge.asked, "the judges contradict each other too often")
    if options.only in (None, "refused"):
        refused(judge, options.program, random, min(options.count, 600))
    print(f"  {time.monotonic() - start:.0f} s")


main()
