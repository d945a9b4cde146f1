# SPDX-License-Identifier: MPL-2.0
"""The virtual camera as a child process."""

import json
import re
import subprocess
import time
import urllib.request


class VirtualCamera:
    """Runs while the `with` block does."""

    user = "root"
    password = "demonstration"

    def __init__(self, program, world, log):
        """`world` are the options of the program that say what it looks at."""
        self.process = subprocess.Popen(
            [
                program, *world, "--http-port", "0", "--rtsp-port", "0",
                "--auth", "digest", "--user", self.user, "--password", self.password, "--log", str(log),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        self.http, self.rtsp = self._addresses()

    def _addresses(self):
        for line in self.process.stdout:
            http = re.search(r"http://[\w.:\[\]]+", line)
            rtsp = re.search(r"rtsp://[\w.:\[\]]+", line)
            if http and rtsp:
                return http[0], rtsp[0]
        raise SystemExit(f"the virtual camera did not start: exit code {self.process.wait()}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def report(self):
        """Status (position, motion, counters) and limits, as the camera knows them."""
        with urllib.request.urlopen(f"{self.http}/api/status", timeout=30) as answer:
            report = json.load(answer)
        return report["status"], report["limits"]

    def comes_to_rest(self, patience=3.0):
        """Whether it stands still within `patience` seconds; a head that was told to stop still brakes."""
        deadline = time.monotonic() + patience
        while self.report()[0]["moving"]:
            if time.monotonic() > deadline:
                return False
            time.sleep(0.1)
        return True
