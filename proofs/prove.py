#!/usr/bin/env python3
"""Proves functions of drivetrain on their machine code, for all inputs.

Every function of the image given as the argument is executed with symbolic inputs; on each path through it the solver is
asked for inputs that break the rule, and then for inputs that take none of the paths. The same rule is put to a function
with an error (src/faulty.rs): there the solver has to find some. Fails otherwise, and when a path could not be followed
to its end. Names after the image choose what is proved.
"""

import copy
import functools
import logging
import multiprocessing
import os
import sys
import time

# angr says on import that it has no unicorn, which is not needed: symbols are not run by an emulator.
logging.disable(logging.ERROR)
try:
    import angr
    import claripy
    from angr.engines.vex.claripy import irop
except ImportError:
    sys.exit("proofs: angr is not installed; run proofs/run, which installs it")

RETURN = 0xDEAD0000
STACK = 0x2001_0000
# Inputs and outputs by pointer lie here.
INPUT, OUTPUT, BEFORE = 0x2002_0000, 0x2002_1000, 0x2003_0000
FP = claripy.FSORT_FLOAT
NEAREST = claripy.fp.RM.RM_NearestTiesEven


class Failed(Exception):
    """What a proof has to say when it is none."""


def fail(message):
    raise Failed(message)


def constant(value):
    return claripy.BVV(value, 32)


def saturating(operation, mode, value, size):
    """VCVT to an integer as the ARM manual has it (FPToFixed): saturates, and NaN is 0. The solver's own conversion leaves
    both open."""
    if operation._to_signed == "S":
        lowest, highest = -(2 ** (size - 1)), 2 ** (size - 1) - 1
        inside = claripy.fpToSBV(mode, value, size)
    else:
        lowest, highest = 0, 2**size - 1
        inside = claripy.fpToUBV(mode, value, size)
    bottom, top = (claripy.FPV(float(number), value.sort) for number in (lowest, highest + 1))
    # No comparison holds for NaN.
    within = claripy.And(claripy.fpGT(value, bottom), claripy.fpLT(value, top))
    above = claripy.If(claripy.fpGEQ(value, top), claripy.BVV(highest, size), claripy.BVV(0, size))
    ends = claripy.If(claripy.fpLEQ(value, bottom), claripy.BVV(lowest, size), above)
    return claripy.If(within, inside, ends)


class Image:
    """The linked image, and the ends of all paths through its functions."""

    def __init__(self, elf):
        self.project = angr.Project(elf, auto_load_libs=False)

    def address(self, name):
        symbol = self.project.loader.find_symbol(name)
        if symbol is None:
            fail(f"the image has no {name}")
        return symbol.rebased_addr

    def words(self, name, size=4):
        """Where the words of a static are."""
        first = self.address(name)
        return range(first, first + self.project.loader.find_symbol(name).size, size)

    def blank(self):
        """Nothing has run yet; nothing is in the output."""
        # The solver's simplifier makes terms of floats that angr cannot read back.
        state = self.project.factory.blank_state(remove_options=angr.options.simplification)
        # An address that could be very many is an error: angr would take one of them and forget the others.
        few = angr.concretization_strategies.SimConcretizationStrategySolutions(16)
        state.memory.read_strategies, state.memory.write_strategies = [few], [few]
        state.memory.store(OUTPUT, claripy.BVV(0, 8 * 256))
        return state

    def call(self, name, *arguments, state=None, assume=()):
        """Returns the state at the end of every path."""
        start = (state or self.blank()).copy()
        start.regs.ip = self.address(name) | 1
        start.regs.lr, start.regs.sp = RETURN | 1, STACK
        for register, value in zip(("r0", "r1", "r2", "r3"), arguments):
            setattr(start.regs, register, value)
        start.solver.add(*assume)
        run = self.project.factory.simulation_manager(start)
        # Its panic is a loop without an end.
        panicked = self.address("panicked")
        run.explore(find=lambda end: end.addr & ~1 == RETURN, avoid=panicked, num_find=100_000)
        if run.avoid:
            fail(f"{name} panics")
        for stash in ("errored", "unconstrained", "active", "deadended"):
            if getattr(run, stash):
                fail(f"{name}: a path was not followed to its end ({stash}: {getattr(run, stash)[0]})")
        return run.found


