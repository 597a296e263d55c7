"""Several name servers at once: ours does what stock does with a list of namespaces.

    namespaces.py --stock-yarp PATH --our-yarp PATH

Starts a name server of ours for `/a` and one of stock's for `/b`, and runs commands of both tools in
`YARP_NAMESPACE="/a /b"`. Compares what they print, and checks that ports are known to both servers.
Prints `ok WHAT` or `FAIL WHAT` per check, ends with 1 if any failed. Every wait has a deadline.

Needs only Python's standard library. Checked with stock 3.5.0, which tells the second server a
number on which its ports do not listen.
"""

import argparse
import os
import re
import sys
import tempfile

from auth import Checks, expect
from cli import Process, World, free_port, masked

SERVERS = (("/a", "ours"), ("/b", "stock"))
COMMANDS = (
    "namespace", "where", "conf", "detect", "name list", "name query /a", "name query /b",
    "name query /nobody", "exists /a", "exists /b", "exists /nobody", "check",
)


def compare(checks, both):
    """Both tools say the same."""
    for line in COMMANDS:
        def same():
            expected, found = masked(both.run("stock", line)), masked(both.run("ours", line))
            # 3.5 leaves out the carrier of every name server.
            expected = (expected[0], [re.sub(r"(registration name /[ab] .* type) $", r"\1 tcp", text)
                                      for text in expected[1]], expected[2])
            expect(expected == found, f"stock {expected}, ours {found}")

        checks.check(line, same)


def registered(checks, both, alone):
    """A port of ours is known to every server, as where it is, until it closes."""
    for tool in ("ours", "stock"):
        reader = both.start(tool, "read /ns/r")
        for namespace, world in alone.items():
            def known():
                _, lines = world.run("stock", "name query /ns/r")
                expect("registration name /ns/r" in lines[0], f"{lines}")

            def reached():
                for writing in ("ours", "stock"):
                    code, _ = world.run(writing, "write ... /ns/r", f"from {writing} {namespace[1:]}\n")
                    expect(code == 0, f"{writing} write ended with {code}")
                    reader.see(f"from {writing} {namespace[1:]}")

            checks.check(f"{namespace} knows a port of {tool}", known)
            if tool == "ours" or namespace == "/a":
                checks.check(f"a port of {tool} is reached through {namespace}", reached)

        def forgotten():
            reader.signal().finish()
            for world in alone.values():
                _, lines = world.run("stock", "name list")
                expect(not any("/ns/r " in line for line in lines), f"{lines}")

        checks.check(f"a port of {tool} that closes is forgotten everywhere", forgotten)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stock-yarp", required=True, help="stock's `yarp`")
    parser.add_argument("--our-yarp", required=True, help="our `yarp`")
    arguments = parser.parse_args()
    stock, ours = os.path.abspath(arguments.stock_yarp), os.path.abspath(arguments.our_yarp)
    checks = Checks()
    servers = []
    with tempfile.TemporaryDirectory() as base:
        def world(name, namespaces):
            directory = os.path.join(base, name)
            os.makedirs(directory)
            made = World(stock, ours, directory)
            made.environment["YARP_NAMESPACE"] = namespaces
            return made

        try:
            both = world("both", " ".join(namespace for namespace, _ in SERVERS))
            alone = {}
            for namespace, tool in SERVERS:
                alone[namespace] = world(namespace[1:], namespace)
                words = ["server", "--ip", "127.0.0.1", "--socket", str(free_port()), "--write"]
                server = Process(alone[namespace], tool, words)
                servers.append(server)
                server.see("Ready")
                file = f"_{namespace[1:]}.conf"
                with open(os.path.join(alone[namespace].directory, file), encoding="utf8") as source:
                    place = source.read()
                with open(os.path.join(both.directory, file), "w", encoding="utf8") as copy:
                    copy.write(place)
            compare(checks, both)
            registered(checks, both, alone)
            both.sweep()
        finally:
            for server in servers:
                server.kill()
    print(f"{checks.failed} checks failed" if checks.failed else "all checks passed")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
