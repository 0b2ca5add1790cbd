"""Puts the page, its scripts, the code of the robot and the compiled crate into one file: assemble.py WASM OUT."""

import base64
import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
# What the page may weigh, in bytes.
LIMIT = 1_000_000


def main(wasm, out):
    def read(name):
        return (HERE / name).read_text(encoding="utf-8")

    page = read("page/index.html")
    parts = {
        "/*STYLE*/": read("page/style.css"),
        "/*WASM*/": base64.b64encode(pathlib.Path(wasm).read_bytes()).decode(),
        # A closing tag in a string would end the script.
        '/*ROBOT*/""': json.dumps(read("src/robot.rs")).replace("</", "<\\/"),
        "/*TEXTS*/": read("page/texts.js"),
        "/*DRAW*/": read("page/draw.js"),
        "/*MAIN*/": read("page/main.js"),
    }
    for mark, text in parts.items():
        if page.count(mark) != 1:
            sys.exit(f"playground: page/index.html has {page.count(mark)} places for {mark}, not one")
        page = page.replace(mark, text)
    data = page.encode()
    if len(data) > LIMIT:
        sys.exit(f"playground: the page has {len(data)} bytes, {LIMIT} are allowed")
    pathlib.Path(out).write_bytes(data)
    print(f"{out} ({len(data)} bytes)")


if __name__ == "__main__":
    main(*sys.argv[1:])
