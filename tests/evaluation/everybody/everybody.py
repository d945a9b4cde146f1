#!/usr/bin/env python3
# SPDX-License-Identifier: MPL-2.0
"""Scores who is who: ours, and SORT, ByteTrack, OC-SORT and BoT-SORT over the same regions.

Takes a folder of MOTChallenge sequences as `evaluate --motchallenge FOLDER` leaves it, with every tracker that is in it, writes
the references' tracks there, and the table into everybody.md.
"""

import argparse
from pathlib import Path

from motchallenge import read_sequence, sequences, write_tracks
from references import REFERENCES, follow
from score import score, table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="with gt/ and trackers in it")
    parser.add_argument("--iou", type=float, default=0.5, help="from which on a box is right, for all but HOTA (%(default)s)")
    args = parser.parse_args()
    for path in sequences(args.folder):
        sequence = read_sequence(path)
        for name in REFERENCES:
            write_tracks(args.folder, name, sequence.name, follow(name, sequence))
    text = table(score(args.folder, args.iou))
    (args.folder / "everybody.md").write_text(text)
    print(text, end="")


if __name__ == "__main__":
    main()
