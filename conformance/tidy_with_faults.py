#!/usr/bin/env python3
"""Tidies simulated tables over the network, by what the cameras see, and breaks something once in each run.

    tidy_with_faults.py YARP [--seed 14000] [--runs 60] [--only KIND]

Name server, table, recognition and demo are processes of their own, on a network of their own. After a random time one
fault of KINDS comes, some for good and some for a while. A run passes if

- the demo ends with every object in its basket, or, where REASONS allows it for this fault, with an error that names it. A fault
  that stays while two objects are left must end it with that error;
- every object that is in no basket stands where it stood, or is in the hand. One that was not in the hand when the fault came
  may also lie elsewhere on the table, as after any grasp that failed, but not on the floor.

Prints a line per run and a table; exits with 1 if a run fails.
"""

import argparse
import collections
import json
import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

KINDS = ["none", "camera", "cover", "server", "hand", "frames", "stop", "vision"]
# Errors with which a run may end, by the kind of fault and whether it passes; all others must end with a tidy table. A fault that
# passes may come and go between two looks, and what stalls for a moment may be taken for what stays so.
REASONS = {
    ("camera", False): "/lab/(camera|depth)|/lab/vision.*(new|same)",
    ("cover", False): "lens is covered|shows nothing",
    ("cover", True): "lens is covered|shows nothing",
    ("hand", False): "/lab/hand|the hand holds something",
    ("hand", True): "/lab/hand",
    ("stop", False): "emergency stop",
    ("stop", True): "emergency stop",
    ("vision", False): "/lab/vision",
}
# Faults without which two objects cannot be placed any more.
STOPPING = {"camera", "cover", "hand", "stop", "vision"}
# Largest roll or pitch of an object that stands, rad.
UPRIGHT = 0.2
# Table of docs/table-simulation.md, m.
SURFACE = -0.05
BASKETS = [(0.45, -0.56), (0.45, 0.56), (0.10, -0.60)]
BASKET = (0.15, 0.125)
WANTED = {"glass": 1, "plate": 2}
# Objects, and simulated seconds for each, from which the time of the fault is drawn.
OBJECTS = 4
SECONDS = 15.0
# Speed of the table; an arm on its bus has that of a real one.
SPEED = 4.0
# Height of an object's bottom above the table from which on it was lifted, distance from where it stood within which it was put
# back, and distance of its middle from the middle between the fingertips within which it is in the hand, m: a plate is held at its edges.
LIFTED = 0.015
PUT_BACK = 0.05
IN_HAND = 0.14
# Limit of one run: the waits of the demo for cameras, and those for a hot hand, which pass as fast as the table is.
LIMIT, HOT = 120, 400


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Lab:
    """The processes of one run; leaving it kills them."""

    def __init__(self, yarp, folder):
        self.yarp, self.folder, self.port = yarp, folder, free_port()
        self.environment = dict(os.environ, YARP_CONFIG_HOME=folder, YARP_DATA_HOME=folder)
        self.running = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.running:
            process.kill()
            process.wait()

    def start(self, words, out=subprocess.DEVNULL):
        log = open(os.path.join(self.folder, f"{words.split()[0]}.log"), "w")
        process = subprocess.Popen([self.yarp, *words.split()], stdin=subprocess.DEVNULL, stdout=out, stderr=log,
                                   env=self.environment, text=True)
        log.close()
        self.running.append(process)
        return process

    def serve(self):
        server = self.start(f"server --ip 127.0.0.1 --socket {self.port} --write")
        for _ in range(100):
            with socket.socket() as attempt:
                if attempt.connect_ex(("127.0.0.1", self.port)) == 0:
                    return server
            time.sleep(0.05)
        raise RuntimeError("the name server does not start")

    def wait_for(self, name):
        done = subprocess.run([self.yarp, "wait", name], env=self.environment, timeout=60, capture_output=True)
        if done.returncode != 0:
            raise RuntimeError(f"{name} does not come: {done.stderr.decode()}")

    def call(self, name, *lines):
        done = subprocess.run([self.yarp, "rpc", name], env=self.environment, timeout=30, capture_output=True, text=True,
                              input="".join(line + "\n" for line in lines))
        if done.returncode != 0:
            raise RuntimeError(f"{name} does not answer: {done.stderr[-300:]}")
        return done.stdout

    def fault(self, request):
        reply = self.call("/lab/faults/rpc:i", request)
        if "ok" not in reply.split():
            raise RuntimeError(f"{request}: {reply}")

    def set_modes(self, mode):
        self.call("/lab/wam/rpc:i", *(f"set icmd cmod {joint} {mode}" for joint in range(7)))
        found = self.call("/lab/wam/rpc:i", *(f"get icmd cmod {joint}" for joint in range(7)))
        if found.count(f"[{mode}]") != 7:
            raise RuntimeError(f"not all joints are in mode {mode}: {found}")

    def objects(self):
        """Returns word, place, height of the bottom above the table, and tilt of each object by its number."""
        found = {}
        text = self.call("/lab/truth/rpc:i", "list")
        for entry in re.findall(r"\((\d+) (\w+) ([^()]*)\(([^()]*)\)", text):
            x, y, z, roll, pitch, _ = (float(word) for word in entry[2].split())
            height = float(entry[3].split()[-1])
            found[int(entry[0])] = (entry[1], (x, y, z), z - height / 2 - SURFACE, max(abs(roll), abs(pitch)))
        if not found:
            raise RuntimeError(f"the table tells nothing: {text}")
        return found

    def grip(self):
        """Returns the place between the fingertips, m, from the joints."""
        text = self.call("/lab/wam/rpc:i", "get encs")
        joints = [math.radians(float(word)) for word in re.search(r"encs \(([^()]*)\)", text).group(1).split()]
        return forward(joints)

    def held(self):
        """Returns the numbers of the objects that are in the hand and not on the table."""
        grip = self.grip()
        return {number for number, (_, place, bottom, _) in self.objects().items()
                if bottom > LIFTED and math.dist(place, grip) < IN_HAND}


