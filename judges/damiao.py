"""Compares the family `damiao` with judges: see README.md."""

import argparse
import math
import pathlib
import re
import sys
import time

import numpy as np

from exact import DOUBLE, SINGLE, Field, Rule
from masters import MASTERS
from program import Program

MODES = {"mit": 0x000, "position-velocity": 0x100, "velocity": 0x200, "force-position": 0x300}
NUMBERS = {"mit": 1, "position-velocity": 2, "velocity": 3, "force-position": 4}
SPECIAL = {"enable": 0xFC, "disable": 0xFD, "clear": 0xFB, "zero": 0xFE}
STATUSES = {0, 1, 8, 9, 10, 11, 12, 13, 14}

# The model of what does not depend on it: all judges have the same ranges for it.
MODEL = "DM-J4340P"

# Which comparison has to find which planted defect.
DEFECTS = {
    "mit": ["nibbles", "scale", "rounded"],
    "feedback": ["nibbles", "scale"],
    "modes": ["nibbles"],
    "frames": ["id", "number", "kind"],
    "drive": ["drive", "ear", "answer"],
}


def echo(identifier, data):
    """A drive that says yes to all about its registers."""
    return [(0x10 + data[0], data)] if identifier == 0x7FF and data[2] != 0xCC else []


def once(frames):
    """Each frame once: a judge repeats one that is not answered soon."""
    return list(dict.fromkeys(frames))


# The differences of commands and feedback that README.md explains, by their notes: all of them, and no other, have to be seen.
OTHER_RANGES = "model(s) with other ranges"
AVOIDED = "special frames avoided"
BOUNDARY = "proved to be at a boundary between counts"
NO_SINGLE = "of a range that is no f32"
NEAREST = "truncated by us, rounded to the nearest by the judge"
OUTSIDE = "commands outside, which it refuses and gets at the end of the range"
STATUS = "frames with a status that no drive has, refused by us"
REGISTER = "frames that it takes for an answer about a register"
EXPLAINED = {
    ("damiao-motor", "mit"): {AVOIDED, BOUNDARY, NO_SINGLE},
    ("damiao-motor", "feedback"): {STATUS},
    ("motorbridge", "mit"): {AVOIDED},
    ("motorbridge", "feedback"): {STATUS, REGISTER},
    ("can-motor-control", "mit"): {OTHER_RANGES, AVOIDED, BOUNDARY, NEAREST, OUTSIDE},
    ("can-motor-control", "feedback"): {OTHER_RANGES, STATUS, REGISTER},
    ("damiao-motor", "modes"): {BOUNDARY},
    ("motorbridge", "modes"): set(),
    ("can-motor-control", "modes"): {BOUNDARY},
}
# What is not a difference.
EQUAL = {"equal frames"}


class Difference(Exception):
    """A difference that nothing explains."""


def require(condition, what):
    if not condition:
        raise Difference(what)


