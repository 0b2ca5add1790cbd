#!/usr/bin/env python3
"""Proves functions of drivetrain on their machine code, for all inputs.

Every function of the image given as the argument is executed with symbolic inputs; on each path through it the solver is
asked for inputs that break the rule, and then for inputs that take none of the paths. The same rule is put to a function
with an error (src/faulty.rs): there the solver has to find some. Fails otherwise, and when a path could not be followed
to its end. Names after the image choose what is proved.
"""

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
INPUT, OUTPUT = 0x2002_0000, 0x2002_1000
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

    def size(self, name):
        return self.project.loader.find_symbol(name).size

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
        run.explore(find=lambda end: end.addr & ~1 == RETURN, num_find=100_000)
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
            valid, claripy.And(end.regs.r0 == 1, *same), claripy.And(end.regs.r0 == 0, same[0])
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


# The motors of the image's bus, by the ids of their feedback, and all ids of the family.
ATTACHED = [0x201, 0x202, 0x204, 0x206, 0x209, 0x20B]
FAMILY = range(0x201, 0x20C)
# What the bus sends itself: the tests of F05 say what follows when it is received.
COMMANDS = [0x200, 0x1FF, 0x2FF, 0x1FE, 0x2FE]
TAKEN, UNRELATED, BAD_LENGTH, BAD_FIELD = 1, 2, 3, 4


def put_frame(state, identifier, extended, remote, length, data):
    for offset, value in ((0, identifier), (4, extended), (5, remote), (6, length), (8, data)):
        endness = "Iend_LE" if offset == 0 else "Iend_BE"
        state.memory.store(INPUT + offset, value, endness=endness)


def bus_in_operation(image):
    """The state after each motor was heard once, at 1 ms."""
    state = image.blank()
    bus = constant(image.address("BUS"))
    for identifier in ATTACHED:
        byte = claripy.BVV(0, 8)
        put_frame(state, constant(identifier), byte, byte, claripy.BVV(8, 8), claripy.BVV(0x11_0000_0000_0000 * 16, 64))
        (state,) = image.call("route", bus, constant(INPUT), constant(1_000), state=state)
    return state


def last_frames(image, end):
    """The last frame of every motor, as the public API tells it."""
    (end,) = image.call("heard", constant(image.address("BUS")), constant(OUTPUT), state=end)
    return [end.memory.load(OUTPUT + 8 * index, 8) for index in range(len(ATTACHED))]


def counters(image, end):
    (end,) = image.call("counted", constant(image.address("BUS")), constant(OUTPUT), state=end)
    return [output(end, index) for index in range(3)]


def words_changed(image, before, after):
    """How many words of the bus are not what they were."""
    first, size = image.address("BUS"), image.size("BUS")
    same = lambda place, count: claripy.is_true(before.memory.load(place, count) == after.memory.load(place, count))
    if same(first, size):
        return 0
    return sum(not same(place, 4) for place in range(first, first + size, 4))


