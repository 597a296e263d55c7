#!/usr/bin/env python3
"""Compares paths with those of OMPL's RRTConnect in the same scenes, in one run.

    python3 -m venv venv && venv/bin/pip install ompl numpy
    venv/bin/python conformance/bench/ompl_paths.py --yarp target/debug/yarp --seed 1 --count 1000 --json

`yarp plan evaluate --export` writes the arm (spheres, frames, joint limits), the scenes and the lengths of its own paths.
OMPL plans with the same spheres, shapes, margin and limits, which a callback checks here with numpy; it checks motions at
intervals of at most 0.05 rad. Exit code 1 unless the paths of yarp are shorter on average where both found one.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy
from ompl import base, geometric, util

# Part of the arm that a link belongs to; neighbouring parts are not checked against each other.
PART = [0, 0, 0, 1, 2, 3, 3, 3]
# Distance between two checked postures of a motion, rad.
RESOLUTION = 0.05


class Arm:
    """The arm as spheres."""

    def __init__(self, arm):
        self.links = [numpy.array(rows).reshape(4, 4) for rows in arm["links"]]
        self.limits = arm["limits"]
        self.margin = arm["margin"]
        spheres = sorted(arm["spheres"], key=lambda sphere: sphere["link"])
        self.link = numpy.array([sphere["link"] for sphere in spheres])
        self.radius = numpy.array([sphere["radius"] for sphere in spheres])
        self.local = numpy.array([sphere["center"] for sphere in spheres])
        self.of_link = [numpy.flatnonzero(self.link == link) for link in range(8)]
        part = numpy.array(PART)[self.link]
        self.pairs = numpy.nonzero(numpy.triu(abs(part[:, None] - part[None, :]) >= 2))
        self.keep = self.radius[self.pairs[0]] + self.radius[self.pairs[1]]

    def centers(self, joints):
        """Returns the centre of each sphere in the base frame."""
        centers = self.local.copy()
        pose = numpy.eye(4)
        for index, link in enumerate(self.links):
            sine, cosine = math.sin(joints[index]), math.cos(joints[index])
            turn = numpy.eye(4)
            turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1] = cosine, -sine, sine, cosine
            pose = pose @ turn @ link
            of = self.of_link[index + 1]
            centers[of] = self.local[of] @ pose[:3, :3].T + pose[:3, 3]
        return centers


class Scene:
    """Obstacles, with the distances of points from them."""

    def __init__(self, obstacles):
        self.cuboids, self.cylinders, self.planes = [], [], []
        for obstacle in obstacles:
            roll, pitch, yaw = obstacle["rotation"]
            cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
            cy, sy = math.cos(yaw), math.sin(yaw)
            rotation = numpy.array([
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ])
            place, shape = numpy.array(obstacle["position"]), obstacle["shape"]
            if shape == "half_space":
                self.planes.append((rotation, place))
            elif "cuboid" in shape:
                self.cuboids.append((rotation, place, numpy.array(shape["cuboid"]) / 2))
            else:
                size = shape["cylinder"]
                self.cylinders.append((rotation, place, size["radius"], size["height"] / 2))

    def distances(self, points):
        """Returns the smallest signed distance of each point from an obstacle."""
        smallest = numpy.full(len(points), numpy.inf)
        for rotation, place, half in self.cuboids:
            beyond = abs((points - place) @ rotation) - half
            outside = numpy.sqrt((numpy.maximum(beyond, 0) ** 2).sum(axis=1))
            smallest = numpy.minimum(smallest, outside + numpy.minimum(beyond.max(axis=1), 0))
        for rotation, place, radius, half in self.cylinders:
            local = (points - place) @ rotation
            beyond = numpy.hypot(local[:, 0], local[:, 1]) - radius
            above = abs(local[:, 2]) - half
            outside = numpy.hypot(numpy.maximum(beyond, 0), numpy.maximum(above, 0))
            smallest = numpy.minimum(smallest, outside + numpy.minimum(numpy.maximum(beyond, above), 0))
        for rotation, place in self.planes:
            smallest = numpy.minimum(smallest, ((points - place) @ rotation)[:, 2])
        return smallest


def is_free(arm, scene, joints):
    """Returns whether a posture keeps the margin from everything."""
    centers = arm.centers(joints)
    first, second = arm.pairs
    square = ((centers[first] - centers[second]) ** 2).sum(axis=1)
    if (square < arm.keep**2).any():
        return False
    moving = arm.link > 0
    return bool((scene.distances(centers[moving]) >= arm.radius[moving] + arm.margin).all())


def length(path):
    states = path.getStates()
    rows = numpy.array([[state[joint] for joint in range(7)] for state in states])
    return float(numpy.sqrt((numpy.diff(rows, axis=0) ** 2).sum(axis=1)).sum())


def plan(arm, problem, timeout):
    """Returns the length of OMPL's path, that of the simplified one, and the seconds that it took; None without a path."""
    space = base.RealVectorStateSpace(7)
    bounds = base.RealVectorBounds(7)
    for joint, (low, high) in enumerate(arm.limits):
        bounds.setLow(joint, low)
        bounds.setHigh(joint, high)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    scene = Scene(problem["obstacles"])
    setup.setStateValidityChecker(
        lambda state: is_free(arm, scene, [state[joint] for joint in range(7)])
    )
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(RESOLUTION / space.getMaximumExtent())
    ends = []
    for joints in (problem["start"], problem["goals"][0]):
        state = space.allocState()
        for joint in range(7):
            state[joint] = joints[joint]
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTConnect(information))
    begin = time.monotonic()
    setup.solve(timeout)
    seconds = time.monotonic() - begin
    if not setup.haveExactSolutionPath():
        return None
    raw = length(setup.getSolutionPath())
    setup.simplifySolution()
    return raw, length(setup.getSolutionPath()), seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--yarp", default="yarp", help="the yarp command")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--timeout", type=float, default=60.0, help="seconds per scene for OMPL")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    util.RNG.setSeed(arguments.seed + 1)
    util.setLogLevel(util.LogLevel.LOG_WARN)
    with tempfile.TemporaryDirectory() as folder:
        scenes = Path(folder) / "scenes.jsonl"
        command = [arguments.yarp, "plan", "evaluate", "--json", "--export", str(scenes)]
        command += ["--seed", str(arguments.seed), "--count", str(arguments.count)]
        ours = json.loads(subprocess.run(command, check=False, capture_output=True, text=True).stdout)
        lines = [json.loads(line) for line in scenes.read_text().splitlines()]
    arm = Arm(lines[0])
    disagreements, both, solved = 0, [], 0
    for line in lines[1:]:
        scene = Scene(line["problem"]["obstacles"])
        ends = [line["problem"]["start"], *line["problem"]["goals"]]
        disagreements += sum(not is_free(arm, scene, joints) for joints in ends)
        found = plan(arm, line["problem"], arguments.timeout)
        solved += found is not None
        if found is not None and line["length"] is not None:
            both.append((line["length"], *found))
    mean = numpy.array(both).mean(axis=0) if both else [math.nan] * 4
    result = {
        "yarp": ours,
        "ompl_solved": int(solved),
        "ompl_timeout_s": arguments.timeout,
        "ends_in_collision": int(disagreements),
        "both_solved": len(both),
        "yarp_mean_length_rad": float(mean[0]),
        "ompl_rrtconnect_mean_length_rad": float(mean[1]),
        "ompl_simplified_mean_length_rad": float(mean[2]),
        "ompl_mean_seconds_python_checks": float(mean[3]),
        "shorter_than_rrtconnect_share": float(numpy.mean([row[0] <= row[1] + 1e-9 for row in both])),
        "shorter_than_simplified_share": float(numpy.mean([row[0] <= row[2] + 1e-9 for row in both])),
    }
    passed = bool(both and disagreements == 0 and mean[0] < mean[1])
    result["passed"] = passed
    print(json.dumps(result) if arguments.json else json.dumps(result, indent=2))
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
