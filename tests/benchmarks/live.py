#!/usr/bin/env python3
"""What becomes of live pictures: the thesis' table 5.4, how late commands are, and how many cameras a machine carries.

Records somebody in the room with the programs of this package (built into --programs) and lets the recordings play by
the clock. Leaves in --out: live.md, live.csv, cameras.csv, latency.csv, and cameras.png where gnuplot is installed.
"""

import argparse
import csv
import pathlib
import subprocess
import sys

DETECT = "bgavgdetect"
TRACK = f"{DETECT} ! lkfeaturetrack"
CODECS = {"MJPEG": "avi", "MPEG-4": "mpeg4"}
# The thesis' table 5.4, of an Intel Core i7 M640, 2.8 GHz, two cores: processor (%), memory (MB), pictures a second in detection and in tracking of 30
# that came.
THESIS = {
    ("MJPEG", "640x480"): (3.2, 59.1, 26, 17),
    ("MJPEG", "800x600"): (4.3, 61.2, 25, 16),
    ("MJPEG", "1280x720"): (5.4, 65.1, 23, 15),
    ("MPEG-4", "640x480"): (3.1, 58.1, 27, 17),
    ("MPEG-4", "800x600"): (3.9, 60.1, 24, 16),
    ("MPEG-4", "1280x720"): (4.9, 64.4, 22, 14),
}
CAMERAS = [1, 2, 4, 8, 16]
# Before and after what is counted: cameras start one after the other, and somebody is found.
MARGIN_S = 8
PATIENCE_S = 300


class Bench:
    """The programs and where their recordings are."""

    def __init__(self, programs, out, seconds):
        self.programs, self.out, self.seconds = programs, out, seconds

    def run(self, program, *arguments):
        """The row of CSV that a program prints, as a dictionary."""
        command = [self.programs / program, *map(str, arguments)]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=PATIENCE_S + self.seconds, check=False)
        if done.returncode:
            sys.exit(f"{' '.join(map(str, command))} failed")
        return next(csv.DictReader(done.stdout.splitlines()), {})

    def recording(self, codec, size, rate):
        """A recording of that kind, made where it is not there yet."""
        seconds = self.seconds + MARGIN_S
        path = self.out / f"live-{size}-{rate}fps-{seconds}s.{CODECS[codec]}"
        if not path.exists():
            unfinished = path.with_name(f"unfinished-{path.name}")
            self.run("record", unfinished, size, seconds, 0, 1, rate)
            unfinished.rename(path)
        return path

    def live(self, recording, cameras, elements):
        """What `live` counts, as numbers."""
        row = self.run("live", recording, cameras, self.seconds, elements)
        return {name: float(value) for name, value in row.items()}


def write(path, rows):
    """Dictionaries as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def table_5_4(bench):
    """Markdown of the thesis' table with ours beside it, and its rows."""
    lines = [
        "| live, 30 pictures a second | processor, % of a core | private memory, MB (beyond decoding) | in detection | in tracking | dropped"
        " | thesis: in detection, in tracking |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    rows = []
    for (codec, size), (_, _, detection, tracking) in THESIS.items():
        recording = bench.recording(codec, size, 30)
        runs = {name: bench.live(recording, 1, text) for name, text in
                [("decode", "identity"), ("detect", DETECT), ("track", TRACK)]}
        rows += [{"codec": codec, "size": size, "pipeline": name, **run} for name, run in runs.items()]
        rate = {name: run["delivered"] / run["seconds"] for name, run in runs.items()}
        track = runs["track"]
        memory = f"{track['private_mb']:.0f} ({track['private_mb'] - runs['decode']['private_mb']:+.1f})"
        lines.append(
            f"| {codec} {size} | {100 * track['cores']:.0f} | {memory} | {rate['detect']:.1f} | {rate['track']:.1f}"
            f" | {track['dropped'] + runs['detect']['dropped']:.0f} | {detection}, {tracking} |"
        )
    return "\n".join(lines) + "\n", rows


def many_cameras(bench):
    """Markdown of one process with more and more cameras, and its rows."""
    recording = bench.recording("MJPEG", "1280x720", 10)
    rows = [bench.live(recording, cameras, TRACK) for cameras in CAMERAS]
    lines = [
        "| cameras, 1280x720 MJPEG, 10 pictures a second each | processor, ms a picture | cores | dropped, % | with somebody followed, %"
        " | private memory, MB |",
        "|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        part = {name: 100 * row[name] / max(row["decoded"], 1) for name in ("dropped", "following")}
        lines.append(
            f"| {row['cameras']:.0f} | {row['ms_a_picture']:.2f} | {row['cores']:.2f} | {part['dropped']:.1f}"
            f" | {part['following']:.0f} | {row['private_mb']:.0f} |"
        )
    return "\n".join(lines) + "\n", rows


def plot(out, rows):
    """Processor time a picture and what is dropped, where gnuplot is installed."""
    data = out / "cameras.dat"
    with data.open("w") as file:
        for row in rows:
            dropped = 100 * row["dropped"] / max(row["decoded"], 1)
            file.write(f"{row['cameras']:.0f} {row['ms_a_picture']} {dropped:.2f}\n")
    commands = f"""
        set terminal pngcairo size 900,480 noenhanced font "DejaVu Sans,11"; set output "{out / 'cameras.png'}"
        set xlabel "cameras in one process"; set ylabel "processor ms a picture"; set y2label "pictures dropped, %"
        set xtics {list_of_tics(rows)}; set ytics nomirror; set y2tics; set yrange [0:*]; set y2range [0:100]
        set xrange [0:{CAMERAS[-1] + 1}]; set grid y; set key top left
        plot "{data}" using 1:2 with linespoints linewidth 2 pointtype 7 linecolor rgb "#3b6ea5" title "processor time",\\
             "" using 1:3 axes x1y2 with linespoints linewidth 2 pointtype 5 linecolor rgb "#c9622e" title "dropped"
    """
    try:
        subprocess.run(["gnuplot"], input=commands, text=True, check=True)
    except FileNotFoundError:
        print("no plot: gnuplot is not installed", file=sys.stderr)


def list_of_tics(rows):
    """For gnuplot: a tic for each number of cameras."""
    return "(" + ", ".join(f"{row['cameras']:.0f}" for row in rows) + ")"


def main():
    """Measures everything and writes the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programs", type=pathlib.Path, required=True, help="folder of record, live and latency")
    parser.add_argument("--seconds", type=int, default=20, help="how long each run is counted (default: %(default)s)")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    bench = Bench(arguments.programs, arguments.out, arguments.seconds)
    live, rows = table_5_4(bench)
    write(arguments.out / "live.csv", rows)
    latency = bench.run("latency", arguments.seconds, "1280x720")
    write(arguments.out / "latency.csv", [latency])
    cameras, rows = many_cameras(bench)
    write(arguments.out / "cameras.csv", rows)
    plot(arguments.out, rows)
    late = (
        f"From a decoded picture at the detector to the command at the camera, of {latency['commands']} commands (1280x720, MJPEG):"
        f" median {latency['p50_ms']} ms, 99 % within {latency['p99_ms']} ms.\n"
    )
    text = "\n".join([live, late, cameras])
    (arguments.out / "live.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
