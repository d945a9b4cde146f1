# SPDX-License-Identifier: MPL-2.0
"""Trackers of several people by other hands, over the regions that our detector gives, with the library's own settings.

Regions have no score: all count as certain, so the second association of ByteTrack and BoT-SORT, which is for weak detections,
finds none. BoT-SORT is told how the background moved, which it would estimate from the pictures; it knows no appearance.
"""

from collections import defaultdict
from collections.abc import Callable

import numpy as np
import supervision
from trackers import BoTSORTTracker, ByteTrackTracker, OCSORTTracker, SORTTracker

from motchallenge import Box, Homography, Sequence

Tracker = SORTTracker | ByteTrackTracker | OCSORTTracker | BoTSORTTracker


def _bot_sort(sequence: Sequence) -> Tracker:
    tracker = BoTSORTTracker(frame_rate=sequence.frame_rate)
    tracker.cmc = KnownMotion(sequence)
    return tracker


REFERENCES: dict[str, Callable[[Sequence], Tracker]] = {
    "SORT": lambda sequence: SORTTracker(frame_rate=sequence.frame_rate),
    "ByteTrack": lambda sequence: ByteTrackTracker(frame_rate=sequence.frame_rate),
    "OC-SORT": lambda sequence: OCSORTTracker(frame_rate=sequence.frame_rate),
    "BoT-SORT": _bot_sort,
}


class KnownMotion:
    """Stands in for the library's estimate of camera motion: tells one frame's after the other's."""

    def __init__(self, sequence: Sequence) -> None:
        self._sequence = sequence
        self._frame = 0

    def estimate(self, _picture: np.ndarray, _boxes: np.ndarray | None = None) -> np.ndarray:
        """2x3, from places of the frame before to those of this one."""
        self._frame += 1
        motion = self._sequence.background.get(self._frame)
        return np.eye(2, 3) if motion is None else affine(motion, self._sequence.size)


def affine(homography: Homography, size: tuple[int, int]) -> np.ndarray:
    """The 2x3 matrix that moves as the homography does near the middle of a picture of that size."""
    matrix = np.reshape(homography, (3, 3))
    middle = np.array([size[0] / 2, size[1] / 2, 1.0])
    x, y, w = matrix @ middle
    there = np.array([x, y]) / w
    slope = (matrix[:2, :2] - np.outer(there, matrix[2, :2])) / w
    return np.column_stack([slope, there - slope @ middle[:2]])


def follow(name: str, sequence: Sequence) -> list[Box]:
    """The tracks that reference `name` makes of the sequence's detections."""
    tracker = REFERENCES[name](sequence)
    # It asks for the background's motion only where there is a picture.
    picture = np.empty((0, 0, 3), dtype=np.uint8) if isinstance(tracker, BoTSORTTracker) else None
    detections = defaultdict(list)
    for box in sequence.detections:
        detections[box.frame].append(box)
    tracks = []
    for frame in range(1, sequence.length + 1):
        boxes = detections[frame]
        found = supervision.Detections(
            xyxy=np.array([box.corners for box in boxes], dtype=np.float32).reshape(-1, 4),
            confidence=np.array([box.confidence for box in boxes], dtype=np.float32),
        )
        followed = tracker.update(found, frame=picture)
        pairs = zip(followed.tracker_id, followed.xyxy, strict=True)
        tracks += [_box(frame, track, corners) for track, corners in pairs if track >= 0]
    return tracks


def _box(frame: int, track: int, corners: np.ndarray) -> Box:
    left, top, right, bottom = (float(number) for number in corners)
    return Box(frame, int(track), left, top, right - left, bottom - top)