def route_case(image, function, state, identifier, extended, remote, length, assume=()):
    """Taken exactly when it is a standard data frame of 8 bytes with a motor's id and an angle below 8192; then that
    motor has it, and no other has changed. What is not taken changes nothing but its counter."""
    data = claripy.BVS("data", 64)
    frames_before, counts_before = last_frames(image, state), counters(image, state)
    start = state.copy()
    put_frame(start, identifier, extended, remote, length, data)

    below = claripy.If(extended != 0, constant(1 << 29), constant(1 << 11))
    there_is = claripy.And(claripy.ULE(length, 8), claripy.ULT(identifier, below))
    standard_data = claripy.And(extended == 0, remote == 0)
    mine = claripy.And(standard_data, claripy.Or(*(identifier == motor for motor in ATTACHED)))
    # As a second master's it is noted, and no motor has it.
    own_command = claripy.Or(*(identifier == command for command in COMMANDS))
    stranger = claripy.And(there_is, standard_data, is_of_family(identifier), claripy.Not(mine))
    outcome = constant(TAKEN)
    for holds, value in (
        (claripy.UGE(data[63:48], 8192), BAD_FIELD),
        (length != 8, BAD_LENGTH),
        (claripy.Not(mine), UNRELATED),
        (claripy.Not(there_is), 0),
    ):
        outcome = claripy.If(holds, constant(value), outcome)

    paths = []
    bus = constant(image.address("BUS"))
    for end in image.call(function, bus, constant(INPUT), constant(2_000), state=start, assume=assume):
        changed = words_changed(image, start, end)
        counts = counters(image, end) if changed else counts_before
        # Where at most one word has changed, and that is a counter, the motors are as they were.
        frames = last_frames(image, end) if changed > 1 else frames_before
        kept = [
            frame == claripy.If(claripy.And(outcome == TAKEN, identifier == motor), data, before)
            for motor, frame, before in zip(ATTACHED, frames, frames_before)
        ]
        counted = [
            count == before + claripy.If(holds, constant(1), constant(0))
            for count, before, holds in zip(counts, counts_before, (outcome == BAD_LENGTH, outcome == BAD_FIELD, stranger))
        ]
        untouched = claripy.Or(outcome == TAKEN, claripy.And(standard_data, own_command), claripy.BoolV(changed <= 1))
        paths.append((end, claripy.And(end.regs.r0 == outcome, untouched, *kept, *counted)))
    names = {"id": identifier, "extended": extended, "remote": remote, "length": length, "data": data}
    return paths, names, assume


def is_of_family(identifier):
    return claripy.And(claripy.UGE(identifier, FAMILY[0]), claripy.ULE(identifier, FAMILY[-1]))


def route_foreign(image, function):
    """What no motor has sent: all other ids, both formats, remote frames, wrong lengths; on a bus that has heard nothing."""
    state, length = image.blank(), claripy.BVS("length", 8)
    identifier, extended, remote = claripy.BVS("id", 32), claripy.BVS("extended", 8), claripy.BVS("remote", 8)
    # A part of the case after it, where the solver finds a mix-up of the formats at once.
    yield route_case(image, function, state, constant(ATTACHED[0]), extended, remote, length, [extended != 0])
    whole = claripy.And(is_of_family(identifier), length == 8)
    own = claripy.Or(whole, *(identifier == command for command in COMMANDS))
    others = claripy.Not(claripy.And(extended == 0, remote == 0, own))
    yield route_case(image, function, state, identifier, extended, remote, length, [others])
    none = claripy.BVV(0, 8)
    for identifier in COMMANDS:
        yield route_case(image, function, state, constant(identifier), none, none, claripy.BVV(8, 8))


def route(image, function):
    """A bus that has heard nothing yet, and data of any length."""
    none, length = claripy.BVV(0, 8), claripy.BVS("length", 8)
    # One id of the family after the other: each is another place in memory.
    for identifier in FAMILY:
        yield route_case(image, function, image.blank(), constant(identifier), none, none, length)


def route_in_operation(image, function):
    """A bus that heard each of its motors 1 ms ago."""
    state, none = bus_in_operation(image), claripy.BVV(0, 8)
    for identifier in FAMILY:
        yield route_case(image, function, state, constant(identifier), none, none, claripy.BVV(8, 8))


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


LATE_US, DEADLINE_US = 10_000_000, 100_000
ASKED = 1_000


