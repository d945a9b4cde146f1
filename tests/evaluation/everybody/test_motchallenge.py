# SPDX-License-Identifier: MPL-2.0
"""What is written is read, and what is wrong is named."""

import random
import tempfile
import unittest
from pathlib import Path

from motchallenge import Box, parse, parse_motion, read_sequence, render, sequences, trackers, write_tracks


class Text(unittest.TestCase):
    def test_what_is_written_is_read(self) -> None:
        dice = random.Random(1)
        for _ in range(100):
            places = {(dice.randint(1, 50), dice.randint(-1, 9)) for _ in range(dice.randint(0, 30))}
            # Numbers that two digits hold.
            boxes = [
                Box(*place, *(dice.randint(low, 4000) / 4 for low in (-4000, -4000, 1, 1)), 0.5) for place in sorted(places)
            ]
            dice.shuffle(boxes)
            self.assertEqual(parse(render(boxes)), sorted(boxes, key=lambda box: (box.frame, box.track)))

    def test_columns_that_nobody_fills_in_may_be_missing(self) -> None:
        expected = [Box(2, 9, -5.0, 6.0, 7.0, 8.5)]
        for line in ["2,9,-5,6,7,8.5", "2, 9, -5, 6, 7, 8.5, 1, -1, -1, -1\r\n", "\n2,9,-5,6,7,8.5,1,1,0.25\n\n"]:
            self.assertEqual(parse(line), expected, line)
        self.assertEqual(parse(""), [])

    def test_bad_lines_are_named(self) -> None:
        for line in ["1,2,3,4,5", "1;2;3;4;5;6", "1.5,2,3,4,5,6", "0,2,3,4,5,6", "1,2,3,top,5,6", "1,2,3,4,0,6", "1,2,3,4,nan,6"]:
            with self.assertRaisesRegex(ValueError, "^line 2: "):
                parse(f"7,1,1,1,1,1\n{line}\n")

    def test_camera_motion_has_nine_numbers(self) -> None:
        self.assertEqual(parse_motion("3,1,0,2.5e0,0,1,0,0,0,1\n"), {3: (1, 0, 2.5, 0, 1, 0, 0, 0, 1)})
        with self.assertRaisesRegex(ValueError, "^line 1: "):
            parse_motion("3,1,0,2.5,0,1,0\n")


class Folders(unittest.TestCase):
    def test_a_sequence_and_its_trackers_are_found(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            walk = folder / "gt" / "walk"
            (walk / "det").mkdir(parents=True)
            (walk / "det" / "det.txt").write_text("1,-1,1,2,3,4,1,-1,-1,-1\n")
            (walk / "seqinfo.ini").write_text("[Sequence]\nname=walk\nframeRate=12.5\nseqLength=2\nimWidth=640\nimHeight=480\n")
            write_tracks(folder, "ours", "walk", [Box(2, 4, 1, 2, 3, 4)])
            (path,) = sequences(folder)
            sequence = read_sequence(path)
            self.assertEqual((sequence.name, sequence.frame_rate, sequence.length), ("walk", 12.5, 2))
            self.assertEqual((sequence.size, sequence.background), ((640, 480), {}))
            self.assertEqual(sequence.detections, [Box(1, -1, 1, 2, 3, 4)])
            self.assertEqual(trackers(folder), ["ours"])
            (walk / "camera.txt").write_text("2,1,0,3,0,1,0,0,0,1\n")
            self.assertEqual(read_sequence(path).background, {2: (1, 0, 3, 0, 1, 0, 0, 0, 1)})


if __name__ == "__main__":
    unittest.main()
