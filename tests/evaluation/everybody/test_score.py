# SPDX-License-Identifier: MPL-2.0
"""Figures of tracks whose figures are known, and references that follow what is easy to follow. Needs what requirements.txt names."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

from motchallenge import Box, Sequence, render, write_tracks
from references import REFERENCES, affine, follow
from score import Score, score, table

LENGTH = 20


def walk(track: int, left: float, step: float) -> list[Box]:
    return [Box(frame, track, left + step * frame, 50, 30, 80) for frame in range(1, LENGTH + 1)]


class Scores(unittest.TestCase):
    def setUp(self) -> None:
        self._held = tempfile.TemporaryDirectory()
        self.addCleanup(self._held.cleanup)
        self.folder = Path(self._held.name)

    def scored(self, truth: list[Box], tracks: list[Box], iou: float = 0.5) -> Score:
        own = self.folder / "gt" / "walk"
        (own / "gt").mkdir(parents=True, exist_ok=True)
        (own / "gt" / "gt.txt").write_text(render(truth))
        (own / "seqinfo.ini").write_text(f"[Sequence]\nseqLength={LENGTH}\n")
        write_tracks(self.folder, "ours", "walk", tracks)
        (one,) = score(self.folder, iou)
        return one

    def test_the_truth_itself_is_perfect(self) -> None:
        truth = walk(1, 100, 5) + walk(2, 400, -5)
        perfect = Score("ours", *[100.0] * 5, 0, 100.0, 100.0)
        self.assertEqual(self.scored(truth, truth), perfect)

    def test_two_who_change_numbers_half_way_are_two_switches(self) -> None:
        truth = walk(1, 100, 5) + walk(2, 400, -5)
        changed = [Box(box.frame, 3 - box.track if box.frame > LENGTH // 2 else box.track, box.left, 50, 30, 80) for box in truth]
        one = self.scored(truth, changed)
        # 40 boxes, of which 2 are the first with another number; each number is right for half of its person's.
        self.assertEqual((one.switches, one.mota, one.idf1), (2, 95.0, 50.0))
        self.assertEqual((one.deta, one.recall, one.precision), (100.0, 100.0, 100.0))
        # Each pair of a person and a number shares 10 of 30 boxes: the association is right to a third.
        self.assertAlmostEqual(one.assa, 100 / 3)

    def test_nobody_followed_and_nobody_there(self) -> None:
        missed = self.scored(walk(1, 100, 5), [])
        self.assertEqual((missed.hota, missed.idf1, missed.mota, missed.recall), (0.0, 0.0, 0.0, 0.0))
        self.assertEqual(self.scored([], walk(1, 100, 5)).precision, 0.0)

    def test_the_limit_of_iou_decides_for_all_but_hota(self) -> None:
        truth = walk(1, 100, 5)
        # Twelve of thirty columns off: 18 shared of 42.
        beside = [Box(box.frame, 1, box.left + 12, box.top, box.width, box.height) for box in truth]
        strict, lenient = self.scored(truth, beside), self.scored(truth, beside, 0.4)
        self.assertEqual((strict.recall, lenient.recall), (0.0, 100.0))
        self.assertEqual(strict.hota, lenient.hota)

    def test_the_best_stands_first(self) -> None:
        lines = table([Score("worse", 1.0, 1, 1, 1, 1, 3, 1, 1), Score("better", 2.0, 1, 1, 1, 1, 0, 1, 1)]).splitlines()
        self.assertEqual([line.split(" | ")[0] for line in lines], ["| tracker", "|---" + "|---:" * 8 + "|", "| better", "| worse"])


class References(unittest.TestCase):
    def test_two_apart_are_two_tracks(self) -> None:
        boxes = [Box(box.frame, -1, box.left, box.top, box.width, box.height) for box in walk(1, 100, 3) + walk(2, 400, -3)]
        sequence = Sequence("walk", 25.0, LENGTH, (640, 480), boxes)
        for name in REFERENCES:
            tracks = follow(name, sequence)
            self.assertEqual(len({box.track for box in tracks}), 2, name)
            self.assertGreater(len(tracks), 2 * LENGTH - 8, name)

    def test_nobody_is_nobody(self) -> None:
        for name in REFERENCES:
            self.assertEqual(follow(name, Sequence("empty", 25.0, LENGTH, (640, 480), [])), [], name)

    def test_camera_motion_that_is_known_keeps_a_track(self) -> None:
        # Somebody stands while the camera jumps by more than they are wide.
        jump = LENGTH // 2
        boxes = [Box(frame, -1, 300 if frame < jump else 200, 50, 30, 80) for frame in range(1, LENGTH + 1)]
        still, told = ({}, {jump: (1.0, 0.0, -100.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)})
        tracks = [follow("BoT-SORT", Sequence("jump", 25.0, LENGTH, (640, 480), boxes, motion)) for motion in (still, told)]
        self.assertEqual([len({box.track for box in boxes}) for boxes in tracks], [2, 1])

    def test_an_affine_map_moves_the_middle_as_the_homography_does(self) -> None:
        homography = (1.02, 0.01, -30.0, -0.02, 0.99, 5.0, 1e-4, -5e-5, 1.0)
        matrix = affine(homography, (640, 480))
        for place, within in (((320.0, 240.0), 1e-9), ((330.0, 235.0), 0.05)):
            there = np.reshape(homography, (3, 3)) @ [*place, 1.0]
            np.testing.assert_allclose(matrix @ [*place, 1.0], there[:2] / there[2], atol=within)


if __name__ == "__main__":
    unittest.main()
