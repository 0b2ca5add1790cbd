"""The table of docs/virtual-board.md: written by the run, and compared by it."""

from rows import ROWS

HEAD = """# The virtual board

`firmware/virtual/run` executes the release images of `firmware/boards` on a virtual board, unmodified, and does to them what
each row says. The run fails if a row differs from this table, which `firmware/virtual/run --update` writes. `--controls` plants
defects into the images and the chip, each of which a row has to find.

Instructions are executed by Unicorn, each in one cycle at the clock of the chip. The chips are an STM32F407 and an STM32F427
(Cortex-M4F, bxCAN) and an STM32H723 (Cortex-M7, FDCAN), with interrupts that nest, timers, USART, DMA and the independent watchdog.
The models of the chip and of the CAN line are in `firmware/virtual/board`. The motors, the joints and the chassis are those of
`drivetrain::sim`; remote control, IMU, servo, PC and computer are written from their protocols, not with the code of this crate.

No board was there: the model of a register is as right as our reading of the reference manual. Code that others wrote checks it. The
drivers of embassy-stm32, stm32f4xx-hal and bxcan come up unchanged, and the programs `check-embassy`, `check-hal` and `check-h7` use them
as their examples do: CAN in loop-back, a serial port by DMA in both directions, DMA from memory to memory.

Not modelled: wait states and caches, the clock before the PLL runs, the receive error counter, retransmission by the motors,
dominant bits of an error-passive node, extended and remote frames, the FIFO and the bursts of the DMA controller, and the bytes that
a circular DMA stream leaves out when it is switched off and on. A command reaches the motors up to 0.1 ms late. The driver of embassy serves both directions of an FDCAN in one
interrupt: where it is not served, no frame of zeros leaves, so the DM-MC02 has no row `receive starved`.

A robot is driven to the fault once, and each row goes on from there on a copy of the process; one row of each robot but the snake is also
run from power-on, and its trace has to be the same, bit for bit.

* Zeros after: the time from the fault, or from the end of a fault of the line, until the first frame of zeros after which no
  other frame follows; where one motor fails and the others go on, the first from which on its own word is zero. For power-on it is the
  time from reset to the first frame. A dash: the robot goes on, or no zeros are asked for. A joint of the snake robot rests when its
  "disable" was sent: the time is that of the last joint. Without IMU or remote control, a chassis is stopped by its wheels: the time is that until they stand.
* Stale: frames on the wire that are not zero and that waited in the controller for more than a cycle. The age in a queue before it is
  not seen, except by the words in the row `transmit starved`.

| program | fault | in [Faults][faults] | zeros after, ms | stale | then |
|---|---|---|--:|--:|---|
"""
MIDDLE = """
Without a fault, over 50 ms of driving. The jitter is the largest difference between the distance of two commands and 1 ms; the snake
robot sends to its joints before the frame that is looked at. The stack is the deepest one over all rows.

| program | jitter, us | instructions a cycle, mean | busiest | in interrupts, mean | deepest stack, B |
|---|--:|--:|--:|--:|--:|
"""
TAIL = """
[faults]: faults.md
"""
FIGURES = ("jitter_us", "mean", "busiest", "interrupts")


NUMBERS = {row.__name__: row.number for row in ROWS}


def rows(results):
    """Each row as its key and its cells."""
    for (program, fault), result in results.items():
        zero = "-" if result["zero_us"] is None else f"{result['zero_us'] / 1000:.2f}"
        yield (program, fault.replace("_", " ")), (NUMBERS[fault], zero, str(result["stale"]), result["note"])


def costs(results):
    deepest = {}
    for (program, _), result in results.items():
        deepest[program] = max(deepest.get(program, 0), result["stack"])
    for (program, fault), result in results.items():
        if "figures" in result:
            figures = [f"{result['figures'][name]:.0f}" for name in FIGURES]
            yield (program,), (*figures, str(deepest[program]))


def write(results):
    line = lambda key, cells: f"| {' | '.join((*key, *cells))} |\n"
    text = HEAD + "".join(line(*row) for row in rows(results))
    return text + MIDDLE + "".join(line(*row) for row in costs(results)) + TAIL


def read(text):
    found = {}
    for line in text.splitlines():
        if line.startswith("| ") and not line.startswith("| program"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            width = 2 if cells[1][:1].isalpha() else 1
            found[tuple(cells[:width])] = tuple(cells[width:])
    return found


def agrees(known, seen):
    """Equal texts; numbers with a point or above a hundred may move by a fifth: another compiler makes another image."""
    if known == seen:
        return True
    try:
        known_value, seen_value = float(known), float(seen)
    except ValueError:
        return False
    if "." not in known and known_value < 100:
        return False
    return abs(known_value - seen_value) <= max(0.2 * abs(known_value), 0.3 if "." in known else 0)


def differences(text, results):
    known = read(text)
    for key, cells in [*rows(results), *costs(results)]:
        expected = known.pop(key, None)
        if expected is None:
            yield f"{', '.join(key)}: not in the table"
        elif len(expected) != len(cells) or not all(map(agrees, expected, cells)):
            yield f"{', '.join(key)}: the table has {expected}, seen {cells}"
    for key in known:
        yield f"{', '.join(key)}: in the table, not seen"
