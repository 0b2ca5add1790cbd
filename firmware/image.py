"""What the scripts of this folder read from an ELF image, with the tools of rustup's `llvm-tools`."""

import glob
import re
import subprocess
import sys


def fail(message):
    sys.exit(f"firmware: {message}")


def output(command, **options):
    try:
        done = subprocess.run(command, capture_output=True, text=True, **options)
    except FileNotFoundError:
        fail(f"{command[0]} is not installed; run firmware/run, which installs it")
    if done.returncode:
        fail(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


def llvm(name, *arguments):
    sysroot = output(["rustc", "--print", "sysroot"]).strip()
    found = glob.glob(f"{sysroot}/lib/rustlib/*/bin/{name}")
    if not found:
        fail(f"{name} is missing: rustup component add llvm-tools")
    return output([found[0], *arguments])


def symbols(elf):
    return {line.split()[-1] for line in llvm("llvm-nm", elf).splitlines()}


def code_sizes(elf):
    """Bytes of each function."""
    sizes = {}
    for line in llvm("llvm-nm", "--print-size", elf).splitlines():
        fields = line.split()
        if len(fields) == 4 and fields[2] in "tT":
            sizes[fields[3]] = int(fields[1], 16)
    return sizes


def calls(elf):
    """For each function those that it calls or jumps to, and the functions with calls through a pointer."""
    graph, indirect, current = {}, set(), None
    for line in llvm("llvm-objdump", "-d", "--no-show-raw-insn", elf).splitlines():
        if head := re.match(r"[0-9a-f]+ <(.+)>:", line):
            current = head[1]
            graph.setdefault(current, set())
        elif jump := re.search(r"\tb[a-z.]*\s+0x[0-9a-f]+ <([^+>]+)>", line):
            if jump[1] != current:
                graph[current].add(jump[1])
        elif re.search(r"\tblx\s+r\d|\tbx\s+r\d", line):
            indirect.add(current)
    return graph, indirect


def reachable(graph, roots):
    seen, open_ = set(), list(roots)
    while open_:
        function = open_.pop()
        if function not in seen:
            seen.add(function)
            open_ += graph.get(function, ())
    return seen


def frames(elf):
    """Bytes of stack of each function itself; only in an image built with `-Z emit-stack-sizes`."""
    sizes = {}
    found = re.findall(
        r"Functions: \[(.*?)\]\s+Size: (0x[0-9A-Fa-f]+)", llvm("llvm-readobj", "--stack-sizes", elf)
    )
    for names, size in found:
        for name in names.split(", "):
            sizes[name] = int(size, 16)
    return sizes


def stack_bound(graph, sizes, function, path=()):
    """Bytes of stack on the deepest path from a function, and the functions on no account (recursive or without a frame)."""
    if function in path:
        fail(f"{function} is recursive")
    unknown = set() if function in sizes else {function}
    deepest = 0
    for callee in graph.get(function, ()):
        depth, more = stack_bound(graph, sizes, callee, (*path, function))
        deepest, unknown = max(deepest, depth), unknown | more
    return sizes.get(function, 0) + deepest, unknown


def loaded_bytes(elf):
    """Bytes of code, constants and initial values: what a flash holds of an image."""
    kept = (".text", ".rodata", ".data", ".vector_table")
    lines = [line.split() for line in llvm("llvm-size", "-A", elf).splitlines()]
    return sum(int(fields[1]) for fields in lines if fields and fields[0] in kept)
