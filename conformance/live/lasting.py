"""Persistent connections and topics with ends of ours and of stock's that are killed and come back.

    lasting.py --stock-yarp PATH --our-yarp PATH --server stock|ours

For each kind of lasting connection and each combination of tools: the reader, then the writer, then
both are killed without a goodbye and started again; each time messages must flow. Prints `ok NAME`
or `FAIL NAME`, ends with 1 if any failed.

Stock's name server tells a writer once to connect to a reader that is back. A writer of stock's that has
not noticed by then that the reader before is dead keeps that connection, drops it later, and never connects
again: seen with nothing of ours in play. So what has a part of stock's is tried three times.
"""

import argparse
import itertools
import os
import sys
import tempfile
import time

from again import tried
from cli import PATIENCE, Failure, World, forget_names, start_server

LASTING = {
    "persistent connection": (["connect --persist /w /r"], ["disconnect --persist /w /r"]),
    "persistent connection over fast_tcp":
        (["connect --persist /w /r fast_tcp"], ["disconnect --persist /w /r"]),
    "topic": (["topic /t", "connect /w topic://t", "connect topic://t /r"],
              ["disconnect --persist /w topic://t", "disconnect --persist topic://t /r",
               "topic --remove /t"]),
}


def reaches(writer, reader, text):
    """Types `text` at the writer again and again until the reader prints it."""
    end = time.monotonic() + 2 * PATIENCE
    while True:
        with reader.changed:
            if any(text in line for line in reader.out):
                return
            reader.changed.wait(0.3)
            if any(text in line for line in reader.out):
                return
        if time.monotonic() > end:
            raise Failure(f"{text!r} does not come from {writer.label} to {reader.label}: "
                          f"{writer.out} {writer.err} {reader.out} {reader.err}")
        writer.type(text)


def check(world, asking, writing, reading, lines):
    """Kills the ends and starts them again."""
    for line in lines:
        code, out = world.run(asking, line)
        if code != 0:
            raise Failure(f"{asking} {line}: {code} {out}")
    start_reader = lambda: world.start(reading, "read /r")
    start_writer = lambda: world.start(writing, "write /w")
    writer, reader = start_writer(), start_reader()
    reaches(writer, reader, "at first")
    reader.kill()
    reader = start_reader()
    reaches(writer, reader, "the reader is back")
    writer.kill()
    writer = start_writer()
    reaches(writer, reader, "the writer is back")
    writer.kill()
    reader.kill()
    writer, reader = start_writer(), start_reader()
    reaches(writer, reader, "both are back")


def lasts(world, roles, lines, undo):
    """Checks once, and clears away what is left of it; tells why it failed."""
    why = None
    try:
        check(world, "ours", *roles, lines)
    except Failure as failure:
        why = failure
    world.sweep()
    for line in undo:
        world.run("ours", line)
    forget_names(world)
    return why


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stock-yarp", required=True, help="stock's `yarp`")
    parser.add_argument("--our-yarp", required=True, help="our `yarp`")
    parser.add_argument("--server", choices=["stock", "ours"], required=True, help="whose name server")
    arguments = parser.parse_args()
    failures = 0
    with tempfile.TemporaryDirectory() as directory:
        tools = [os.path.abspath(path) for path in (arguments.stock_yarp, arguments.our_yarp)]
        world = World(*tools, directory)
        server = None
        try:
            server = start_server(world, arguments.server)
            for name, (lines, undo) in LASTING.items():
                for roles in itertools.product(["stock", "ours"], repeat=2):
                    label = f"{name} (writer {roles[0]}, reader {roles[1]})"
                    tries = 3 if "stock" in (*roles, arguments.server) else 1
                    _, why = tried(lambda: (None, lasts(world, roles, lines, undo)), label, tries)
                    if why is None:
                        print("ok", label, flush=True)
                    else:
                        print("FAIL", label, why, flush=True)
                        failures += 1
        except Failure as failure:
            print("FAIL", failure)
            failures += 1
        finally:
            world.sweep()
            if server:
                server.kill()
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
