# SPDX-License-Identifier: MPL-2.0
"""HOTA (Luiten and others, 2021), IDF1 (Ristani and others, 2016) and CLEAR MOT (Bernardin and Stiefelhagen, 2008) by TrackEval."""

import contextlib
import io
from dataclasses import astuple, dataclass
from pathlib import Path

import trackeval

from motchallenge import TRUTH, sequences, trackers


# Nothing into files; the first fault ends it.
EVALUATOR = {
    "BREAK_ON_ERROR": True,
    "LOG_ON_ERROR": None,
    "OUTPUT_SUMMARY": False,
    "OUTPUT_DETAILED": False,
    "PLOT_CURVES": False,
}


@dataclass(frozen=True)
class Score:
    """Of a tracker over all sequences; in percent but for the switches of identity, which are a count."""

    tracker: str
    hota: float
    deta: float
    assa: float
    idf1: float
    mota: float
    switches: int
    recall: float
    precision: float


def score(folder: Path, iou: float) -> list[Score]:
    """Every tracker of `folder` on all of its sequences. A box is right from an IoU of `iou` on; HOTA averages over 0.05 to 0.95."""
    names = trackers(folder)
    # Only the end of what it prints is wanted, and that we print ourselves.
    with contextlib.redirect_stdout(io.StringIO()):
        dataset = trackeval.datasets.MotChallenge2DBox(
            {
                "GT_FOLDER": str(folder / TRUTH),
                "TRACKERS_FOLDER": str(folder),
                "TRACKERS_TO_EVAL": names,
                "SEQ_INFO": {path.name: None for path in sequences(folder)},
                "SKIP_SPLIT_FOL": True,
                # There are only people: nobody is left out as a distractor.
                "BENCHMARK": "MOT15",
                "DO_PREPROC": False,
            }
        )
        threshold = {"THRESHOLD": iou}
        metrics = [trackeval.metrics.HOTA(), trackeval.metrics.Identity(threshold), trackeval.metrics.CLEAR(threshold)]
        results, _ = trackeval.Evaluator(EVALUATOR).evaluate([dataset], metrics)
    of = results[dataset.get_name()]
    return [_score(name, of[name]["COMBINED_SEQ"]["pedestrian"]) for name in names]


def _score(tracker: str, result: dict) -> Score:
    hota, identity, clear = result["HOTA"], result["Identity"], result["CLEAR"]
    return Score(
        tracker=tracker,
        hota=100 * hota["HOTA"].mean(),
        deta=100 * hota["DetA"].mean(),
        assa=100 * hota["AssA"].mean(),
        idf1=100 * identity["IDF1"],
        mota=100 * clear["MOTA"],
        switches=int(clear["IDSW"]),
        recall=100 * clear["CLR_Re"],
        precision=100 * clear["CLR_Pr"],
    )


def table(scores: list[Score]) -> str:
    """Markdown, best HOTA first."""
    lines = ["| tracker | HOTA | DetA | AssA | IDF1 | MOTA | switches | recall | precision |", "|---" + "|---:" * 8 + "|"]
    for one in sorted(scores, key=lambda one: -one.hota):
        name, *figures = astuple(one)
        cells = [f"{figure}" if isinstance(figure, int) else f"{figure:.1f}" for figure in figures]
        lines.append(f"| {' | '.join([name, *cells])} |")
    return "\n".join(lines) + "\n"
