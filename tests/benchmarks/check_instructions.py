#!/usr/bin/env python3
# SPDX-License-Identifier: MPL-2.0
"""Compares instructions, as benches/instructions.rs has just counted them, with those of instructions.csv.

usage: check_instructions.py COUNTED EXPECTED [--accept]

COUNTED is gungraun's folder of that bench, emptied before: with an earlier run to compare with, what it leaves has another form.
Fails where one is more than a tenth off, to either side: what became cheaper is to stay so. With --accept the counts are written
to EXPECTED instead.
"""

import csv
import json
import sys
from pathlib import Path

TOLERANCE = 0.1


def counted(folder: Path) -> dict[str, int]:
    counts = {}
    for path in sorted(folder.rglob("summary.json")):
        summary = json.loads(path.read_text())
        (profile,) = (one for one in summary["profiles"] if one["tool"] == "Callgrind")
        metrics = profile["summaries"]["total"]["summary"]["Callgrind"]["Ir"]["metrics"]
        counts[summary["id"]] = metrics["Left"]["Int"]
    return counts


def main() -> int:
    if len(sys.argv) not in (3, 4) or sys.argv[3:] not in ([], ["--accept"]):
        sys.exit(__doc__)
    counts, expected_path = counted(Path(sys.argv[1])), Path(sys.argv[2])
    if not counts:
        sys.exit(f"{sys.argv[1]}: nothing was counted")
    if sys.argv[3:]:
        with expected_path.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["bench", "instructions"])
            writer.writerows(counts.items())
        return 0
    with expected_path.open() as file:
        expected = {row["bench"]: int(row["instructions"]) for row in csv.DictReader(file)}
    failed = False
    for bench in sorted(expected.keys() | counts.keys()):
        if bench not in expected or bench not in counts:
            print(f"{bench}: in one of the two only")
            failed = True
            continue
        change = counts[bench] / expected[bench] - 1
        failed |= abs(change) > TOLERANCE
        note = "" if abs(change) <= TOLERANCE else "  more than a tenth"
        print(f"{bench:16} {counts[bench] / 1e6:8.1f} M of {expected[bench] / 1e6:8.1f} M  {change:+7.1%}{note}")
    if failed:
        print("If this is meant: make bench-check ARGS=--accept, and say why where it is committed.")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
