"""The figures of the judges, and the table of docs/judged.md, which quotes them.

figures.py check|update FILE...    compares what a whole run has printed with the table, or writes it into the table
"""

import pathlib
import sys

PAGE = pathlib.Path(__file__).parent.parent / "docs/judged.md"
BEGIN, END = "<!-- judged -->\n", "<!-- /judged -->\n"
HEAD = "| part | figure | judge | cases | allowed | worst found | command |\n|---|---|---|--:|--:|--:|---|\n"
#: Of the part that a test holds, not a judge of this folder.
TESTED = "identification"
#: Another machine rounds otherwise. A figure below this share of that in the table is out of date too.
MOST, LEAST = 1.25, 0.5


def figure(part, what, judge, cases, allowed, worst, only, whole=None):
    """Prints a figure; `whole` are the cases of the table, of which a run has a share."""
    print("figure", part, what, judge, cases, short(allowed), repr(float(worst)), f"`judges/run --only {only}`", whole or cases, sep=" | ")


def short(value):
    return f"{value:.2g}".replace("e-0", "e-")


def measured(files):
    """The figures of a run by part, name and judge: those of two runs of a judge together."""
    found = {}
    for file in files:
        for line in pathlib.Path(file).read_text().splitlines():
            mark, *fields = line.split(" | ")
            if mark != "figure":
                continue
            part, what, judge, cases, allowed, worst, command, whole = fields
            former = found.get((part, what, judge), (0, allowed, 0.0, command, 0))
            found[part, what, judge] = (
                former[0] + int(cases), allowed, max(former[2], float(worst)), command, former[4] + int(whole)
            )
    return found


def rounded_up(value):
    """Two digits, and not below the value."""
    text = f"{value:.1e}"
    if float(text) < value:
        text = f"{value + 0.5 * 10 ** (int(text.split('e')[1]) - 1):.1e}"
    return short(float(text))


def rows(text):
    """The rows of the table by part, name and judge."""
    lines = text.split(BEGIN)[1].split(END)[0].removeprefix(HEAD).splitlines()
    fields = ([field.strip() for field in line.strip("|").split("|")] for line in lines)
    return {tuple(row[:3]): row[3:] for row in fields}


def differences(found, table):
    for key, (cases, allowed, worst, command, whole) in found.items():
        name = ", ".join(key)
        if key not in table:
            yield f"{name}: not in the table"
            continue
        if table[key][:2] != [str(whole), allowed] or table[key][3] != command:
            yield f"{name}: {whole} cases, {allowed} allowed by {command}; the table has {table[key]}"
        quoted = float(table[key][2])
        least = LEAST * quoted if cases == whole else 0
        if not least <= worst <= MOST * quoted:
            yield f"{name}: {worst:.3g}; the table has {quoted:.2g}"
    yield from (f"{', '.join(key)}: not measured" for key in table if key not in found and key[0] != TESTED)


def main():
    verb, *files = sys.argv[1:]
    found, text = measured(files), PAGE.read_text()
    table = rows(text)
    if verb == "update":
        kept = {key: row for key, row in table.items() if key[0] == TESTED}
        for key, (cases, allowed, worst, command, whole) in found.items():
            # A share of the cases raises a figure, and lowers none.
            before = float(table[key][2]) if key in table and cases < whole else 0
            kept[key] = [str(whole), allowed, rounded_up(max(worst, before)), command]
        order = ["motion", TESTED, "state space", "balance", "simulator", "arms", "power"]
        lines = [f"| {' | '.join([*key, *row])} |\n" for key, row in sorted(kept.items(), key=lambda pair: order.index(pair[0][0]))]
        before, rest = text.split(BEGIN)
        PAGE.write_text(before + BEGIN + HEAD + "".join(lines) + END + rest.split(END)[1])
        return
    wrong = list(differences(found, table))
    if wrong:
        sys.exit("\n".join(["figures of docs/judged.md:", *wrong]))
    print(f"judges: {len(found)} figures as in docs/judged.md")


if __name__ == "__main__":
    main()