def broken(end, rule, inputs):
    """Inputs that lead to this end and break the rule, or None."""
    solver = end.solver
    if not solver.satisfiable(extra_constraints=[claripy.Not(rule)]):
        return None
    with_rule_broken = end.copy()
    with_rule_broken.solver.add(claripy.Not(rule))
    found = {}
    for name, value in inputs.items():
        found[name] = with_rule_broken.solver.eval(value)
        with_rule_broken.solver.add(value == found[name])
    return found


def check(cases):
    """Asks for inputs that break the rule on any path, or that take no path. Returns them, and how many paths there are."""
    count = 0
    for paths, inputs, assume in cases:
        for end, rule in paths:
            count += 1
            if found := broken(end, rule, inputs):
                return found, count
        missed = claripy.Solver()
        missed.add([*assume, claripy.Not(claripy.Or(*(claripy.And(*end.solver.constraints) for end, _ in paths)))])
        if missed.satisfiable():
            fail(f"no path was followed for {[(name, missed.eval(value, 1)) for name, value in inputs.items()]}")
    return None, count


def output(end, index, bits=32):
    """A little-endian word of the output."""
    return end.memory.load(OUTPUT + index * bits // 8, bits // 8, endness="Iend_LE")


def signed(value, bits=32):
    return value.sign_extend(bits - value.length)


def unsigned(value, bits=32):
    return value.zero_extend(bits - value.length)


def decode(image, function):
    """Taken exactly when the angle is below 8192, and each field is where the manual has it."""
    high, low = claripy.BVS("high", 32), claripy.BVS("low", 32)
    paths = []
    for end in image.call(function, high, low, constant(OUTPUT)):
        fields = [
            unsigned(high[31:16]),
            signed(high[15:0]),
            signed(low[31:16]),
            unsigned(low[15:8]),
            unsigned(low[7:0]),
        ]
        same = [output(end, index) == field for index, field in enumerate(fields)]
        valid = claripy.ULT(high[31:16], 8192)
        rule = claripy.If(
            valid, claripy.And(end.regs.r0 == 1, *same), end.regs.r0 == 0
        )
        paths.append((end, rule))
    yield paths, {"high": high, "low": low}, ()


def unwrap(image, function):
    """The one way in -4096..=4095 that leads from the one angle to the other."""
    previous, following = claripy.BVS("previous", 32), claripy.BVS("next", 32)
    paths = []
    for end in image.call(function, previous, following):
        way = end.regs.r0
        leads = (previous + way - following) & 8191 == 0
        paths.append((end, claripy.And(claripy.SGE(way, -4096), claripy.SLE(way, 4095), leads)))
    yield paths, {"previous": previous, "next": following}, ()


# The motors of the image's bus, by the ids of their feedback: the ids of their commands and of their ESCs. And all ids of the
# family.
ESCS = {0x201: 1, 0x202: 2, 0x204: 4, 0x206: 6, 0x209: 5, 0x20B: 7}
ATTACHED = {0x201: 0x200, 0x202: 0x200, 0x204: 0x200, 0x206: 0x1FF, 0x209: 0x2FF, 0x20B: 0x2FF}
FAMILY = range(0x201, 0x20C)
# What a bus sends itself: a second master's, when it is received.
COMMANDS = [0x200, 0x1FF, 0x2FF, 0x1FE, 0x2FE]
# When a bus in operation heard its motors last, and when the frame comes.
LAST_US, NOW_US = 2_000, 3_000
TAKEN, UNRELATED, BAD_LENGTH, BAD_FIELD = 1, 2, 3, 4
# What `news` says of a motor.
NOTHING, SECOND_MASTER = 0, 1


class Frames:
    """Every frame: an id, two flags and a length as a CAN controller has them, and the words that the image makes of it."""

    def __init__(self, image, function):
        self.identifier, self.length = claripy.BVS("id", 32), claripy.BVS("length", 8)
        self.extended, self.remote = claripy.BVS("extended", 8), claripy.BVS("remote", 8)
        self.data = claripy.BVS("data", 64)
        below = claripy.If(self.extended != 0, constant(1 << 29), constant(1 << 11))
        self.there_is = claripy.And(claripy.ULE(self.length, 8), claripy.ULT(self.identifier, below))
        # One length after the other, as the image does.
        self.ends = self.made(image, function, self.length, claripy.UGT(self.length, 8))
        for length in range(9):
            self.ends += self.made(image, function, claripy.BVV(length, 8), self.length == length)
        # The conditions of each path to a frame, and its words. `put` makes them one again: there would be as many paths
        # through all that follows. That none is missing is what `frames` proves.
        places = image.words("FRAME")
        self.ways = [
            (end.solver.constraints, [end.memory.load(place, 4) for place in places])
            for end in self.ends
            if end.solver.eval_one(end.regs.r0)
        ]

    def made(self, image, function, length, assumed):
        state = image.blank()
        wire = ((0, self.identifier), (4, self.extended), (5, self.remote), (6, length), (8, self.data))
        for offset, value in wire:
            endness = "Iend_LE" if offset == 0 else "Iend_BE"
            state.memory.store(INPUT + offset, value, endness=endness)
        place = constant(image.address("FRAME"))
        return image.call(function, constant(INPUT), place, state=state, assume=[assumed])

    def inputs(self):
        flags = {"extended": self.extended, "remote": self.remote}
        return {"id": self.identifier, **flags, "length": self.length, "data": self.data}

    def with_values(self, **values):
        """Those with these values."""
        chosen = copy.copy(self)
        for name, value in values.items():
            symbol = getattr(self, name)
            value = claripy.BVV(value, symbol.length)
            setattr(chosen, name, value)
            put = lambda terms: [claripy.replace(term, symbol, value) for term in terms]
            chosen.there_is = claripy.replace(chosen.there_is, symbol, value)
            ways = [(put(taken), put(words)) for taken, words in chosen.ways]
            chosen.ways = [way for way in ways if not any(claripy.is_false(term) for term in way[0])]
        return chosen

    def of(self, identifier, **values):
        """The standard data frames of one id."""
        return self.with_values(identifier=identifier, extended=0, remote=0, **values)

    def put(self, image, state):
        for index, place in enumerate(image.words("FRAME")):
            (_, first), *others = self.ways
            word = first[index]
            for taken, words in others:
                if words[index] is not word:
                    word = claripy.If(claripy.And(*taken), words[index], word)
            state.memory.store(place, word)


class Watched:
    """What a function tells of a bus; and the words that it writes and reads for that: as long as none that it reads changes,
    it tells the same."""

    def __init__(self, image, state, function, *arguments, size):
        self.image, self.function, self.arguments, self.size = image, function, arguments, size
        self.reads, self.writes = set(), set()
        watched = state.copy()
        for access, words in (("mem_read", self.reads), ("mem_write", self.writes)):
            watched.inspect.b(access, when=angr.BP_BEFORE, action=functools.partial(self.note, access, words))
        self.value = self.told(watched)

    @staticmethod
    def note(access, words, state):
        first, size = (getattr(state.inspect, f"{access}_{what}") for what in ("address", "length"))
        first, size = state.solver.eval_one(first), state.solver.eval_one(size)
        words |= {word & ~3 for word in range(first, first + size)}

    def told(self, state):
        (end,) = self.image.call(self.function, *self.arguments, constant(OUTPUT), state=state)
        return [end.regs.r0, *(output(end, index) for index in range(self.size))]

    def after(self, end, changed):
        return self.told(end) if self.reads & changed else self.value


class Router:
    """A bus, and what it does with frames that come 1 ms later."""

    def __init__(self, image, state):
        self.image, self.state, self.bus = image, state, constant(image.address("BUS"))
        state.memory.store(BEFORE, state.memory.load(image.address("BUS"), 4 * len(image.words("BUS"))))
        self.before = self.words(state)
        self.motors = [constant(place) for place in image.words("MOTORS", 1)]
        self.last = [Watched(image, state, "heard", self.bus, motor, size=2) for motor in self.motors]
        self.counters = Watched(image, state, "counted", self.bus, size=6)
        self.edges = Watched(image, state, "edges", self.bus, size=4)

    def words(self, state):
        return {place: state.memory.load(place, 4) for place in self.image.words("BUS")}

    def changed(self, end):
        """The words of the bus that are not what they were. Equal terms are one object."""
        return {place for place, word in self.words(end).items() if word is not self.before[place]}

    def case(self, function, frames, assume=(), command=None):
        """Taken exactly when it is a standard data frame of 8 bytes with a motor's id and an angle below 8192; then that
        motor has it, and of no other the last frame or the health has changed. What is not taken changes nothing but its
        counter; but a command that this bus sends itself is a second master's, and noted with the motors that it is for."""
        start = self.state.copy()
        frames.put(self.image, start)
        identifier, data = frames.identifier, frames.data
        standard_data = claripy.And(frames.extended == 0, frames.remote == 0)
        mine = claripy.And(standard_data, claripy.Or(*(identifier == motor for motor in ATTACHED)))
        stranger = claripy.And(standard_data, is_of_family(identifier), claripy.Not(mine))
        outcome = constant(TAKEN)
        for holds, value in (
            (claripy.UGE(data[63:48], 8192), BAD_FIELD),
            (frames.length != 8, BAD_LENGTH),
            (claripy.Not(mine), UNRELATED),
        ):
            outcome = claripy.If(holds, constant(value), outcome)
        rejected = (outcome == BAD_LENGTH, outcome == BAD_FIELD, stranger)
        counted = [claripy.If(holds, constant(1), constant(0)) for holds in rejected] + 3 * [constant(0)]
        this = [constant(1), data[63:32].reversed, data[31:0].reversed]

        paths, assume = [], [frames.there_is, *assume]
        place = constant(self.image.address("FRAME"))
        for end in self.image.call(function, self.bus, place, constant(NOW_US), state=start, assume=assume):
            answer = end.regs.r0 == outcome
            if end.solver.satisfiable(extra_constraints=[claripy.Not(answer)]):
                # Broken already: what has become of the bus need not be asked.
                paths.append((end, answer))
                continue
            changed = self.changed(end)
            kept = []
            for motor, last, news in zip(ATTACHED, self.last, self.news):
                taken = claripy.And(outcome == TAKEN, identifier == motor)
                for new, old, word in zip(last.after(end, changed), last.value, this):
                    kept.append(new == claripy.If(taken, word, old))
                if not command and not claripy.is_true(identifier == motor):
                    kept += [said == NOTHING for said in news.after(end, changed)]
            # It returns nothing but what it writes.
            for new, old, more in zip(self.counters.after(end, changed)[1:], self.counters.value[1:], counted):
                kept.append(new == old + more)
            if command:
                kept.append(self.noted(end, changed, command))
            else:
                kept.append(claripy.Or(outcome == TAKEN, claripy.BoolV(changed <= self.counters.reads)))
            paths.append((end, claripy.And(*kept)))
        return paths, frames.inputs(), assume

    def noted(self, end, changed, command):
        """Whether the motors are what they were, but that those of this command have a second master, each with an edge of
        its own and of now; and no words have changed but those of that health, those that are read for these edges only or
        freed with them, and two at most: for the times of the last edge and of the second master."""
        rivals = [motor for motor, frame in ATTACHED.items() if frame == command]
        edges = Watched(self.image, end, "edges", self.bus, size=4)
        _, count, begun, earliest, latest = edges.value
        telling = edges.reads - self.edges.reads | edges.writes
        right = [count == len(rivals), begun == sum(1 << ESCS[motor] for motor in rivals)]
        if rivals:
            right += [claripy.ULE(latest, NOW_US), claripy.UGT(earliest, NOW_US - 1_024)]
        for motor, news in zip(ATTACHED, self.news):
            (said,) = news.after(end, changed)
            right.append(said == (SECOND_MASTER if motor in rivals else NOTHING))
            telling |= news.reads if motor in rivals else set()
        right.append(claripy.BoolV(len(changed - telling) <= (2 if rivals else 0)))
        return claripy.And(*right)

    @functools.cached_property
    def news(self):
        return [
            Watched(self.image, self.state, "news", constant(BEFORE), self.bus, motor, size=0) for motor in self.motors
        ]


def is_of_family(identifier):
    return claripy.And(claripy.UGE(identifier, FAMILY[0]), claripy.ULE(identifier, FAMILY[-1]))


# A proof and its control begin with the same.
@functools.cache
def every_frame(image):
    return Frames(image, "frame")


@functools.cache
def silent(image):
    """A bus that has heard nothing yet."""
    return Router(image, image.blank())


@functools.cache
def in_operation(image):
    """A bus at 1 kHz: it is updated, and heard each of its motors twice, the last time 1 ms ago."""
    state, frames = image.blank(), every_frame(image)
    bus, frame = constant(image.address("BUS")), constant(image.address("FRAME"))
    for now_us in (LAST_US - 1_000, LAST_US):
        for identifier in ATTACHED:
            frames.of(identifier, length=8, data=0x11_0000_0000_0000 * 16).put(image, state)
            (state,) = image.call("route", bus, frame, constant(now_us), state=state)
        (state,) = image.call("update", bus, constant(now_us), state=state)
    (state,) = image.call("edges", bus, constant(OUTPUT), state=state)
    return Router(image, state)


BUSES = (silent, in_operation)


def exists(image, function):
    """There is a frame exactly when the id fits its format and the length is at most 8."""
    frames = Frames(image, function)
    paths = [(end, (end.regs.r0 == 1) == frames.there_is) for end in frames.ends]
    yield paths, frames.inputs(), ()


def foreign(bus):
    """All other ids, both formats, remote frames."""

    def cases(image, function):
        frames = every_frame(image)
        known = claripy.Or(is_of_family(frames.identifier), *(frames.identifier == command for command in COMMANDS))
        others = claripy.Not(claripy.And(frames.extended == 0, frames.remote == 0, known))
        yield bus(image).case(function, frames, [others])

    return cases


def commands(bus):
    def cases(image, function):
        frames, router = every_frame(image), bus(image)
        for command in COMMANDS:
            yield router.case(function, frames.of(command), command=command)

    return cases


def family(bus):
    """One id after the other: each is another place in memory."""

    def cases(image, function):
        frames, router = every_frame(image), bus(image)
        for identifier in FAMILY:
            yield router.case(function, frames.of(identifier))

    return cases


def word_of(model):
    """The word of a value: to the nearest, saturated at the limit of the model; what is not finite is refused and gives
    zero."""
    limit, full_scale = model

    def cases(image, function):
        bits = claripy.BVS("bits", 32)
        value = bits.raw_to_fp()
        scale = claripy.FPV(limit / full_scale, FP)
        scaled = claripy.fpMul(NEAREST, value, scale)
        finite = bits[30:23] != 0xFF
        end_of_scale, half = claripy.FPV(float(limit), FP), claripy.FPV(0.5, FP)
        paths = []
        for end in image.call(function, bits, constant(OUTPUT)):
            one = output(end, 0, 16)
            word = claripy.fpToFP(NEAREST, signed(one), FP)
            near = claripy.And(
                claripy.fpLEQ(claripy.fpSub(NEAREST, word, half), scaled),
                claripy.fpLEQ(scaled, claripy.fpAdd(NEAREST, word, half)),
            )
            right = claripy.If(
                claripy.fpGEQ(scaled, end_of_scale),
                one == limit,
                claripy.If(claripy.fpLEQ(scaled, claripy.fpNeg(end_of_scale)), one == -limit, near),
            )
            in_range = claripy.And(claripy.SGE(one, -limit), claripy.SLE(one, limit))
            accepted = claripy.And(end.regs.r0 == 1, in_range, right)
            refused = claripy.And(end.regs.r0 == 0, one == 0)
            paths.append((end, claripy.If(finite, accepted, refused)))
        yield paths, {"bits": bits}, ()

    return cases


LATE_US, DEADLINE_US = 1_000_000, 100_000
ASKED, REFUSED = 1_000, 2**31 - 1


def word_at(image, function):
    """The target is refused exactly when the update before it lies before the arming, or so long after it that the feedback is
    late. The word is what was asked for exactly while the last frame is not late, the target not too old, and time moves on;
    otherwise zero: for three times of 64 bits."""
    heard, set_at, updated = times = [claripy.BVS(name, 64) for name in ("heard", "set", "updated")]
    state = image.blank()
    for index, at in enumerate(times):
        state.memory.store(INPUT + 8 * index, at, endness="Iend_LE")
    # Time that can be added to without an overflow. The motor is heard and armed at the first of the three.
    assume = [claripy.ULT(at, claripy.BVV(2**62, 64)) for at in times]
    accepted = claripy.And(claripy.UGE(set_at, heard), claripy.ULE(set_at - heard, LATE_US))
    fresh = claripy.ULE(updated - heard, LATE_US)
    moves_on = claripy.UGT(updated, set_at)
    in_time = claripy.ULE(updated - set_at, DEADLINE_US)
    word = claripy.If(claripy.And(fresh, moves_on, in_time), constant(ASKED), constant(0))
    expected = claripy.If(accepted, word, constant(REFUSED))
    ends = image.call(function, constant(INPUT), state=state, assume=assume)
    yield [(end, end.regs.r0 == expected) for end in ends], dict(zip(("heard", "set", "updated"), times)), assume


# What is proved, in one or more parts, of which function, for which inputs; and the functions with an error on which each part
# has to fail.
# Together `frames`, `foreign`, `commands` and `route` are all ids, flags, lengths and data on a bus that has heard nothing,
# and with `operation` instead of `route`, on one that has heard each motor.
PROOFS = [
    ("decode", [decode], "decode", "all 2^64 frames", "decode_faulty", "decode_swapped"),
    ("unwrap", [unwrap], "unwrap", "all 2^32 pairs", "unwrap_faulty"),
    ("frames", [exists], "frame", "all ids, flags, lengths and data", "frame_cut"),
    ("foreign", [foreign(bus) for bus in BUSES], "route", "all frames but data of family and commands, both buses", "route_by_number", "route_aside"),
    ("commands", [commands(bus) for bus in BUSES], "route", "all data frames of the bus's own commands, both buses", "route_command", "route_aside"),
    ("route", [family(silent)], "route", "all data frames of the family, a bus that has heard nothing", "route_masked", "route_aside"),
    ("m2006", [word_of((10_000, 10.0))], "word_m2006", "all 2^32 f32", "word_m2006_faulty"),
    ("m3508", [word_of((16_384, 20.0))], "word_m3508", "all 2^32 f32", "word_m3508_faulty"),
    ("gm6020-voltage", [word_of((25_000, 24.0))], "word_gm6020_voltage", "all 2^32 f32", "word_gm6020_voltage_faulty"),
    ("gm6020-current", [word_of((16_384, 3.0))], "word_gm6020_current", "all 2^32 f32", "word_gm6020_current_faulty"),
    ("timeouts", [word_at], "word_at", "any three times below 2^62 us", "word_at_faulty", "word_at_near"),
    ("operation", [family(in_operation)], "route", "all data frames of the family, a bus that heard them", "route_masked", "route_aside"),
]


# These take turns, because each is a minute and the whole has two.
TURNS = ["m2006", "m3508", "gm6020-voltage", "gm6020-current", "timeouts", "commands", "route"]


# Far more than any takes, on a busy machine as well.
PATIENCE_S = 1_800


def not_now(title):
    """Why a proof is left out when none was chosen, or None."""
    day = int(time.time()) // 86_400
    today = TURNS[(day + day // 7) % 7]  # who runs it each seventh day sees them all as well
    if title in TURNS and title != today:
        return f"not today: today {today} has its turn; `proofs/run {title}` proves it"
    return None


def proved(title):
    """Proves the rule for the function and finds a counterexample for the faulty one, in a process of its own. Returns
    what there is to say, or the failure."""
    irop.SimIROp._compute_fp_to_int = saturating
    _, parts, function, inputs, *controls = next(proof for proof in PROOFS if proof[0] == title)
    try:
        image = Image(sys.argv[1])
        start = time.monotonic()
        found, paths = check(case for cases in parts for case in cases(image, function))
        if found:
            fail(f"{function} is wrong for {shown(found)}")
        held = time.monotonic()
        fails = []
        for faulty in controls:
            for cases in parts:
                found, _ = check(cases(image, faulty))
                if not found:
                    fail(f"the rule holds for {faulty} too: it proves nothing")
            fails.append(f"{'':15} and fails for {faulty}: {shown(found)}")
        done = time.monotonic()
    # Whatever happened in its process, the proof is named.
    except Exception as error:
        return Failed(f"{title}: {error if isinstance(error, Failed) else repr(error)}")
    return (
        f"{title:15} holds for {inputs}: {paths} paths, {held - start:.1f} s\n" + "\n".join(fails) + f", {done - held:.1f} s"
    )


def main():
    titles = [title for title, *_ in PROOFS]
    chosen = sys.argv[2:] or [title for title in titles if not not_now(title)]
    if unknown := set(chosen) - set(titles):
        sys.exit(f"proofs: there is no {', '.join(unknown)}")
    for title in [title for title in titles if title not in chosen]:
        print(f"{title:15} {not_now(title) or 'not chosen'}")
    start = time.monotonic()
    # The longest are the last ones: they begin first.
    with multiprocessing.Pool(os.cpu_count(), maxtasksperchild=1) as pool:
        answers = pool.imap_unordered(proved, reversed([title for title in titles if title in chosen]))
        for _ in chosen:
            try:
                said = answers.next(timeout=PATIENCE_S)
            except multiprocessing.TimeoutError:
                sys.exit(f"proofs: none has ended for {PATIENCE_S} s; a process that was killed never does")
            if isinstance(said, Failed):
                sys.exit(f"proofs: {said}")
            print(said, flush=True)
    print(f"proved in {time.monotonic() - start:.0f} s")


def shown(found):
    return ", ".join(f"{name} {value:#x}" for name, value in found.items())


main()