class Trial:
    """A judge and the program."""

    def __init__(self, judge, path, defect=None, count=1_000_000, seed=1):
        self.judge = judge
        self.program = Program(path, defect)
        self.count = count
        self.random = np.random.default_rng(seed)
        self.models = {
            name: tuple(float(np.float32(value)) for value in ranges)
            for name, *ranges in self.program.lines("models")
        }
        self.our_rule = Rule(False, SINGLE)
        self.judge_rule = Rule(judge.is_nearest, SINGLE if judge.is_single else DOUBLE)
        self.notes = {}

    def note(self, what, count=1):
        self.notes[what] = self.notes.get(what, 0) + int(count)

    def finish(self, part, what, count):
        """Looks whether the differences are those that are explained; a short run does not see all of them."""
        seen = {note for note, times in self.notes.items() if times} - EQUAL
        explained = EXPLAINED[self.judge.name, part]
        require(seen <= explained, f"not explained: {seen - explained}")
        require(self.count < 1_000_000 or seen == explained, f"no longer there: {explained - seen}")
        self.note(what, count)

    def common_models(self):
        """Those for which the judge has our ranges; that it has others is a difference that has to be known."""
        common = []
        for model, ours in self.models.items():
            require(model in self.judge.models, f"{self.judge.name} has no {model}")
            theirs = self.judge.ranges(model)
            known = self.judge.other_ranges.get(model)
            is_same = all(np.float32(a) == np.float32(b) for a, b in zip(ours, theirs))
            if known:
                require(theirs == known, f"{model}: {theirs}, README.md has {known}")
                require(not is_same, f"{model}: {ours} are the judge's, README.md has another")
                self.note(OTHER_RANGES)
                if self.judge.give_ranges:
                    self.judge.give_ranges(model, ours)
                    common.append((model, ours, ours))
            else:
                require(is_same, f"{model}: {ours}, {self.judge.name} has {theirs}")
                common.append((model, ours, theirs))
        return common

    # MIT commands

    def mit(self):
        common = self.common_models()
        for place, (model, ours, theirs) in enumerate(common):
            count = self.count * (place + 1) // len(common) - self.count * place // len(common)
            fields = fields_of(ours)
            values = self.values(fields, count)
            for_judge = values
            if self.judge.refuses_outside:
                for_judge = self.within(model, values, fields_of(theirs))
            frames = self.program.run("encode", model, "mit", data=values.tobytes())
            frames = np.frombuffer(frames, np.uint8).reshape(-1, 8)
            expected = self.judge.encode(model, for_judge)
            require(expected.shape == frames.shape, f"{model}: {expected.shape} frames")
            self.compare(model, values, frames, expected, fields, fields_of(theirs))
        self.nan(common[0][0])
        self.finish("mit", "MIT commands", self.count)

    def values(self, fields, count):
        """Commands inside, at and outside the ranges, and at the boundaries between counts."""
        random, columns = self.random, []
        for field in fields:
            span = field.upper - field.lower
            value = field.lower + span * (1.2 * random.random(count) - 0.1)
            counts = random.integers(0, field.top + 1, count)
            boundary = (field.lower + counts * span / field.top).astype(np.float32)
            step = random.integers(-1, 2, count)
            near = np.where(step == 0, boundary, np.nextafter(boundary, np.float32(3e38) * step))
            kind = random.integers(0, 100, count)
            value = np.where(kind < 5, near, value).astype(np.float32)
            ends = np.array(
                [field.lower, field.upper, 0.0, -0.0, 1e-30, -1e-30, 1e-45, 3e38, -3e38]
                + [np.inf, -np.inf]
                + [np.nextafter(np.float32(end), np.float32(to)) for end in (field.lower, field.upper) for to in (-1e9, 1e9)],
                np.float32,
            )
            value = np.where(kind >= 95, ends[random.integers(0, len(ends), count)], value)
            columns.append(value)
        values = np.array(columns, np.float32).T.copy()
        # All fields at their upper ends and a torque of some counts less: the special frames are among these.
        full = slice(0, count // 500)
        values[full, :4] = [field.upper for field in fields[:4]]
        torque = fields[4]
        less = random.random(count // 500) * 10 * (torque.upper - torque.lower) / torque.top
        values[full, 4] = torque.upper - less
        return values

    def within(self, model, values, fields):
        """What the judge takes of them; the others it has to refuse."""
        lower = np.array([field.lower for field in fields])
        upper = np.array([field.upper for field in fields])
        inside = np.clip(values.astype(np.float64), lower, upper)
        is_outside = ((values < lower) | (values > upper)).any(axis=1)
        for row in values[is_outside][:100]:
            require(self.judge.refuses(model, row), f"{self.judge.name} takes {row}")
        self.note(OUTSIDE, is_outside.sum())
        return inside

    def compare(self, model, values, frames, expected, our_fields, their_fields):
        differing = np.nonzero((frames != expected).any(axis=1))[0]
        ours, theirs = counts_of(frames[differing]), counts_of(expected[differing])
        rows = values[differing]
        highest = np.array([0xFF] * 7 + [0xFA], np.uint8)
        is_avoided = (frames[differing] == highest).all(axis=1)
        is_explained = np.ones(len(differing), bool)
        rounded = np.zeros(len(differing), bool)
        for place, (our_field, their_field) in enumerate(zip(our_fields, their_fields)):
            column, our, their = rows[:, place], ours[:, place], theirs[:, place]
            unlike = our != their
            for field, rule, counts, is_ours in (
                (our_field, self.our_rule, our, True),
                (their_field, self.judge_rule, their, False),
            ):
                open_rows = np.nonzero(unlike & ~rule.are_surely_right(field, column, counts))[0]
                for row in open_rows:
                    value, count = float(column[row]), int(counts[row])
                    possible = [count]
                    if is_ours and place == 4 and is_avoided[row]:
                        possible = range(0xFFA, 0xFFF)
                    is_right = any(rule.is_right(field, value, each) for each in possible)
                    is_explained[row] &= is_right
                    rounded[row] |= is_right
        wrong = np.nonzero(~is_explained)[0]
        if len(wrong):
            row = wrong[0]
            raise Difference(
                f"{model} {rows[row].tolist()} is {frames[differing][row].tobytes().hex()},"
                f" with {self.judge.name} {expected[differing][row].tobytes().hex()}"
            )
        self.note("equal frames", len(frames) - len(differing))
        self.note(AVOIDED, is_avoided.sum())
        at_boundary = rounded & ~is_avoided
        self.note(BOUNDARY, at_boundary.sum())
        # Both counts are right by themselves: of another rule, or of a range that is no f32.
        both = (~at_boundary & ~is_avoided).sum()
        if self.judge.is_nearest:
            self.note(NEAREST, both)
        else:
            is_same = all((a.lower, a.upper) == (b.lower, b.upper) for a, b in zip(our_fields, their_fields))
            require(not both or not is_same, f"{model}: {both} counts are right and differ")
            self.note(NO_SINGLE, both)

    def nan(self, model):
        """A field that is NaN: ours rests."""
        values = np.full((1, 5), np.nan, np.float32)
        rest = self.program.run("encode", model, "mit", data=values.tobytes())
        require(rest == bytes.fromhex("7FFF7FF0000007FF"), f"NaN is {rest.hex()}")
        try:
            frame = self.judge.encode(model, values).tobytes()
        except (ValueError, self.judge.error):
            frame = None
        require(frame == self.judge.of_nan, f"NaN with {self.judge.name} is {frame}")

    # The three other modes

    def modes(self):
        model = MODEL
        count = max(self.count // 50, 1_000)
        self.judge.connect(model, echo)
        for mode, base in list(MODES.items())[1:]:
            values = np.zeros((count, 5), np.float32)
            values[:, :2] = self.random.normal(0, 20, (count, 2))
            if mode == "force-position":
                values[:, 1] = self.random.uniform(-10, 130, count)
                values[:, 2] = self.random.uniform(-0.2, 1.3, count)
                at_boundary = np.arange(count) % 10 == 0
                values[at_boundary, 1] = self.random.integers(0, 10_001, at_boundary.sum()) / 100
                values[at_boundary, 2] = self.random.integers(0, 10_001, at_boundary.sum()) / 10_000
            frames = self.program.run("encode", model, mode, data=values.tobytes())
            for place, row in enumerate(values):
                identifier = place % 15 + 1
                given = [float(value) for value in row]
                if mode == "force-position" and self.judge.refuses_outside:
                    given = [given[0], min(max(given[1], 0.0), 100.0), min(max(given[2], 0.0), 1.0)]
                given = given[: {"velocity": 1, "position-velocity": 2, "force-position": 3}[mode]]
                sent = self.judge.frames_of(lambda: self.judge.command(model, identifier, mode, given))
                frame = frames[8 * place : 8 * place + 8]
                require(len(sent) == 1, f"{self.judge.name} sends {sent}")
                require(sent[0][0] == base + identifier, f"{mode} #{identifier} on 0x{sent[0][0]:X}")
                if sent[0][1] != frame:
                    self.explain_force(given, frame, sent[0][1], mode)
        self.finish("modes", "commands of three modes", 3 * count)

    def explain_force(self, values, frame, expected, mode):
        what = f"{mode} {values} is {frame.hex()}, with {self.judge.name} {expected.hex()}"
        require(mode == "force-position" and frame[:4] == expected[:4], what)
        # A product alone, which rounds once.
        rules = Rule(False, SINGLE), Rule(False, SINGLE if self.judge.is_single else DOUBLE)
        for rule in rules:
            rule.error = SINGLE if rule is rules[0] or self.judge.is_single else DOUBLE
        for at, field, value in ((4, Field(0, 100, 10_000), values[1]), (6, Field(0, 1, 10_000), values[2])):
            for rule, data in zip(rules, (frame, expected)):
                count = int.from_bytes(data[at : at + 2], "little")
                require(rule.is_right(field, value, count), what)
        self.note(BOUNDARY)

    # Feedback

    def feedback(self):
        common = self.common_models()
        if self.judge.feedback_model:
            ranges = self.models[self.judge.feedback_model]
            common = [(model, ranges, ranges) for model in self.models]
        for place, (model, ours, theirs) in enumerate(common):
            count = self.count * (place + 1) // len(common) - self.count * place // len(common)
            frames = self.random.integers(0, 256, (count, 8), np.uint8)
            # One in twenty has any status; the others have one that drives have.
            status = self.random.choice(sorted(STATUSES), count).astype(np.uint8)
            status = np.where(self.random.integers(0, 20, count) == 0, frames[:, 0] >> 4, status)
            frames[:, 0] = frames[:, 0] & 0xF | status << 4
            if self.judge.decodes_in_turn:
                frames[:, 0] = frames[:, 0] & 0xF0 | np.arange(count) % 15 + 1
            own = self.judge.feedback_model or model
            data = self.program.run("decode", own, data=frames.tobytes())
            self.compare_feedback(model, frames, data, fields_of(ours), fields_of(theirs))
        self.finish("feedback", "feedback frames", self.count)

    def compare_feedback(self, model, frames, data, our_fields, their_fields):
        kind = np.dtype([("values", "<f4", 3), ("rest", "u1", 8)])
        data = np.frombuffer(data, kind)
        p, v, t, status, number, driver, rotor = self.judge.decode(model, frames)
        counts = counts_of_feedback(frames)
        is_known = np.isin(frames[:, 0] >> 4, list(STATUSES))
        is_left_out = self.judge.reads_as_register(frames)
        self.note(STATUS, (~is_known).sum())
        self.note(REGISTER, is_left_out.sum())
        require(((data["rest"][:, 0] != 255) == is_known).all(), f"{model}: refused statuses")
        judged = is_known & ~is_left_out
        for place, values in enumerate((p, v, t)):
            ours, theirs = our_fields[(0, 1, 4)[place]], their_fields[(0, 1, 4)[place]]
            found = data["values"][:, place].astype(np.float64)
            # Product, quotient and sum round once each; the ranges themselves are those of either side.
            bound = 0.0
            for field, unit in ((ours, SINGLE), (theirs, SINGLE if self.judge.is_single else DOUBLE)):
                share = counts[:, place] * (field.upper - field.lower) / field.top
                bound = bound + float(unit) * 1.001 * (2 * share + np.abs(field.lower + share) + 1e-30)
            apart = np.abs((found - ours.value(counts[:, place])) - (values - theirs.value(counts[:, place])))
            self.fail_at(model, frames, judged & ~(apart <= bound), found, values)
            # And with each other, up to what separates the two ranges.
            between = np.abs(ours.value(counts[:, place]) - theirs.value(counts[:, place]))
            require((between <= float(SINGLE) * theirs.upper).all(), f"{model}: ranges")
        for place, values in enumerate((status, number, driver, rotor)):
            known = judged & ~np.isnan(values)
            found = data["rest"][:, place]
            self.fail_at(model, frames, known & (found != values), found, values)
            require(known.any() or not self.judge.tells_status and place < 2, f"{model}: no {place}")
        is_at_end = np.isin(counts[:, 0], (0, 0xFFFF))
        require(((data["rest"][:, 4] == 1) == is_at_end)[is_known].all(), f"{model}: ends")

    def fail_at(self, model, frames, wrong, ours, theirs):
        rows = np.nonzero(wrong)[0]
        if len(rows):
            row = rows[0]
            raise Difference(
                f"{model} {frames[row].tobytes().hex()} reads {ours[row]},"
                f" with {self.judge.name} {theirs[row]}; {len(rows)} such"
            )

    # Frames that switch a drive and those about registers

    def frames(self):
        model = MODEL
        judge = self.judge
        judge.connect(model, echo)
        self.registers()
        with self.program.serve() as ours:
            for identifier in range(1, 16):
                for mode, base in MODES.items():
                    sent = ours.frames(f"session {model} {identifier} {mode}")
                    for verb, last in SPECIAL.items():
                        if verb == "clear" and not judge.clears:
                            continue
                        data = bytes([0xFF] * 7 + [last])
                        mine = {frame for frame in sent if frame[1] == data}
                        theirs = judge.frames_of(lambda: judge.switch(model, identifier, verb))
                        # To the id of the mode and to the bare id in turn by us, to the bare id by the judge: equal in MIT mode.
                        ids = {(base + i, data) for i, data in theirs} | set(theirs)
                        is_told = mine == ids if verb == "disable" else mine and mine <= ids
                        require(
                            is_told and len(theirs) == 1,
                            f"{verb} #{identifier} in {mode}: {mine}, with {judge.name} {theirs}",
                        )
                        self.note("frames that switch a drive" + (", to both ids by us" if base else ""))
                    refresh = judge.frames_of(lambda: judge.switch(model, identifier, "refresh"))
                    asked = [frame for frame in sent if frame[0] == 0x7FF and frame[1][2] == 0xCC]
                    require(asked in ([], refresh), f"refresh #{identifier}: {asked}, {refresh}")
                    timeout = [frame for frame in sent if frame[0] == 0x7FF and frame[1][2] == 0x55]
                    if judge.set_timeout:
                        theirs = once(judge.frames_of(lambda: judge.set_timeout(model, identifier, 100)))
                        require(timeout == theirs, f"time-out #{identifier}: {timeout}, {theirs}")
                        self.note("frames that set the time-out")
                mode = list(MODES)[identifier % 4]
                ours.ask(f"motor {model} {identifier} {mode}")
                self.inquiries(ours, model, identifier)

    def inquiries(self, ours, model, identifier):
        judge = self.judge
        for number, kind, access in self.program.lines("registers"):
            number = int(number)
            if judge.read and number in judge.table:
                theirs = judge.frames_of(lambda: judge.ask(model, identifier, number))
                mine = ours.frames(f"read {number}")
                require(mine == theirs, f"read {number}: {mine}, with {judge.name} {theirs}")
                self.note("reads of registers")
            if access == "RO":
                continue
            values = [float(np.float32(self.random.normal(0, 100))), 0.0, 1.0]
            if kind == "uint32":
                values = [int(self.random.integers(0, 2**24)), 0, 2**24 - 1]
            if judge.write is None:
                if number != 10:
                    continue
                values = [1, 2, 3, 4]
            for value in values:
                write = judge.set_mode if judge.write is None else None
                action = (
                    (lambda: write(model, identifier, value))
                    if write
                    else (lambda: judge.write(model, identifier, number, value))
                )
                theirs = once(judge.frames_of(action))
                mine = ours.frames(f"write {number} {value!r}")
                require(mine == theirs, f"write {number} {value}: {mine}, with {judge.name} {theirs}")
                self.note("writes of registers")
        if judge.stores:
            # motorbridge asks for feedback and disables the drive before.
            theirs = judge.frames_of(lambda: judge.switch(model, identifier, "store"))[-1:]
            mine = ours.frames("store")
            require(mine == theirs, f"store: {mine}, with {judge.name} {theirs}")
            self.note("stores of registers")

    def registers(self):
        """The table of the source, that of the program, and that of the judge."""
        source = pathlib.Path(__file__).parent.parent / "src/damiao/model.rs"
        rows = re.findall(r"^    \w+ (\d+) ([FU]32) (R[wo]) \"", source.read_text(), re.MULTILINE)
        kinds = {"F32": "float", "U32": "uint32"}
        source = {int(n): (kinds[kind], access.upper()) for n, kind, access in rows}
        ours = {int(n): (kind, access) for n, kind, access in self.program.lines("registers")}
        require(ours == source, f"judges/src/main.rs does not have {set(source) ^ set(ours)}")
        for number in self.judge.table or {}:
            if number in ours:
                require(ours[number] == self.judge.table[number], f"register {number}")
                self.note("registers of the same kind and access")
            else:
                self.note("registers that we do not have")

    # The simulated drive

    def drive(self):
        from behaviour import Behaviour

        Behaviour(self, Difference).run()


def fields_of(ranges):
    """Position, velocity, kp, kd and torque."""
    p, v, t = ranges
    return [
        Field(-p, p, 0xFFFF),
        Field(-v, v, 0xFFF),
        Field(0.0, 500.0, 0xFFF),
        Field(0.0, 5.0, 0xFFF),
        Field(-t, t, 0xFFF),
    ]


def counts_of(frames):
    """Position, velocity, kp, kd and torque of MIT commands."""
    a, b, c, d, e, f, g, h = frames.astype(np.int64).T
    return np.array(
        [a << 8 | b, c << 4 | d >> 4, (d & 0xF) << 8 | e, f << 4 | g >> 4, (g & 0xF) << 8 | h]
    ).T


def counts_of_feedback(frames):
    _, a, b, c, d, e, _, _ = frames.astype(np.int64).T
    return np.array([a << 8 | b, c << 4 | d >> 4, (d & 0xF) << 8 | e]).T


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("judge", choices=MASTERS)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only")
    arguments = parser.parse_args()
    judge = MASTERS[arguments.judge]()
    for part, defects in DEFECTS.items():
        if arguments.only not in (None, part):
            continue
        begin = time.monotonic()
        for defect in defects:
            if defect == "answer" and judge.read is None:
                continue
            trial = Trial(judge, arguments.program, defect, count=20_000, seed=arguments.seed)
            try:
                getattr(trial, part)()
            except Difference as found:
                print(f"{judge.name}, {part}: finds the planted defect {defect}: {found}")
            else:
                sys.exit(f"{judge.name}, {part}: does not find the planted defect {defect}")
        trial = Trial(judge, arguments.program, count=arguments.count, seed=arguments.seed)
        try:
            getattr(trial, part)()
        except Difference as found:
            sys.exit(f"{judge.name}, {part}: {found}")
        for what, count in trial.notes.items():
            if count:
                print(f"{judge.name}, {part}: {count} {what}")
        print(f"{judge.name}, {part}: as expected ({time.monotonic() - begin:.1f} s)")
    judge.close()


if __name__ == "__main__":
    main()
