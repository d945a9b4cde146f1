#!/usr/bin/env python3
"""What following costs beside decoding: processor time of whole pipelines from a file, as fast as they go.

Each pipeline is a process of its own. The runs of all of them are interleaved, so that what else the machine does
meets them alike; a run that loads the plugins and decodes one picture is subtracted. Leaves in --out: runs.csv
(every run), pipelines.md (medians and ratios to decoding alone) and pipelines.png where gnuplot is installed.
"""

import argparse
import csv
import os
import pathlib
import platform
import shlex
import statistics
import subprocess
import sys
import threading

CODECS = {".avi": "MJPEG", ".mpeg4": "MPEG-4"}
DECODERS = {".avi": "avidemux ! jpegdec", ".mpeg4": "avidemux ! avdec_mpeg4"}
DETECT = "bgavgdetect"
TRACK = f"{DETECT} ! lkfeaturetrack"
OURS = {
    "decode": "",
    "+ detect": DETECT,
    "+ detect + track": TRACK,
    "+ detect + track + overlay": f"{TRACK} ! ptzoverlay",
}
# Others' elements, where they are installed. The trackers are given the middle of the picture.
BOX = "object-initial-x={x} object-initial-y={y} object-initial-width={w} object-initial-height={h} draw-rect=false"
PEERS = {
    "motioncells": "videoconvert ! motioncells display=false",
    "segmentation MOG2": "videoconvert ! segmentation method=mog2",
    "cvtracker MOSSE": f"videoconvert ! cvtracker algorithm=5 {BOX}",
    "cvtracker KCF": f"videoconvert ! cvtracker algorithm=2 {BOX}",
}
# A pipeline that takes longer has stalled.
PATIENCE_S = 600


def launch(recording, elements, pictures=None):
    """The arguments of gst-launch-1.0."""
    decoder = DECODERS[recording.suffix]
    limit = f"! identity eos-after={pictures + 1} " if pictures else ""
    tail = f"! {elements} " if elements else ""
    text = f"filesrc location={shlex.quote(str(recording))} ! {decoder} {limit}{tail}! fakesink sync=false"
    return ["gst-launch-1.0", "-q", *shlex.split(text)]


def processor_s(arguments):
    """Seconds of processor time, of all threads, that a process takes."""
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    watch = threading.Timer(PATIENCE_S, process.kill)
    watch.start()
    complaints = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    watch.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{shlex.join(arguments)}\n{complaints}")
    return usage.ru_utime + usage.ru_stime


def is_installed(element):
    """Whether GStreamer knows the element."""
    return subprocess.run(["gst-inspect-1.0", "--exists", element], check=False).returncode == 0


def chosen_pipelines(size):
    """Name and elements of each pipeline that can run here."""
    width, height = size
    box = {"x": width // 2 - 40, "y": height // 2 - 80, "w": 80, "h": 160}
    peers = {name: text.format(**box) for name, text in PEERS.items()}
    usable = {name: text for name, text in peers.items() if is_installed(text.split(" ! ")[1].split()[0])}
    return OURS | usable


def measure(recording, pipelines, pictures, rounds):
    """Milliseconds a picture of each pipeline, one value for each round."""
    runs = {name: [] for name in pipelines}
    for round_number in range(rounds + 1):
        for name, elements in pipelines.items():
            whole = processor_s(launch(recording, elements))
            start = processor_s(launch(recording, elements, pictures=1))
            # The first round fills caches and registry.
            if round_number:
                runs[name].append(1000 * (whole - start) / (pictures - 1))
    return runs


def label(recording):
    """What it is called in tables and plots."""
    *world, camera = recording.stem.split("-")
    return ", ".join([CODECS[recording.suffix], *world, f"camera {camera}"])


def table(recording, runs):
    """Markdown: median, the range of the runs, and the ratio to decoding."""
    decode = statistics.median(runs["decode"])
    lines = [f"| {label(recording)} | ms a picture | lowest to highest | to decoding |", "|---|---|---|---|"]
    for name, values in runs.items():
        median = statistics.median(values)
        extent = f"{min(values):.2f} to {max(values):.2f}"
        lines.append(f"| {name} | {median:.2f} | {extent} | {median / decode:.2f} |")
    return "\n".join(lines) + "\n"


def machine():
    """Processor and software, as far as they tell."""
    model = platform.processor()
    cpuinfo = pathlib.Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":")[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        model = names[0] if names else model
    version = subprocess.run(["gst-inspect-1.0", "--version"], capture_output=True, text=True, check=True)
    return f"{model}, {os.cpu_count()} cores, {version.stdout.splitlines()[-2]}"


def plot(out, results):
    """Bars of the medians, a group for each pipeline, where gnuplot is installed."""
    data, recordings = out / "pipelines.dat", list(results)
    with data.open("w") as file:
        file.write(" ".join(f'"{text}"' for text in ["pipeline", *map(label, recordings)]) + "\n")
        for name in results[recordings[0]]:
            medians = (f"{statistics.median(results[recording][name]):.3f}" for recording in recordings)
            file.write(f'"{name}" {" ".join(medians)}\n')
    commands = f"""
        set terminal pngcairo size 1000,560 noenhanced font "DejaVu Sans,11"; set output "{out / 'pipelines.png'}"
        set style data histograms; set style histogram clustered gap 1; set style fill solid 0.85 noborder; set boxwidth 0.9
        set linetype 1 linecolor rgb "#3b6ea5"; set linetype 2 linecolor rgb "#8fb3d9"
        set linetype 3 linecolor rgb "#1f4468"; set linetype 4 linecolor rgb "#5f8fc0"
        set linetype 5 linecolor rgb "#c9622e"; set linetype 6 linecolor rgb "#eab38f"
        set linetype 7 linecolor rgb "#8a3f18"; set linetype 8 linecolor rgb "#dd8a5a"
        set key top left; set yrange [0:*]; set ylabel "processor ms a picture"; set grid y
        set xtics nomirror rotate by -25 scale 0; set ytics nomirror; set border 3; set rmargin 12
        plot for [column=2:{len(recordings) + 1}] "{data}" using column:xtic(1) title columnheader
    """
    try:
        subprocess.run(["gnuplot"], input=commands, text=True, check=True)
    except FileNotFoundError:
        print("no plot: gnuplot is not installed", file=sys.stderr)


def main():
    """Measures all recordings and writes the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="+", type=pathlib.Path, help="AVI files of which the name ends in .avi (MJPEG) or .mpeg4")
    parser.add_argument("--pictures", type=int, required=True, help="how many there are in each recording")
    parser.add_argument("--size", default="1280x720", help="of the pictures, WIDTHxHEIGHT")
    parser.add_argument("--rounds", type=int, default=5, help="runs of each pipeline (default: %(default)s)")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the results")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    pipelines = chosen_pipelines(tuple(int(side) for side in arguments.size.split("x")))
    results = {}
    for recording in arguments.recordings:
        results[recording] = measure(recording, pipelines, arguments.pictures, arguments.rounds)
    with (arguments.out / "runs.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["recording", "pipeline", "round", "ms_a_picture"])
        for recording, runs in results.items():
            for name, values in runs.items():
                writer.writerows([label(recording), name, index, f"{ms:.4f}"] for index, ms in enumerate(values))
    tables = "\n".join(table(recording, runs) for recording, runs in results.items())
    text = f"{machine()}; {arguments.size}, {arguments.pictures} pictures, medians of {arguments.rounds} runs.\n\n{tables}"
    (arguments.out / "pipelines.md").write_text(text)
    print(text)
    plot(arguments.out, results)


if __name__ == "__main__":
    main()
