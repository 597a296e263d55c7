"""Keys of `auth.conf`: ours and stock's let each other in, and nobody else.

    auth.py --stock-yarp PATH --our-yarp PATH --server stock|ours

Starts the chosen name server with a key and one of ours without, and ports of both kinds behind the
key; then those who have the key, another one or none ask for them, with both tools. Prints `ok
WHAT` or `FAIL WHAT` per check, ends with 1 if any failed. Every wait has a deadline.

Needs only Python's standard library. Checked with stock 3.5.0 and 4.0.0.
"""

import argparse
import os
import sys
import tempfile

from cli import Failure, Process, World, start_server

TOOLS = ("ours", "stock")


class Checks:
    """What was found, line by line."""

    def __init__(self):
        self.failed = 0

    def check(self, what, function):
        """Runs one check; it passes if nothing is raised."""
        try:
            function()
            print("ok  ", what, flush=True)
        except (Failure, OSError) as error:
            self.failed += 1
            print("FAIL", what, f"({type(error).__name__}: {error})", flush=True)


def expect(condition, text):
    """Fails with `text` unless the condition holds."""
    if not condition:
        raise Failure(text)


def world(stock, ours, base, name, key, server=None):
    """A configuration of its own, with this key."""
    directory = os.path.join(base, name)
    os.makedirs(directory, exist_ok=True)
    if key:
        with open(os.path.join(directory, "auth.conf"), "w", encoding="utf8") as file:
            file.write(f'[AUTH]\nkey "{key}"\n')
    if server:
        with open(os.path.join(directory, "yarp.conf"), "w", encoding="utf8") as file:
            file.write(server)
    made = World(stock, ours, directory)
    # Nothing of the user's own shall play a part.
    made.environment["YARP_DATA_HOME"] = directory
    return made


def insiders(checks, inside):
    """Everybody who has the key understands everybody else."""
    for reading in TOOLS:
        for writing in TOOLS:
            def messages():
                reader = inside.start(reading, "read /auth/r")
                code, _ = inside.run(writing, "write /auth/w /auth/r", "hello 1.5\n")
                expect(code == 0, f"write ended with {code}")
                reader.see("hello 1.5").signal().finish()

            def questions():
                server = inside.start(reading, "rpcserver --echo /auth/s", "Waiting")
                _, lines = inside.run(writing, "rpc /auth/s", "ping 7\n")
                expect(any("ping 7" in line for line in lines), f"no answer in {lines}")
                server.signal().finish()

            checks.check(f"{writing} writes to {reading}", messages)
            checks.check(f"{writing} asks {reading}", questions)
            inside.sweep()
    for reading in TOOLS:
        def connected():
            reader = inside.start(reading, "read /auth/r")
            writer = Process(inside, "ours" if reading == "stock" else "stock", ["write", "/auth/w"])
            writer.see("active at")
            for tool in TOOLS:
                for line, expected in [
                    ("exists /auth/r", 0),
                    ("connect /auth/w /auth/r fast_tcp", 0),
                    ("disconnect /auth/w /auth/r", 0),
                    ("exists /auth/nobody", 1),
                ]:
                    code, lines = inside.run(tool, line)
                    expect(code == expected, f"{tool} {line}: {code} {lines}")
            reader.signal().finish()

        checks.check(f"administration of {reading}", connected)
        inside.sweep()


def outsiders(checks, outside, tools, what):
    """Who has another key, or none, does not get past the name server, and does not wait for ever."""
    for tool in tools:
        for line in ("name list", "name query fallback", "exists /root", "where"):
            def refused():
                code, lines = outside.run(tool, line)
                told = [text for text in lines if "registration" in text]
                expect(not told, f"it is told {told}")
                if line == "exists /root":
                    expect(code != 0, "it finds the server")

            checks.check(f"{tool} {what}: {line}", refused)
        outside.sweep()


def strangers(checks, inside, stranger, tools, what):
    """Who knows where a port is, from elsewhere, is refused by the port itself."""
    for reading in TOOLS:
        reader = inside.start(reading, "read /auth/r")
        ip, port = inside.address("/auth/r")
        for tool in tools:
            def refused():
                stranger.run("ours", f"name register /auth/r tcp {ip} {port}")
                process = Process(stranger, tool, ["write", "/auth/x", "/auth/r"])
                try:
                    process.type("forbidden").end_input()
                except BrokenPipeError:
                    pass
                process.finish()
                code, _ = stranger.run(tool, "exists /auth/r")
                expect(code != 0, "it finds the port")

            if (tool, reading) == ("stock", "stock"):
                continue  # it waits for ever
            checks.check(f"{tool} {what}, the port of {reading}", refused)
            stranger.sweep()

        def untouched():
            inside.run("ours", "write /auth/w /auth/r", "allowed\n")
            reader.see("allowed")
            expect(not any("forbidden" in line for line in reader.out), f"it got {reader.out}")

        checks.check(f"the port of {reading} got nothing of it, and lives", untouched)
        inside.sweep()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stock-yarp", required=True, help="stock's `yarp`")
    parser.add_argument("--our-yarp", required=True, help="our `yarp`")
    parser.add_argument("--server", choices=TOOLS, required=True, help="whose name server")
    arguments = parser.parse_args()
    stock, ours = os.path.abspath(arguments.stock_yarp), os.path.abspath(arguments.our_yarp)
    checks = Checks()
    servers = []
    with tempfile.TemporaryDirectory() as base:
        try:
            inside = world(stock, ours, base, "inside", "my_secret_key")
            servers.append(start_server(inside, arguments.server))
            with open(os.path.join(inside.directory, "yarp.conf"), encoding="utf8") as file:
                place = file.read()
            print(f"stock: {inside.run('stock', 'version')[1][0]}; name server: {arguments.server}", flush=True)
            insiders(checks, inside)
            # Stock waits for ever for a stock server that refused it.
            tools = TOOLS if arguments.server == "ours" else ("ours",)
            wrong = world(stock, ours, base, "wrong", "another_key", place)
            outsiders(checks, wrong, tools, "with another key")
            without = world(stock, ours, base, "without", None, place)
            outsiders(checks, without, tools, "without a key")
            # Name servers of the strangers' own.
            for name, key, what in (("open", None, "without a key"), ("other", "another_key", "with another key")):
                stranger = world(stock, ours, base, name, key)
                servers.append(start_server(stranger, "ours"))
                strangers(checks, inside, stranger, TOOLS, what)
            # The other way round: who has a key talks to nobody without.
            with open(os.path.join(base, "open", "yarp.conf"), encoding="utf8") as file:
                lonely = world(stock, ours, base, "lonely", "my_secret_key", file.read())
            outsiders(checks, lonely, TOOLS, "with a key where there is none")
        finally:
            for server in servers:
                server.kill()
    print(f"{checks.failed} checks failed" if checks.failed else "all checks passed")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
