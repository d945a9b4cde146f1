# SPDX-License-Identifier: MPL-2.0
"""What `gst-launch-1.0 -m` prints, and what it tells about the run."""

import re
import time

MESSAGE = re.compile(r'Got message #\d+ from element "([^"]*)" \(element\): ([\w-]+), (.*);$')
FIELD = re.compile(r"([\w-]+)=\((\w+)\)(<[^>]*>|\"(?:[^\"\\]|\\.)*\"|[^,;]*)")


def parse(line):
    """The element message in a line: its name and fields, or None."""
    found = MESSAGE.match(line.strip())
    if not found:
        return None
    _, name, text = found.groups()
    return name, {field: value(kind, word) for field, kind, word in FIELD.findall(text)}


def value(kind, word):
    """A field's value: a number, a list of numbers, or words."""
    if word.startswith("<"):
        return [float(number) for number in re.findall(r"[-+\d.][-+.\deE]*", re.sub(r"\(\w+\)", "", word))]
    if kind in ("double", "float"):
        return float(word)
    if kind.startswith(("int", "uint", "gint", "guint")):
        return int(word)
    return re.sub(r"\\(.)", r"\1", word.strip('"'))


class Progress:
    """Collects what happened, second by second."""

    def __init__(self):
        # When the pictures began to come: getting there takes as long as it takes, and is no part of the run.
        self.started = None
        self.samples = []
        self.events = []
        self.state = "searching"
        self.target = 0
        self.offset = None
        self.camera = None
        self.frames = 0
        self.exit_code = None

    def seconds(self):
        return 0.0 if self.started is None else time.monotonic() - self.started

    def sample(self, camera, limits):
        """Notes the present together with the camera's status and the limits of its pan and tilt."""
        self.camera = camera
        if self.started is None:
            return
        angles = {"pan_deg": camera["pan_deg"], "tilt_deg": camera["tilt_deg"]}
        at_limit = any(abs(angle - end) < 0.1 for key, angle in angles.items() for end in limits[key])
        self.samples.append(
            {
                "seconds": self.seconds(),
                "state": self.state,
                "target": self.target,
                "offset": self.offset,
                "pan": camera["pan_deg"],
                "tilt": camera["tilt_deg"],
                "at_limit": at_limit,
            }
        )

    def take(self, message):
        """Takes a message in and returns what a reader should see of it."""
        name, fields = message
        if name == "ptztrack-target":
            return self._target(fields)
        if name == "ptztrack-motion":
            return self._event(f"motion {fields['change']}", fields)
        if name == "ptztrack-camera":
            return self._event(f"camera {fields['change']}: {fields.get('detail', '')}", fields)
        if name == "progress":
            return self._second(fields["current"])
        return None

    def _target(self, fields):
        self.state = fields["state"]
        self.target = fields["id"]
        x, y = fields["centroid"]
        self.offset = (x - 0.5, y - 0.5) if self.state in ("tracking", "occluded") else None
        if fields["change"] == "position":
            return None
        text = self._event(f"target {fields['change']}: #{self.target}", fields)
        if self.state == "lost":
            self.state = "searching"
        return text

    def _event(self, text, fields):
        self.events.append({"seconds": self.seconds(), "running_time": fields.get("running-time"), "text": text})
        # Motion comes and goes all the time, and the camera moves as long as it follows: only the summary has them.
        usual = text.startswith(("motion", "camera moving", "camera stopped"))
        return None if usual else f"{self.seconds():6.1f} s  {text}"

    def _second(self, frames):
        if self.started is None:
            self.started = time.monotonic()
        rate, self.frames = frames - self.frames, frames
        if self.camera is None:
            return None
        target = f"#{self.target}" if self.offset else "-"
        offset = "dx {:+.2f} dy {:+.2f}".format(*self.offset) if self.offset else ""
        return (
            f"{self.seconds():6.1f} s  {self.state:<9} {target:<4} {offset:<18}"
            f"  pan {self.camera['pan_deg']:+7.2f}  tilt {self.camera['tilt_deg']:+7.2f}  {rate:3} fps"
        )
