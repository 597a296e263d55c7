"""VLC watches an image port of ours.

    python3 vlc.py PICTURES

PICTURES is the example `pictures` of ports/: a red half, a blue half, and a white bar that moves.
A real `cvlc` (Debian: vlc-bin, vlc-plugin-base) plays what the port shows to browsers and keeps
some of the pictures that it sees; these are looked at. VLC does not run as root: if this does, VLC
runs as `nobody`. Prints `ok` or `FAIL` per comparison and ends with 1 if any failed, or if there is
no VLC.
"""

import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zlib

from checks import check, same, verdict
from tied import TIED

# Seconds that VLC may take to start and show some pictures.
PATIENCE = 90
WIDTH = 320


def rows(png):
    """The rows of a PNG of three bytes to a pixel; source: its specification, sections 9 and 11."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n", "no PNG"
    place, packed, head = 8, b"", None
    while place < len(png):
        (length,), kind = struct.unpack(">I", png[place : place + 4]), png[place + 4 : place + 8]
        content = png[place + 8 : place + 8 + length]
        if kind == b"IHDR":
            head = struct.unpack(">IIBBBBB", content)
        elif kind == b"IDAT":
            packed += content
        place += length + 12
    width, height, depth, colours, _, _, interlaced = head
    assert (depth, colours, interlaced) == (8, 2, 0), f"another kind of PNG: {head}"
    raw, above, result = zlib.decompress(packed), bytes(3 * width), []
    for y in range(height):
        line = raw[y * (3 * width + 1) : (y + 1) * (3 * width + 1)]
        row = bytearray(line[1:])
        for i, _ in enumerate(row):
            a = row[i - 3] if i >= 3 else 0
            b = above[i]
            c = above[i - 3] if i >= 3 else 0
            nearest = min((a, b, c), key=lambda value: abs(a + b - c - value))
            row[i] = (row[i] + (0, a, b, (a + b) // 2, nearest)[line[0]]) & 255
        result.append(bytes(row))
        above = result[-1]
    return result


def colour(pixel):
    """What a pixel is called, if it is about that."""
    known = {"red": (200, 30, 30), "blue": (30, 30, 200), "white": (255, 255, 255)}
    near = (name for name, is_ in known.items() if all(abs(a - b) < 30 for a, b in zip(pixel, is_)))
    return next(near, None)


def seen(path):
    """The colours along the middle row of a picture; `None` if it is not there as a whole."""
    try:
        all_rows = rows(path.read_bytes())
    except (zlib.error, struct.error, TypeError, IndexError, AssertionError):
        return None
    row = all_rows[len(all_rows) // 2]
    return [colour(row[i : i + 3]) for i in range(0, len(row), 3)]


def watch(url, folder):
    """Has VLC play `url` until it has seen the bar at three places; what it has seen there, and its last messages."""
    command = [*TIED, "cvlc", "--no-audio", "--vout=dummy", "--video-filter=scene", "--scene-format=png"]
    command += ["--scene-ratio=7", f"--scene-path={folder}", "--scene-prefix=seen", url]
    if os.getuid() == 0:
        os.chmod(folder, 0o777)
        command = ["runuser", "-u", "nobody", "--", "env", f"HOME={folder}", *command]
    with open(folder / "log", "wb") as log:
        vlc = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)
    places = {}
    end = time.monotonic() + PATIENCE
    try:
        while len(places) < 3 and time.monotonic() < end and vlc.poll() is None:
            time.sleep(0.2)
            # The newest may not be whole yet.
            for path in sorted(folder.glob("seen*.png"))[:-1]:
                if (colours := seen(path)) and "white" in colours:
                    places[colours.index("white")] = colours
                if len(places) == 3:
                    break
    finally:
        try:
            os.killpg(vlc.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        vlc.wait()
    return places, (folder / "log").read_text(errors="replace")[-700:]


def main():
    if shutil.which("cvlc") is None:
        raise SystemExit("vlc: there is no cvlc; Debian has it in vlc-bin and vlc-plugin-base")
    pictures = subprocess.Popen([*TIED, sys.argv[1]], stdout=subprocess.PIPE, text=True)
    try:
        url = pictures.stdout.readline().strip()
        print(f"     VLC watches {url}")
        with tempfile.TemporaryDirectory() as folder:
            places, messages = watch(url, pathlib.Path(folder))
    finally:
        pictures.kill()
        pictures.wait()
    check("VLC sees the bar move", len(places) == 3, f"bar at {sorted(places)}; messages of VLC: {messages!r}")
    for place, colours in sorted(places.items()):
        same(f"its pictures are as wide, bar at {place}", len(colours), WIDTH)
        halves = {"left": colours[: WIDTH // 2], "right": colours[WIDTH // 2 :]}
        for (half, part), paint in zip(halves.items(), ("red", "blue")):
            # Where colours meet, a picture of this kind blurs them.
            share = sum(name == paint for name in part) / len(part)
            same(f"the {half} half is {paint}, bar at {place}", share > 0.8, True)
    sys.exit(verdict())


main()
