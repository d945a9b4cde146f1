# SPDX-License-Identifier: MPL-2.0
"""install_npm_modules.py FOLDER: puts what package-lock.json names into FOLDER/node_modules, as `npm ci` would.

Debian's npm brings hundreds of packages along, node alone a handful.
"""

import base64
import hashlib
import io
import json
import pathlib
import sys
import tarfile
import urllib.request

REGISTRY = "https://registry.npmjs.org"
TIMEOUT_S = 15


def fetch(name, version, integrity):
    """A module's archive, which is the one that was locked."""
    url = f"{REGISTRY}/{name}/-/{name}-{version}.tgz"
    with urllib.request.urlopen(url, timeout=TIMEOUT_S) as answer:
        archive = answer.read()
    algorithm, digest = integrity.split("-", 1)
    if base64.b64encode(hashlib.new(algorithm, archive).digest()).decode() != digest:
        sys.exit(f"{url} is not what package-lock.json names")
    return archive


def unpack(archive, folder):
    """Its files lie in a folder of their own, whose name does not matter."""
    with tarfile.open(fileobj=io.BytesIO(archive)) as members:
        for member in members:
            path = pathlib.PurePosixPath(member.name)
            if member.isfile() and ".." not in path.parts:
                place = folder.joinpath(*path.parts[1:])
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(members.extractfile(member).read())


def main(folder):
    lock = json.loads(pathlib.Path(__file__).with_name("package-lock.json").read_text())
    for place, module in lock["packages"].items():
        if place and not (folder / place / "package.json").exists():
            name = place.removeprefix("node_modules/")
            unpack(fetch(name, module["version"], module["integrity"]), folder / place)


main(pathlib.Path(sys.argv[1]))
