"""Draws a screen that tmux captured with its colours (`capture-pane -p -e`) as SVG.

    svg.py SCREEN >PICTURE.svg

The 16 colours of a terminal, bold and a background; nothing else is used by the bench.
"""

import html
import re
import sys

WIDTH, HEIGHT, SIZE = 8, 17, 13
COLOURS = ["#1e1e1e", "#e05561", "#8cc265", "#d18f52", "#4aa5f0", "#c162de", "#42b3c2", "#d7dae0"]
BRIGHT = ["#7f848e", "#ff616e", "#a5e075", "#f0a45d", "#4dc4ff", "#de73ff", "#4cd1e0", "#ffffff"]
PAPER, INK = "#1e1e1e", "#d7dae0"


def change(style, codes):
    """Returns the style after a sequence of SGR codes: foreground, background, bold."""
    fore, back, bold = style
    codes = [int(code or 0) for code in codes.split(";")]
    while codes:
        code = codes.pop(0)
        if code == 0:
            fore, back, bold = INK, None, False
        elif code == 1:
            bold = True
        elif code == 22:
            bold = False
        elif 30 <= code <= 37:
            fore = COLOURS[code - 30]
        elif code == 39:
            fore = INK
        elif 40 <= code <= 47:
            back = COLOURS[code - 40]
        elif code == 49:
            back = None
        elif 90 <= code <= 97:
            fore = BRIGHT[code - 90]
        elif 100 <= code <= 107:
            back = BRIGHT[code - 100]
        elif code in (38, 48) and codes[:1] == [5]:
            number = codes[1]
            colour = (COLOURS + BRIGHT)[number] if number < 16 else INK
            codes = codes[2:]
            fore, back = (colour, back) if code == 38 else (fore, colour)
        else:
            sys.exit(f"svg.py: SGR {code} is not drawn")
    return fore, back, bold


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        lines = file.read().split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    columns, style, shapes, texts = 0, (INK, None, False), [], []
    for row, line in enumerate(lines):
        column = 0
        for part in re.split(r"(\x1b\[[0-9;]*m)", line):
            found = re.fullmatch(r"\x1b\[([0-9;]*)m", part)
            if found:
                style = change(style, found[1])
                continue
            fore, back, bold = style
            x, y = WIDTH * column, HEIGHT * row
            if back and part:
                shapes.append(f'<rect x="{x}" y="{y}" width="{WIDTH * len(part)}" height="{HEIGHT}" fill="{back}"/>')
            if part.strip():
                weight = ' font-weight="bold"' if bold else ""
                text = html.escape(part)
                length = WIDTH * len(part)
                texts.append(
                    f'<text x="{x}" y="{y + SIZE}" fill="{fore}"{weight} textLength="{length}" xml:space="preserve">{text}</text>'
                )
            column += len(part)
        columns = max(columns, column)
    width, height = WIDTH * columns, HEIGHT * len(lines)
    print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="monospace" font-size="{SIZE}">')
    print(f'<rect width="{width}" height="{height}" fill="{PAPER}"/>')
    print("\n".join(shapes + texts))
    print("</svg>")


main()