def word_at(image, function):
    """The word is what was asked for exactly while the last frame is not late, the target not too old, and time moves
    on; otherwise zero: for three times of 64 bits."""
    heard, set_at, updated = times = [claripy.BVS(name, 64) for name in ("heard", "set", "updated")]
    state = image.blank()
    for index, at in enumerate(times):
        state.memory.store(INPUT + 8 * index, at, endness="Iend_LE")
    # Time that can be added to without an overflow, and a target that was accepted: its motor was heard by then.
    assume = [claripy.ULT(at, claripy.BVV(2**62, 64)) for at in times]
    assume += [claripy.ULE(set_at - heard + LATE_US, 2 * LATE_US)]
    fresh = claripy.ULE(updated - heard + LATE_US, 2 * LATE_US)
    moves_on = claripy.UGT(updated, set_at)
    in_time = claripy.ULE(updated - set_at, DEADLINE_US)
    expected = claripy.If(claripy.And(fresh, moves_on, in_time), constant(ASKED), constant(0))
    ends = image.call(function, constant(INPUT), state=state, assume=assume)
    yield [(end, end.regs.r0 == expected) for end in ends], dict(zip(("heard", "set", "updated"), times)), assume


# What is proved, of which function, for which inputs; and the function with an error on which the same has to fail.
PROOFS = [
    ("decode", decode, "decode", "all 2^64 frames", "decode_faulty"),
    ("unwrap", unwrap, "unwrap", "all 2^32 pairs", "unwrap_faulty"),
    ("route", route, "route", "all of the family, on a bus that has heard nothing", "route_masked"),
    ("foreign", route_foreign, "route", "all frames that are no motor's (the bus's own: of 8 bytes)", "route_by_number"),
    ("m2006", word_of((10_000, 10.0)), "word_m2006", "all 2^32 f32", "word_m2006_faulty"),
    ("m3508", word_of((16_384, 20.0)), "word_m3508", "all 2^32 f32", "word_m3508_faulty"),
    ("gm6020-voltage", word_of((25_000, 24.0)), "word_gm6020_voltage", "all 2^32 f32", "word_gm6020_voltage_faulty"),
    ("gm6020-current", word_of((16_384, 3.0)), "word_gm6020_current", "all 2^32 f32", "word_gm6020_current_faulty"),
    ("timeouts", word_at, "word_at", "any three times below 2^62 us, the target accepted", "word_at_faulty"),
    ("operation", route_in_operation, "route", "all data frames of 8 bytes of the family, on a bus that heard each motor", "route_masked"),
]


# Two minutes more for what `operation` proves of a bus that runs: only by name.
LONG = ["route"]
# Multiplying floats is hard for a solver: these take turns.
CONVERSIONS = ["m2006", "m3508", "gm6020-voltage", "gm6020-current"]


def not_now(title):
    """Why a proof is left out when none was chosen, or None."""
    today = CONVERSIONS[int(time.time()) // 86_400 % len(CONVERSIONS)]
    if title in LONG:
        return f"not here: `proofs/run {title}` proves it"
    if title in CONVERSIONS and title != today:
        return f"not today: one conversion a day; `proofs/run {title}` proves it"
    return None


def proved(title):
    """Proves the rule for the function and finds a counterexample for the faulty one, in a process of its own. Returns
    what there is to say, or the failure."""
    irop.SimIROp._compute_fp_to_int = saturating
    _, cases, function, inputs, faulty = next(proof for proof in PROOFS if proof[0] == title)
    try:
        image = Image(sys.argv[1])
        start = time.monotonic()
        found, paths = check(cases(image, function))
        if found:
            fail(f"{function} is wrong for {shown(found)}")
        held = time.monotonic()
        found, _ = check(cases(image, faulty))
        if not found:
            fail(f"the rule of {title} holds for {faulty} too: it proves nothing")
        done = time.monotonic()
    except Failed as failed:
        return failed
    return (
        f"{title:15} holds for {inputs}: {paths} paths, {held - start:.1f} s\n"
        f"{'':15} and fails for {faulty}: {shown(found)}, {done - held:.1f} s"
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
        for said in pool.imap_unordered(proved, reversed([title for title in titles if title in chosen])):
            if isinstance(said, Failed):
                sys.exit(f"proofs: {said}")
            print(said, flush=True)
    print(f"proved in {time.monotonic() - start:.0f} s")


def shown(found):
    return ", ".join(f"{name} {value:#x}" for name, value in found.items())


main()
