# SPDX-License-Identifier: MPL-2.0
"""Boxes and sequences as the MOTChallenge keeps them (arXiv:1603.00831), in the folders that TrackEval reads:

    FOLDER/gt/SEQUENCE/seqinfo.ini         frames a second, how many frames
    FOLDER/gt/SEQUENCE/gt/gt.txt           the truth
    FOLDER/gt/SEQUENCE/det/det.txt         what the detector saw: tracks of number -1
    FOLDER/gt/SEQUENCE/camera.txt          how the background moved, where the camera did: frame, then the homography from the
                                           frame before, row by row, in pixels
    FOLDER/TRACKER/data/SEQUENCE.txt       what a tracker said
"""

import configparser
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

TRUTH = "gt"
Homography = tuple[float, ...]


@dataclass(frozen=True)
class Box:
    """A detection (track -1), or where a track is; left, top, width and height in pixels, frames from 1."""

    frame: int
    track: int
    left: float
    top: float
    width: float
    height: float
    confidence: float = 1.0

    @property
    def corners(self) -> tuple[float, float, float, float]:
        return self.left, self.top, self.left + self.width, self.top + self.height


@dataclass(frozen=True)
class Sequence:
    """A recording without its pictures: frames a second, how many, their size, what the detector saw, how the background moved."""

    name: str
    frame_rate: float
    length: int
    size: tuple[int, int]
    detections: list[Box]
    background: dict[int, Homography] = field(default_factory=dict)


def sequences(folder: Path) -> list[Path]:
    return sorted(path for path in (folder / TRUTH).iterdir() if path.is_dir())


def trackers(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name != TRUTH and (path / "data").is_dir())


def read_sequence(folder: Path) -> Sequence:
    info = configparser.ConfigParser(interpolation=None)
    info.read_string((folder / "seqinfo.ini").read_text())
    entry = info["Sequence"]
    camera = folder / "camera.txt"
    return Sequence(
        name=folder.name,
        frame_rate=float(entry["frameRate"]),
        length=int(entry["seqLength"]),
        size=(int(entry["imWidth"]), int(entry["imHeight"])),
        detections=parse((folder / "det" / "det.txt").read_text()),
        background=parse_motion(camera.read_text()) if camera.exists() else {},
    )


def write_tracks(folder: Path, tracker: str, sequence: str, boxes: Iterable[Box]) -> None:
    file = folder / tracker / "data" / f"{sequence}.txt"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(render(boxes))


def parse(text: str) -> list[Box]:
    """Lines of frame,track,left,top,width,height[,confidence[,...]]; a ValueError names the first that is none."""
    return [_box(number, line) for number, line in _lines(text)]


def parse_motion(text: str) -> dict[int, Homography]:
    """Homographies of nine numbers, by frame; a ValueError names the first line that is none."""
    motion = {}
    for number, line in _lines(text):
        frame, *numbers = line.split(",")
        if len(numbers) != 9:
            raise ValueError(f"line {number}: expected a frame and nine numbers, not `{line}`")
        motion[int(frame)] = tuple(float(one) for one in numbers)
    return motion


def render(boxes: Iterable[Box]) -> str:
    return "".join(
        f"{box.frame},{box.track},{box.left:.2f},{box.top:.2f},{box.width:.2f},{box.height:.2f},{box.confidence:g},-1,-1,-1\n"
        for box in sorted(boxes, key=lambda box: (box.frame, box.track))
    )


def _lines(text: str) -> list[tuple[int, str]]:
    return [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]


def _box(number: int, line: str) -> Box:
    fields = line.split(",")
    try:
        frame, track = int(fields[0]), int(fields[1])
        left, top, width, height, *confidence = (float(one) for one in fields[2:7])
    except (ValueError, IndexError) as error:
        raise ValueError(f"line {number}: expected frame,track,left,top,width,height, not `{line}`") from error
    if frame < 1 or not (width > 0 and height > 0):
        raise ValueError(f"line {number}: frames count from 1 and a box has a size, not `{line}`")
    return Box(frame, track, left, top, width, height, *confidence)
