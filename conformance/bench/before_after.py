#!/usr/bin/env python3
"""Compares the benchmark's peers of two builds, in turn: round trips and one-way rates.

    before_after.py BEFORE AFTER YARP [--rounds N] [--only TEXT]

BEFORE and AFTER are `target/release/bench` of two commits, YARP is the program whose name server both use. Each
round measures both, and the order changes from round to round. Each row has the median of each build, the median of
the ratios of the rounds, and the interval that contains it with 95 % confidence (bootstrap). Exit code 1 if the
interval of a row lies wholly beyond 3 % to the worse side.
"""

import argparse
import contextlib
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time

CALLS = 5000
WORST = 0.03
STEP_TIMEOUT = 60
# Carrier, bytes of a message, messages.
ONE_WAY = [
    ("tcp", 16, 50_000),
    ("fast_tcp", 16, 1_000_000),
    ("unix_stream", 16, 1_000_000),
    ("shmem", 16, 200_000),
    ("text", 16, 200_000),
    ("text_ack", 16, 50_000),
    ("tcp", 1_000_000, 1_000),
    ("fast_tcp", 1_000_000, 1_000),
    ("unix_stream", 1_000_000, 1_000),
    ("shmem", 1_000_000, 4_000),
]


@contextlib.contextmanager
def peer(program, *words):
    """Runs a peer of the benchmark; yields it, and ends it by closing its input."""
    child = subprocess.Popen([program, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield child
    finally:
        child.stdin.close()
        try:
            child.wait(STEP_TIMEOUT)
        except subprocess.TimeoutExpired:
            child.kill()


def line(child):
    text = child.stdout.readline()
    if not text:
        raise SystemExit(f"{child.args}: ended early")
    return text.strip()


def round_trip(program, name):
    """Returns the median and the 99th percentile of the calls, in microseconds."""
    with peer(program, "serve", name) as server:
        line(server)
        with peer(program, "call", name, str(CALLS)) as client:
            times = sorted(int(line(client)) for _ in range(CALLS))
    return times[CALLS // 2] / 1000, times[CALLS * 99 // 100] / 1000


def one_way(program, name, carrier, size, count):
    """Returns the messages per second until the last has been read."""
    with peer(program, "count", name) as reader:
        line(reader)
        begin = time.monotonic_ns()
        with peer(program, "send", name, carrier, str(count), str(size)) as writer:
            spent = int(line(writer))
            written = time.monotonic_ns()
            print(count, file=reader.stdin, flush=True)
            line(reader)
            spent += time.monotonic_ns() - written
    assert spent < time.monotonic_ns() - begin
    return count * 1e9 / spent


def interval(ratios):
    """Returns the bounds of the median of the ratios, with 95 % confidence."""
    dice = random.Random(1)
    medians = sorted(statistics.median(dice.choices(ratios, k=len(ratios))) for _ in range(2000))
    return medians[50], medians[-51]


def report(label, before, after, lower_is_better):
    ratios = [b / a for a, b in zip(before, after)]
    low, high = interval(ratios)
    worse = low > 1 + WORST if lower_is_better else high < 1 - WORST
    print(
        f"{label:<28}{statistics.median(before):>14.1f}{statistics.median(after):>14.1f}"
        f"{statistics.median(ratios):>9.3f}   {low:.3f} to {high:.3f}{'   WORSE' if worse else ''}",
        flush=True,
    )
    return worse


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("yarp")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--only", default="", help="part of the names of the rows to measure")
    options = parser.parse_args()
    programs = (os.path.abspath(options.before), os.path.abspath(options.after))
    with tempfile.TemporaryDirectory() as work:
        os.environ.update(YARP_CONFIG_HOME=work, YARP_DATA_HOME=f"{work}/data", YARP_RUNTIME_DIR=work)
        words = [options.yarp, "server", "--ip", "127.0.0.1", "--socket", "10491", "--write"]
        server = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            for _ in range(100):
                if subprocess.run([options.yarp, "where"], capture_output=True).returncode == 0:
                    break
                time.sleep(0.1)
            return compare(programs, options.rounds, options.only)
        finally:
            server.terminate()
            server.wait()


def compare(programs, rounds, only):
    names = (f"/before-after/{number}" for number in range(10**9))

    def in_turn(measure):
        results = ([], [])
        for turn in range(rounds):
            for side in (0, 1) if turn % 2 == 0 else (1, 0):
                results[side].append(measure(programs[side], next(names)))
        return results

    print(f"{'':<28}{'before':>14}{'after':>14}{'ratio':>9}   95 %")
    worse = False
    if only in "call over tcp":
        before, after = in_turn(round_trip)
        for index, what in enumerate(("p50", "p99")):
            label = f"call over tcp, {what}, µs"
            worse |= report(label, [run[index] for run in before], [run[index] for run in after], True)
    for carrier, size, count in ONE_WAY:
        if only not in f"{carrier}, {size} bytes":
            continue
        before, after = in_turn(lambda program, name: one_way(program, name, carrier, size, count))
        worse |= report(f"{carrier}, {size} bytes, 1/s", before, after, False)
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
