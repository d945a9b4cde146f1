#!/usr/bin/env python3
# SPDX-License-Identifier: MPL-2.0
"""Allocations a picture of whole pipelines, whoever makes them: GLib, GStreamer, OpenCV and the decoder too.

Valgrind counts them in a short and in a longer run of a recording; what is beyond the short one is shared out among the pictures
beyond it, so neither the start nor the finding of somebody counts. Leaves allocations.md in --out.
"""

import argparse
import pathlib
import re
import subprocess
import sys

from pipelines import OURS, label, launch

# By then somebody is followed.
SHORT, LONG = 100, 150
TOTAL = re.compile(r"total heap usage: ([\d,]+) allocs, [\d,]+ frees, ([\d,]+) bytes")


def heap_usage(arguments):
    """Allocations of a process, and bytes that these ask for."""
    run = subprocess.run(["valgrind", "--leak-check=no", *arguments], capture_output=True, text=True, check=False)
    found = TOTAL.search(run.stderr)
    if run.returncode or not found:
        sys.exit(f"{' '.join(arguments)}\n{run.stderr}")
    return tuple(int(number.replace(",", "")) for number in found.groups())


def a_picture(recording, elements):
    """Allocations a picture, and bytes."""
    short, long = (heap_usage(launch(recording, elements, pictures)) for pictures in (SHORT, LONG))
    return tuple((more - less) / (LONG - SHORT) for less, more in zip(short, long))


def table(recording):
    """Markdown: what each element adds to what stands before it."""
    lines = [f"| {label(recording)} | allocations a picture | beyond the row above | kB a picture |", "|---|---:|---:|---:|"]
    before = None
    for name, elements in OURS.items():
        count, size = a_picture(recording, elements)
        added = "" if before is None else f"{count - before:.0f}"
        lines.append(f"| {name} | {count:.0f} | {added} | {size / 1000:.0f} |")
        before = count
    return "\n".join(lines) + "\n"


def main():
    """Counts those of all recordings and writes them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=pathlib.Path, help="as those of pipelines.py")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    text = "\n".join(table(recording) for recording in arguments.recordings)
    (arguments.out / "allocations.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
