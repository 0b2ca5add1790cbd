#!/usr/bin/env python3
"""Links drivetrain-nopanic for four targets at three levels, with --today at the level of the day: it links only when no public function
can panic.

Then looks for what a control loop on a small core must not call, and for public functions that the list lacks.
When an image does not link, names the functions that lead to a panic.
"""

import concurrent.futures
import datetime
import functools
import os
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import image  # noqa: E402

TARGETS = ["thumbv6m-none-eabi", "thumbv7m-none-eabi", "thumbv7em-none-eabihf", "thumbv8m.main-none-eabihf"]
PROFILES = ["release", "o2", "os"]
# Whatever CARGO_TARGET_DIR says.
BUILDS = HERE.parent / "target"
SOURCES = HERE.parent.parent / "src"
END = "a_function_of_drivetrain_can_panic"

# Double precision, 64-bit division, and the functions of libm that compute in double precision.
FORBIDDEN = re.compile(
    r"__aeabi_(d\w+|[a-z0-9]+2d|l?uldivmod|ldivmod)|__\w*df\w*|__u?(div|mod|divmod)[dt]i\w*|sinf|cosf|sincosf|tanf"
)

# Not callable on these targets: with `std` or for the host only.
SKIPPED = {"StdClock"}
# Writes decimals with core::fmt, which has panic paths of its own.
FORMATTING = {"text_line", "describe"}
# What a macro calls the type that it makes, in the sources; and how the list names one of them.
MACROS = {"quantity": r"\$quantity", "name": r"\$name"}
SKIPPED_FOLDERS = {"sim"}


def public_functions():
    """Every public function outside tests as (type or "", name)."""
    found = set()
    for path in sorted(SOURCES.rglob("*.rs")):
        parts = path.relative_to(SOURCES).parts
        if path.name == "tests.rs" or "tests" in parts or parts[0] in SKIPPED_FOLDERS:
            continue
        owner = end = ""
        # Up to the tests in the file; `mod tests;` names another file, and the rest counts.
        code = re.split(r"(?m)^#\[cfg\(test\)\]\n(?:#\[.*\n)*mod \w+ \{", path.read_text())[0]
        for line in code.splitlines():
            if head := re.match(r"(\s*)impl(?:<.*?>)? (?:.* for )?\$?(\w+)", line):
                end, owner = head[1] + "}", head[2]
            elif line == end:
                owner = ""
            elif name := re.match(r"\s*pub (?:const )?fn (\w+)", line):
                if owner not in SKIPPED and name[1] not in FORMATTING:
                    found.add((owner, name[1]))
    return found


def missing():
    listed = "".join(path.read_text() for path in (HERE / "src").glob("*.rs"))
    generic = r"(?:::<[^;]*?>)?"
    names = []
    for owner, name in sorted(public_functions()):
        if owner in MACROS:
            pattern = rf"({MACROS[owner]}){generic}::{name}\b"
        elif owner:
            owners = "Shell" if owner == "Runner" else owner
            pattern = rf"\b({owner}|{owners}){generic}::{name}\b"
        else:
            pattern = rf"\b{name}{generic}(\.call|\()"
        if not re.search(pattern, listed):
            names.append(f"{owner}::{name}" if owner else name)
    return names


def link(target, profile, folder, *more):
    command = ["cargo", "build", "--quiet", "--target", target, "--profile", profile, "--target-dir", str(folder), *more]
    environment = {**os.environ, "CARGO_TERM_COLOR": "never"}
    done = subprocess.run(command, cwd=HERE, env=environment, capture_output=True, text=True)
    return done.returncode == 0, done.stderr


def culprits(target, profile):
    """The functions of the list that lead to a panic."""
    folder = BUILDS / "show"
    flags = f'target.{target}.rustflags=["-C", "symbol-mangling-version=v0"]'
    linked, errors = link(target, profile, folder, "--features=show", "--config", flags)
    if not linked:
        return [errors]
    graph, _ = image.calls(str(folder / target / profile / "drivetrain-nopanic"))
    callers = {}
    for function, callees in graph.items():
        for callee in callees:
            callers.setdefault(callee, set()).add(function)
    leading = image.reachable(callers, [END])
    return sorted(f"{a} -> {b}" for a in leading for b in graph.get(a, ()) if b in leading)


def check(profiles, target):
    """Links the image of one target at these levels. Returns what there is to say, or fails."""
    # A folder of its own: none waits for another.
    folder, said = BUILDS / "links" / target, []
    for profile in profiles:
        linked, errors = link(target, profile, folder)
        if not linked and END not in errors:
            image.fail(errors)
        if not linked:
            image.fail(f"{target}, {profile}: a panic path\n" + "\n".join(culprits(target, profile)))
        elf = str(folder / target / profile / "drivetrain-nopanic")
        helpers = sorted(name for name in image.symbols(elf) if FORBIDDEN.fullmatch(name))
        if helpers:
            image.fail(f"{target}, {profile}: the image calls {', '.join(helpers)}")
        said.append(f"{target:26} {profile:8} links, no helper of double precision or 64-bit division")
    return "\n".join(said)


def main():
    if names := missing():
        image.fail("nopanic/src lacks " + ", ".join(names))
    linked, errors = link(TARGETS[-2], PROFILES[0], BUILDS / "panics", "--features=panics")
    if linked or END not in errors:
        image.fail("f32::clamp, which can panic, was not found: the test would find nothing")
    today = PROFILES[datetime.date.today().toordinal() % len(PROFILES)]
    profiles = [today] if "--today" in sys.argv[1:] else PROFILES
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for said in pool.map(functools.partial(check, profiles), TARGETS):
            print(said, flush=True)
    if left := [profile for profile in PROFILES if profile not in profiles]:
        print("left for other days: " + ", ".join(left))


main()
