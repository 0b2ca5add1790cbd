"""Packs the inputs of a fuzz target into one text file, a line of hexadecimal digits each, and back."""

import pathlib
import sys

# So many of a minimised corpus are kept, short and long ones alike.
MOST = 400


def main():
    work, source, target = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    if work == "pack":
        inputs = sorted({path.read_bytes() for path in source.iterdir()}, key=lambda one: (len(one), one))
        target.parent.mkdir(exist_ok=True)
        step = max(1.0, len(inputs) / MOST)
        kept = [inputs[int(index * step)] for index in range(min(MOST, len(inputs)))]
        target.write_text("".join(one.hex() + "\n" for one in kept if one))
    elif work == "unpack":
        target.mkdir(parents=True)
        lines = source.read_text().split() if source.exists() else []
        for number, line in enumerate(lines):
            (target / f"{number:04}").write_bytes(bytes.fromhex(line))
    else:
        sys.exit("corpus.py pack FOLDER FILE | unpack FILE FOLDER")


main()