def forward(joints):
    """Returns the place 0.15 m beyond the tool plate of a WAM with 7 joints; its table of Denavit and Hartenberg is in the manual."""
    rows = [(0, -90, 0), (0, 90, 0), (0.045, -90, 0.55), (-0.045, 90, 0), (0, -90, 0.3), (0, 90, 0), (0, 0, 0.06)]
    axes, place = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0]
    for theta, (a, alpha, d) in zip(joints, rows):
        c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(math.radians(alpha)), math.sin(math.radians(alpha))
        step = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [0, sa, ca]]
        place = [place[i] + sum(axes[i][k] * v for k, v in enumerate((a * c, a * s, d))) for i in range(3)]
        axes = [[sum(axes[i][k] * step[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return [place[i] + 0.15 * axes[i][2] for i in range(3)]


def is_placed(word, place):
    """Returns whether an object is in its basket, up to the rim."""
    x, y = BASKETS[WANTED.get(word, 0)]
    return abs(place[0] - x) <= BASKET[0] and abs(place[1] - y) <= BASKET[1] and place[2] <= SURFACE


def set_fault(lab, kind, passes, lasts, processes):
    """Brings a fault, and ends it if it is one that passes."""
    if kind in ("camera", "cover", "hand"):
        lab.fault({"camera": "camera freeze", "cover": "camera cover", "hand": "hand stall"}[kind])
        if passes:
            time.sleep(lasts)
            lab.fault("hand run" if kind == "hand" else "camera run")
    if kind == "server":
        processes["server"].kill()
        processes["server"].wait()
        time.sleep(lasts)
        lab.serve()
    if kind == "stop":
        lab.set_modes("idl")
        if passes:
            time.sleep(lasts)
            lab.set_modes("pos")
    if kind == "vision":
        processes["vision"].kill()
        processes["vision"].wait()
        if passes:
            time.sleep(lasts)
            lab.start("vision serve --prefix /lab --name /lab/vision")


def fallen(lab, before, held, kind):
    """Returns an object that is where it should not be, in words; None if there is none."""
    after, in_hand, grip = lab.objects(), lab.held(), lab.grip()
    for number, (word, place, bottom, tilt) in after.items():
        back = math.dist(place[:2], before[number][1][:2]) < PUT_BACK and abs(bottom) < LIFTED and tilt < UPRIGHT
        # An arm without power sinks onto the table with what it holds.
        sunk = kind == "stop" and number in held and math.dist(place, grip) < IN_HAND
        if is_placed(word, place) or number in in_hand or back or sunk:
            continue
        on_table = abs(place[1]) < 0.42 and 0.18 < place[0] < 0.92 and bottom > -0.02
        if number in held or not on_table:
            return f"{word} {number} is at {place}, {bottom:.3f} m above the table"
    return None


def run(yarp, seed, kind):
    """Returns the outcome of a run, its reason, what happened, and the objects that were in the hand."""
    chance = random.Random(seed)
    speed = 1.0 if kind == "frames" else SPEED
    objects = 2 if kind == "frames" else OBJECTS
    bus = "--simulation bus --lost-frames 1e-3" if kind == "frames" else ""
    passes = kind == "server" or kind not in ("none", "frames") and chance.random() < 0.5
    lasts, delay = chance.uniform(0.5, 3.0), chance.uniform(0.0, objects * SECONDS / speed)
    with tempfile.TemporaryDirectory() as folder, Lab(yarp, folder) as lab:
        processes = {"server": lab.serve()}
        lab.start(f"table --objects {objects} --seed {seed} --speed {speed} --prefix /lab --no-view --faults {bus}")
        lab.wait_for("/lab/faults/rpc:i")
        processes["vision"] = lab.start("vision serve --prefix /lab --name /lab/vision")
        lab.wait_for("/lab/vision")
        before = lab.objects()
        demo = lab.start(f"demo tidy --remote /lab --speed {speed} --detector /lab/vision --json", subprocess.PIPE)
        lab.wait_for("/tidy/plan:o")
        time.sleep(delay)
        early = demo.poll() is not None
        held = lab.held()
        unplaced = [number for number, found in lab.objects().items() if not is_placed(*found[:2])]
        if not early:
            set_fault(lab, kind, passes, lasts, processes)
            # What was grasped in between is in the hand as well.
            held |= lab.held()
        what = f"for {lasts:.1f} s" if passes else ""
        try:
            out, _ = demo.communicate(timeout=LIMIT + HOT / speed)
        except subprocess.TimeoutExpired:
            return "FAIL", "the demo has not ended", what, held
        if not out.strip():
            with open(os.path.join(folder, "demo.log")) as log:
                return "FAIL", f"no result: {log.read()[-500:]}", what, held
        result = json.loads(out.strip().splitlines()[-1])
        time.sleep(2.0)
        wrong = fallen(lab, before, held, kind)
        error = result["error"] or ""
        if wrong:
            return "FAIL", f"{wrong}; {error}", what, held
        if error:
            allowed = not early and REASONS.get((kind, passes))
            return ("reason" if allowed and re.search(allowed, error) else "FAIL"), error, what, held
        if not early and kind in STOPPING and not passes and len(unplaced) >= 2:
            return "FAIL", f"ended without the fault's reason, {len(unplaced)} objects were left", what, held
        left = {number for number, found in lab.objects().items() if not is_placed(*found[:2])}
        if left:
            reasons = [entry["reason"] for entry in result["left"]]
            return "FAIL", f"not placed: {sorted(left)}; left: {reasons}", what, held
        return ("early" if early else "tidy"), "", what, held


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("yarp")
    parser.add_argument("--seed", type=int, default=14000)
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--only", choices=KINDS)
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    counts = collections.defaultdict(collections.Counter)
    for seed in range(options.seed, options.seed + options.runs):
        kind = options.only or KINDS[seed % len(KINDS)]
        try:
            outcome, why, what, held = run(os.path.abspath(options.yarp), seed, kind)
        except (RuntimeError, OSError, ValueError, LookupError, AttributeError, subprocess.SubprocessError) as error:
            outcome, why, what, held = "FAIL", repr(error), "", set()
        counts[kind][outcome] += 1
        counts[kind]["held"] += bool(held)
        print(f"{seed} {kind} {what}: {outcome}{' with an object in the hand' if held else ''} {why}", flush=True)
    columns = ["early", "tidy", "reason", "FAIL", "held"]
    print("| fault | before the fault tidy | tidy | ended with the reason | failed | with an object in the hand |")
    for kind, found in counts.items():
        print(f"| {kind} | " + " | ".join(str(found[column]) for column in columns) + " |")
    missing = [kind for kind, found in counts.items() if kind != "none" and found["early"] == sum(found.values()) - found["held"]]
    if missing:
        print(f"no run had its fault: {', '.join(missing)}")
    return int(bool(missing) or any(found["FAIL"] for found in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
