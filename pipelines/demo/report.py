# SPDX-License-Identifier: MPL-2.0
"""What the demonstration leaves behind."""

import csv
import json
import math
import subprocess

STATES = {"tracking": "#c9efd2", "occluded": "#ffe3b8"}


def summarise(progress, status, at_rest, arguments):
    """The figures of the run; times in seconds, offsets in frame widths and heights."""
    followed = [sample for sample in progress.samples if sample["state"] == "tracking" and sample["offset"]]
    # Where the camera cannot turn any further, the offset says nothing about how well it follows.
    distances = [math.hypot(*sample["offset"]) for sample in followed if not sample["at_limit"]]
    first = next((index for index, sample in enumerate(progress.samples) if sample["target"]), None)
    since_first = progress.samples[first:] if first is not None else []
    targets = {sample["target"] for sample in progress.samples if sample["target"]}
    return {
        "codec": arguments.codec,
        "world": " ".join(arguments.world),
        "duration_s": round(progress.seconds(), 1),
        "frames": progress.frames,
        "targets": len(targets),
        "time_to_acquire_s": time_to_acquire(progress.events),
        "tracked_share_since_acquired": rounded(len(followed) / len(since_first) if since_first else None),
        "mean_offset_within_reach": rounded(sum(distances) / len(distances) if distances else None),
        "commands": status["commands"],
        "camera_at_rest": at_rest,
        "pipeline_exit_code": progress.exit_code,
        "events": progress.events,
        "passed": at_rest and bool(targets) and progress.exit_code == 0,
    }


def time_to_acquire(events):
    """From the start of the motion that led to the first target until it was acquired."""
    start = None
    for event in events:
        time = event["running_time"]
        if time is None:
            continue
        if event["text"] == "motion start":
            start = time
        elif event["text"].startswith("target acquired"):
            return None if start is None else rounded((time - start) / 1e9)
    return None


def rounded(number):
    return None if number is None else round(number, 3)


def in_words(summary):
    """The summary as lines of text."""

    def shown(key, unit="", scale=1):
        number = summary[key]
        return "unknown" if number is None else f"{number * scale:.3g}{unit}"

    return "\n".join(
        [
            "",
            f"acquired              {shown('time_to_acquire_s', ' s after motion began')}",
            f"tracked since then    {shown('tracked_share_since_acquired', ' % of the time', 100)}",
            f"targets in turn       {summary['targets']}",
            f"mean offset           {shown('mean_offset_within_reach', ' of the frame, within reach')}",
            f"commands sent         {summary['commands']}",
            f"frames                {summary['frames']} in {summary['duration_s']} s",
            f"camera afterwards     {'at rest' if summary['camera_at_rest'] else 'STILL MOVING'}",
            "passed" if summary["passed"] else "FAILED",
        ]
    )


def write(progress, summary, out):
    """Writes summary, samples and plot into the folder `out`."""
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    (out / "summary.txt").write_text(in_words(summary).lstrip() + "\n")
    with open(out / "samples.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["seconds", "state", "target", "dx", "dy", "pan", "tilt"])
        for sample in progress.samples:
            dx, dy = sample["offset"] or ("nan", "nan")
            row = [sample["seconds"], sample["state"], sample["target"], dx, dy, sample["pan"], sample["tilt"]]
            table.writerow([round(cell, 4) if isinstance(cell, float) else cell for cell in row])
    plot(progress.samples, out)


def spans(samples):
    """Stretches of one state: (state, from, to)."""
    begin = 0
    for index in range(1, len(samples) + 1):
        if index == len(samples) or samples[index]["state"] != samples[begin]["state"]:
            end = samples[min(index, len(samples) - 1)]["seconds"]
            yield samples[begin]["state"], samples[begin]["seconds"], end
            begin = index


def plot(samples, out):
    """Offset above, pan and tilt below, over time; the states as ground."""
    if not samples:
        return
    ground = [
        f'set object rectangle from {begin:.3f}, graph 0 to {end:.3f}, graph 1 behind '
        f'fillcolor rgb "{STATES[state]}" fillstyle solid noborder'
        for state, begin, end in spans(samples)
        if state in STATES
    ]
    script = f"""
set terminal pngcairo size 1200, 800 font "DejaVu Sans,11" background "white"
set output "plot.png"
set datafile separator ","
set multiplot layout 2, 1 title "The target in the picture, and what the camera did (ground: green tracking, orange occluded)"
set key outside top right horizontal
set grid back linecolor rgb "#dddddd"
set xrange [0:{samples[-1]["seconds"]:.3f}]
set xlabel "seconds"
{chr(10).join(ground)}
set ylabel "offset from the middle"
set yrange [-0.5:0.5]
plot "samples.csv" skip 1 using 1:4 with lines linewidth 2 linecolor rgb "#1f5fbf" title "dx (frame widths)", \\
     "" skip 1 using 1:5 with lines linewidth 2 linecolor rgb "#c0392b" title "dy (frame heights)"
set ylabel "degrees"
set yrange [*:*]
plot "samples.csv" skip 1 using 1:6 with lines linewidth 2 linecolor rgb "#1f5fbf" title "pan", \\
     "" skip 1 using 1:7 with lines linewidth 2 linecolor rgb "#c0392b" title "tilt"
"""
    subprocess.run(["gnuplot"], input=script, text=True, cwd=out, check=True)
