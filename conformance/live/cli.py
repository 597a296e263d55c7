"""Compares our `yarp` with stock's, command by command.

    cli.py --stock-yarp PATH --our-yarp PATH --server stock|ours [--only TEXT] [--show]

Starts the chosen name server on a free port with a configuration directory of its own, runs each
scenario with every combination of the two tools, and compares what ours prints on standard output
(less what `MASKS` hides) and its exit codes with what stock does when it plays all the roles.
Prints `ok NAME` or `FAIL NAME` per comparison, ends with 1 if any failed. Every wait has a
deadline, and no process is left behind.

Needs only Python's standard library. Checked with stock 3.5.0.
"""

import argparse
import glob
import itertools
import os
import pty
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

from again import tried
from tied import TIED

# What may differ from run to run, and what replaces it.
MASKS = [
    (r"YARP version .*", "YARP version V"),
    (r"\d+\.\d+\.\d+\.\d+(?!\d)", "IP"),
    (r"(?<=://IP:)\d+", "N"),
    (r"(?<= port )\d+", "N"),
    (r"(?<= port number )\d+", "N"),
    (r"(?<=/tmp/port/)\d+", "N"),
    (r"\d+\.\d+ [mun]?s\b", "T"),
    (r"Period is .*", "Period"),
    # Without a name server ours connects ports by their addresses.
    (r"(?<=to tcp:/)/IP:N(?=/tmp/port/)", ""),
    # 3.5 leaves out the carrier of the name server itself.
    (r"(registration name /root .* type) $", r"\1 tcp"),
]

# Where we differ on purpose: stock's exit code, ours (see cli/README.md).
WAIT_SUCCEEDS = {1: 0}
FAILURE_IS_TOLD = {0: 1}

# Reports of connections come from threads of their own: compared as a set, apart from the rest.
REPORTS = re.compile(r"\[INFO\] \|yarp\.os\.impl\.PortCore")

# Seconds that any single step may take.
PATIENCE = 40

# How often a latency test is started again because stock's server missed a frame.
LATENCY_ATTEMPTS = 6

# The last line of a terminal, which no command prints.
END_OF_OUTPUT = "--- the command has ended ---"


class Failure(Exception):
    """A step did not come to its end."""


class Process:
    """A command that runs, with what it has printed so far."""

    def __init__(self, world, tool, words):
        self.label = f"{tool} {' '.join(words)}"
        # A terminal, so that stock prints line by line.
        terminal, self.inside = pty.openpty()
        try:
            self.child = subprocess.Popen(
                [*TIED, world.tools[tool], *words],
                stdin=subprocess.PIPE,
                stdout=self.inside,
                stderr=subprocess.PIPE,
                env=world.environment,
                cwd=world.directory,
                start_new_session=True,
            )
        except OSError:
            os.close(self.inside)
            raise
        world.children.append(self)
        self.out, self.err = [], []
        self.changed = threading.Condition()
        self.threads = [
            threading.Thread(target=self._read, args=pair, daemon=True)
            for pair in [(os.fdopen(terminal, "rb"), self.out), (self.child.stderr, self.err)]
        ]
        for thread in self.threads:
            thread.start()

    def _read(self, stream, lines):
        try:
            with stream:
                for line in stream:
                    text = line.decode(errors="replace").rstrip("\r\n")
                    # The command may leave its last line without an end.
                    text, ended, _ = text.partition(END_OF_OUTPUT)
                    if text or not ended:
                        with self.changed:
                            lines.append(text)
                            self.changed.notify_all()
                    if ended:
                        break
        except OSError:
            # This is how a terminal tells that nobody writes to it any more.
            pass

    def see(self, text, count=1, patience=PATIENCE):
        """Waits until a line holds `text`, `count` times."""
        end = time.monotonic() + patience
        with self.changed:
            while sum(text in line for line in self.out) < count:
                left = end - time.monotonic()
                if left <= 0 or not self.changed.wait(left):
                    raise Failure(f"{self.label}: no {text!r} in {self.out} {self.err}")
        return self

    def type(self, *lines):
        """Types lines at it."""
        self.child.stdin.write("".join(line + "\n" for line in lines).encode())
        self.child.stdin.flush()
        return self

    def end_input(self):
        """Lets it see the end of its input."""
        self.child.stdin.close()
        return self

    def signal(self, number=signal.SIGINT):
        """Sends a signal."""
        self.child.send_signal(number)
        return self

    def finish(self):
        """Waits for its end; gives exit code and lines of standard output."""
        try:
            code = self.child.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise Failure(f"{self.label}: does not end; {self.out} {self.err}") from None
        self._end_output()
        for thread in self.threads:
            thread.join(PATIENCE)
        return code, list(self.out)

    def _end_output(self):
        """Lets the terminal end once it was read to its end.

        A terminal that nobody has open any more may forget what was not read yet: so this side
        keeps it open, and writes a last line.
        """
        if self.inside is not None:
            os.write(self.inside, f"{END_OF_OUTPUT}\n".encode())
            os.close(self.inside)
            self.inside = None

    def kill(self):
        """Ends it, whatever it does."""
        if self.child.poll() is None:
            os.killpg(self.child.pid, signal.SIGKILL)
            self.child.wait(PATIENCE)
        self._end_output()


class World:
    """The two tools, a configuration directory, and what was started."""

    def __init__(self, stock, ours, directory):
        self.tools = {"stock": real_program(stock), "ours": real_program(ours)}
        self.directory = directory
        self.children = []
        self.environment = dict(os.environ, YARP_CONFIG_HOME=directory, YARP_DATA_HOME=directory,
                                YARP_FORWARD_LOG_ENABLE="0")
        for name in ("YARP_NAMESPACE", "YARP_IP", "YARP_PORT_PREFIX", "YARP_CLOCK", "YARP_QUIET"):
            self.environment.pop(name, None)

    def run(self, tool, line, text=""):
        """Runs a command to its end."""
        process = Process(self, tool, line.split() if isinstance(line, str) else line)
        try:
            process.type(*text.splitlines()) if text else None
            process.end_input()
        except BrokenPipeError:
            # It did not want the input.
            pass
        return process.finish()

    def start(self, tool, line, seen="active at"):
        """Starts a command and waits for what tells that it is ready."""
        process = Process(self, tool, line.split())
        return process.see(seen) if seen else process

    def address(self, port):
        """Where a port is, as the name server says."""
        _, lines = self.run("ours", f"name query {port}")
        found = re.search(r" ip (\S+) port (\d+) ", " ".join(lines))
        if not found:
            raise Failure(f"{port} is not registered: {lines}")
        return found[1], int(found[2])

    def sweep(self):
        """Ends whatever a scenario left behind."""
        for process in self.children:
            process.kill()
        self.children.clear()


def real_program(path):
    """The program behind a wrapper script, as Python packages install them: signals reach it."""
    with open(path, "rb") as file:
        if file.read(2) != b"#!":
            return path
    prefix = os.path.dirname(os.path.dirname(os.path.realpath(path)))
    name = os.path.basename(path)
    behind = glob.glob(f"{prefix}/lib/python3*/site-packages/yarp/bin/{name}")
    return behind[0] if behind else path


def masked(result):
    """Exit code, lines in order, and reports of connections as a set."""
    code, lines = result
    masked_lines = []
    for line in lines:
        for pattern, replacement in MASKS:
            line = re.sub(pattern, replacement, line)
        masked_lines.append(line)
    reports = {line for line in masked_lines if REPORTS.match(line)}
    # Ours tells whose a name in use is (see cli/README.md).
    others = [line for line in masked_lines if not REPORTS.match(line) and " belongs to tcp://" not in line]
    # Whether a server got round to waiting again before the signal depends on who was faster.
    if others[-2:] == ["Waiting for a message...", "Interrupting..."]:
        del others[-2]
    return code, others, sorted(reports)


# Scenarios: name, number of roles, and a function of the world and the tools in these roles that
# gives the results to compare. `Single` is the shape of most.

SCENARIOS = []


def scenario(name, roles=1, codes=None):
    """Registers a scenario."""

    def register(function):
        SCENARIOS.append((name, roles, function, codes or {}))
        return function

    return register


def single(name, *lines, codes=None, text=""):
    """A scenario of commands that one tool runs to their ends."""
    scenario(name, codes=codes)(lambda world, tool: [world.run(tool, line, text) for line in lines])


single("no command", "")
single("unknown command", "nonsense")
single("version", "version", "--version")
single("admin alone", "admin")
single("deprecated prefixes", "verbose exists /root", "quiet exists /root")
single("where", "where")
single("namespace", "namespace")
single("conf", "conf")
single("usage", "exists", "exists a b c", "connect a b c d", "disconnect /a", "disconnect /a /b tcp",
       "ping", "read", "write", "readwrite", "readwrite /a", "repeat", "rpc", "admin rpc", "rpcserver",
       "rpcserver --echo", "rpcserver --nonsense /a", "terminate", "topic", "wait", "wait a b c",
       "conf x", "detect x")
single("name list", "name list", "name list /root", "name list /nothing")
single("name query", "name query /root", "name query /nothing", "name query")
single("name register", "name register /by/hand tcp 10.1.2.3 4567", "name query /by/hand",
       "name unregister /by/hand", "name query /by/hand", "name unregister /by/hand",
       "name unregister")
single("name register, chosen", "name register /by/hand", "name unregister /by/hand")
single("name properties", "name register /p tcp 10.1.2.3 4567", "name set /p colour blue red",
       "name get /p colour", "name check /p colour blue", "name check /p colour green",
       "name get /p nothing", "name get /nothing colour", "name unregister /p")
single("name, other requests", "name gc", "name route /a /b", "name runners", "name nonsense",
       "name announce /nothing", "name help")
single("exists", "exists /root", "exists /nothing", "exists nothing", "exists tcp://root")
single("exists, connection", "exists /nothing /root", "exists /root /nothing")
single("connect, unknown", "connect /nothing /root", "connect /root /nothing")
single("connect, invalid", "connect w /r", "connect /w /r/", "connect --nonsense /w /r")
single("disconnect, unknown", "disconnect /nothing /root", "disconnect /root /nothing")
single("ping, unknown", "ping /nothing", "ping nothing")
single("ping --time", "ping --time /root")
single("persistent connections", "connect --persist /a /b", "connect --persist", "connect",
       "connect --persist-from /c /d fast_tcp", "connect --persist-to /e /f tcp",
       "connect --persist", "connect --persist /c", "disconnect --persist /a /b",
       "disconnect --persist /c /d", "disconnect --persist /e /f", "disconnect --persist /e /f",
       "connect --persist")
single("topics", "topic --list", "topic /t", "topic --list", "topic /t yarp/vector",
       "topic --remove /t", "topic --remove /t", "topic --list")
single("check", "check")
single("rpc, unknown", "rpc /nothing", "rpc nothing", text="hi\n")
single("terminate, unknown", "terminate /nothing")
single("write, unknown target", "write /w /nothing", text="hi\n")
single("write, no target", "write /w", text="hi\n(there\n")
single("write, bad name", "write w", text="hi\n")
single("read, bad name", "read r", codes=FAILURE_IS_TOLD)
single("wait", "wait /root", codes=WAIT_SUCCEEDS)
single("describe", *[f"{command} describe{word}" for command, words in [("priority-qos", ["", " AF12", " LOW", " 40", " 10", " x"]), ("qos", [""]),
                                                                     ("priority-sched", ["", " SCHED_FIFO", " 2", " 9"]), ("sched", [""])]
                     for word in words])
single("env", "env a b", "env --help", "env HOME", "env NO_SUCH_VARIABLE")
single("merge, usage", "merge")
single("merge, unknown", "merge /nothing")
single("at a rate, usage", "sample", "sample --output /s", "sample --rate 5", "sample --output s --rate 5", "clock --help",
       "clock --name c", "stats", "stats /nothing", "stats /nothing --port_type x", "trafficgen", "trafficgen --help",
       "trafficgen /t --period 1", "trafficgen /t --bandwidth 1 --size 1", "trafficgen t", "latency-test",
       "latency-test --help", "latency-test --client", "latency-test --client --nframes 3", "latency-test --nothing")


@scenario("ports that are gone")
def _(world, tool):
    world.run("stock", "name register /gone tcp 127.0.0.1 1")
    lines = ["exists /gone", "ping /gone", "connect /gone /root", "connect /root /gone",
             "disconnect /gone /root", "exists /gone /root", "clean --timeout 1", "clean", "exists /gone"]
    results = [world.run(tool, line) for line in lines]
    return results


@scenario("configuration by hand")
def _(world, tool):
    with tempfile.TemporaryDirectory() as directory:
        other = World(world.tools["stock"], world.tools["ours"], directory)
        lines = ["conf", "conf 1.2.3.4 99", "conf", "conf 1.2.3.4 99 local", "conf 5.6.7.8 100", "conf --clean",
                 "conf --clean", "namespace /foo", "namespace", "conf 9.9.9.9 10", "conf", "namespace /a /b", "namespace"]
        results = []
        for line in lines:
            code, out = other.run(tool, line)
            out = [text.replace(directory, "DIR") for text in out]
            files = {name: open(os.path.join(directory, name)).read() for name in sorted(os.listdir(directory))}
            results.append((code, out + [repr(files)]))
        return results


def elsewhere(world, tool, lines, content=None):
    """Runs commands where no name server is configured, or one that is not there."""
    with tempfile.TemporaryDirectory() as directory:
        if content:
            with open(os.path.join(directory, "yarp.conf"), "w") as file:
                file.write(content)
        other = World(world.tools["stock"], world.tools["ours"], directory)
        return [other.run(tool, line) for line in lines]


@scenario("no name server configured")
def _(world, tool):
    return elsewhere(world, tool, ["where", "exists /a", "exists /a /b", "connect /a /b", "disconnect /a /b",
                                   "name list", "name query /a", "ping /a", "rpc /a", "topic --list", "check"])


@scenario("name server away")
def _(world, tool):
    lines = ["where", "exists /a", "exists /a /b", "connect /a /b", "disconnect /a /b", "name list", "name query /a",
             "ping /a", "topic --list", "write /w", "readwrite /r /w", "repeat /r"]
    return elsewhere(world, tool, lines, "127.0.0.1 1 yarp\n")


@scenario("name server away, told by the exit code", codes=FAILURE_IS_TOLD)
def _(world, tool):
    return elsewhere(world, tool, ["connect", "connect --persist /a /b", "read /r"], "127.0.0.1 1 yarp\n")


def interrupted(line, port="/i"):
    """A command that a signal ends, and what is left of its names."""

    def run(world, tool):
        results = []
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            process = world.start(tool, line, f"Port {port} active")
            # Stock is not ready for a signal before its port answers.
            world.run("ours", f"exists {port}")
            process.signal(number).see("Interrupting...")
            try:
                # Stock misses a signal that comes before it waits for input.
                process.end_input()
            except OSError:
                pass
            results.append(process.finish())
            results.append(world.run("stock", "name list /i"))
        return results

    return run


for command in ("read /i", "write /i", "rpcserver /i"):
    scenario(f"signals end {command.split()[0]}")(interrupted(command))
scenario("signals end readwrite")(interrupted("readwrite /i/r /i/w", "/i/w"))


@scenario("a name that is in use")
def _(world, tool):
    reader = world.start("stock", "read /used")
    results = [world.run(tool, "write /used", "hi\n"), world.run(tool, "exists /used"), world.run(tool, "repeat /used")]
    reader.signal().finish()
    return results


def transfer(carrier):
    """A writer, a reader and who connects them."""

    def run(world, writing, reading, connecting):
        reader = world.start(reading, "read /r")
        writer = world.start(writing, "write /w")
        results = [
            world.run(connecting, f"connect /w /r {carrier}"),
            # Without a carrier stock finds connections over that of the reader alone, ours any (see cli/README.md).
            *([world.run(connecting, "exists /w /r")] if carrier == "tcp" else []),
            world.run(connecting, f"exists /w {carrier}://r"),
            world.run(connecting, "ping /w"),
            world.run(connecting, "ping /r"),
        ]
        for process in (reader, writer):
            process.see("from /w to /r")
        writer.type('hello 5 (a b) [ok] "x y" 1.5 {1 2}', "", '"unfinished', "true false [abcd]", "0 text", "last 1")
        reader.see("last 1")
        results.append(world.run(connecting, "disconnect /w /r"))
        results.append(world.run(connecting, "disconnect /w /r"))
        results.append(world.run(connecting, "exists /w /r"))
        reader.see("Removing input")
        results.append(writer.end_input().finish())
        results.append(reader.signal().finish())
        return results

    return run


for carrier in ("tcp", "fast_tcp", "text", "text_ack"):
    scenario(f"write and read over {carrier}", roles=3)(transfer(carrier))


@scenario("write and read over name_ser", roles=3)
def _(world, writing, reading, connecting):
    """Lines without a sender or an envelope; what would need quotes is left out, for stock drops them."""
    reader = world.start(reading, "read /r")
    writer = world.start(writing, "write /w")
    results = [world.run(connecting, "connect /w /r name_ser")]
    writer.see("from /w to /r")
    writer.type("hello 5 (a b) [ok] 1.5 {1 2}", "true false [abcd]", "last 1")
    reader.see("last 1")
    results.append(world.run(connecting, "disconnect /w /r"))
    results.append(writer.end_input().finish())
    results.append(reader.signal().finish())
    return results


def may_run_in_real_time():
    """Whether the system lets programs have such a policy."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        return True
    except PermissionError:
        return False


if may_run_in_real_time():

    @scenario("threads of a connection", roles=3)
    def _(world, writing, reading, asking):
        reader = world.start(reading, "read /r")
        writer = world.start(writing, "write /w")
        results = [world.run(asking, "connect /w /r")]
        for process in (reader, writer):
            process.see("from /w to /r")
        for side in ("--src", "--des"):
            for value in ("POL:SCHED_FIFO", "PRT:30", "POL:2", "POL:SCHED_OTHER", "PRT:5", "PRT:x"):
                results.append(world.run(asking, f"priority-sched set /w /r {side} {value}"))
                results.append(world.run(asking, "priority-sched get /w /r"))
        writer.type("still there")
        reader.see("still there")
        results.append(writer.end_input().finish())
        reader.see("Removing input")
        results.append(reader.signal().finish())
        return results


@scenario("write to a target", roles=2)
def _(world, writing, reading):
    reader = world.start(reading, "read /r")
    results = []
    for index, target in enumerate(["/r", "fast_tcp://r", "text://r", "tcp://%s:%d/r" % world.address("/r")]):
        results.append(world.run(writing, ["write", "/w", target], f"one\ntwo {index}\n"))
        reader.see(f"two {index}")
        reader.see("Removing input", index + 1)
    results.append(reader.signal().finish())
    return results


@scenario("read from a remote port", roles=2)
def _(world, writing, reading):
    writer = world.start(writing, "write /w")
    reader = world.start(reading, "read /r /w", "Receiving input")
    writer.see("Sending output").type("hello 5").see("")
    reader.see("hello 5")
    results = [reader.signal().finish()]
    writer.see("Removing output")
    results.append(writer.end_input().finish())
    return results


@scenario("verbatim text ends the reader", roles=2)
def _(world, writing, reading):
    reader = world.start(reading, "read /r")
    results = [world.run(writing, "write /w /r verbatim", 'one (two\n"three\n')]
    results.append(reader.finish())
    return results


@scenario("readwrite both ways", roles=2)
def _(world, first, second):
    left = world.start(first, "readwrite /left/r /left/w", "Port /left/w active")
    right = world.start(second, "readwrite /right/r /right/w", "Port /right/w active")
    results = [world.run(first, "connect /left/w /right/r"), world.run(second, "connect /right/w /left/r")]
    left.see("Sending output").type("to the (right")
    right.see("to the (right")
    right.see("Sending output").type("to the left")
    left.see("to the left")
    # The end of the input is told as well, but does not end the other.
    results.append(left.end_input().finish())
    right.see("Removing output").type("nobody reads this")
    results.append(right.end_input().finish())
    return results


def say(world, port, text):
    """Sends text as a person at a terminal would."""
    with socket.create_connection(world.address(port), PATIENCE) as connection:
        connection.sendall(b"CONNECT nobody\r\n" + text.encode())
        # Whoever closes at once may be gone before the lines are read.
        connection.shutdown(socket.SHUT_WR)
        connection.settimeout(PATIENCE)
        while connection.recv(4096):
            pass


for words in ("", " envelope", " trim 3", " trim", " envelope trim 5", " trim x"):

    @scenario(f"read{words} prints")
    def _(world, tool, words=words):
        reader = world.start(tool, f"read /r{words}")
        say(world, "/r", "D\r\nfirst message\r\nD 5 1.5\r\nhello 5\r\nD\r\nno envelope\r\nD 7 2\r\n0 \"as typed\"\r\n"
            "D 8 3\r\n" + "x" * 100 + "\r\nD 9 4\r\nend\r\n")
        reader.see("end" if "trim" not in words else "end"[:3])
        return [reader.signal().finish()]


@scenario("rpc and rpcserver --echo", roles=2)
def _(world, asking, answering):
    server = world.start(answering, "rpcserver --echo /s", "Waiting")
    results = []
    for line in ("rpc /s", "rpc /s /me", "rpc fast_tcp://s", "rpc text_ack://s"):
        text = 'hi\n[add] 5 "a b"\n\n(1 2) 1.5\n[many] 5 (a b) "x y"\n[many]\nmany 1\n'
        results.append(world.run(asking, line, text))
    results.append(world.run(asking, "rpc /s"))
    results.append(server.signal().finish())
    return results


@scenario("rpc and rpcserver with replies by hand", roles=2)
def _(world, asking, answering):
    server = world.start(answering, "rpcserver /s", "Waiting")
    client = world.start(asking, "rpc /s", None)
    client.type("question 1")
    server.see("question 1").type("answer 1")
    client.see("answer 1").type("question 2")
    server.see("question 2").type("[ok] (a b)")
    client.see("[ok] (a b)").type("question 3")
    server.see("question 3").end_input()
    client.see("Response: ", 3)
    return [client.end_input().finish(), server.signal().finish()]


@scenario("rpc --client", roles=2)
def _(world, asking, answering):
    server = world.start(answering, "rpcserver --echo /s", "Waiting")
    client = world.start(asking, "rpc --client /c")
    results = [world.run(asking, "connect /c /s")]
    client.see("Sending output").type("hi", "[get] 5")
    client.see("[get] 5")
    results.append(client.end_input().finish())
    server.see("Removing input")
    results.append(server.signal().finish())
    return results


@scenario("rpc --client without anybody to ask")
def _(world, tool):
    return [world.run(tool, "rpc --client /c", "hi\nho\n")]


@scenario("rpcserver --single", roles=2)
def _(world, asking, answering):
    server = world.start(answering, "rpcserver --single --echo /s", "Waiting")
    return [world.run(asking, "rpc /s", "hi\nho\n"), server.signal().finish()]


@scenario("admin rpc", roles=2)
def _(world, asking, answering):
    server = world.start(answering, "rpcserver --echo /s", "Waiting")
    text = '[ver]\n[list] [in]\n[list] [out]\n[list] [in] "/x"\n[del] "/x"\n[add] "/x"\n[prop] [set] k v\n[prop] [get] k\nnonsense\n'
    return [world.run(asking, "admin rpc /s", text), server.signal().finish()]


@scenario("connect refused", roles=2)
def _(world, asking, answering):
    server = world.start(answering, "rpcserver --echo /s", "Waiting")
    reader = world.start(answering, "read /r")
    results = [world.run(asking, "connect /s /r"), world.run(asking, "connect /r /s")]
    return results + [server.signal().finish(), reader.signal().finish()]


@scenario("repeat", roles=3)
def _(world, writing, repeating, reading):
    reader = world.start(reading, "read /r")
    repeater = world.start(repeating, "repeat /again")
    writer = world.start(writing, "write /w")
    results = [world.run(repeating, "connect /again /r"), world.run(writing, "connect /w /again")]
    repeater.see("Receiving input")
    repeater.see("Sending output")
    writer.see("Sending output").type("hello (a b) 1.5")
    reader.see("hello (a b) 1.5")
    results.append(world.run(writing, "disconnect /w /again"))
    results.append(writer.end_input().finish())
    results.append(world.run(reading, "disconnect /again /r"))
    reader.see("Removing input")
    results.append(reader.signal().finish())
    # Stock has no handler there: it dies of the signal and leaves its name behind.
    repeater.signal().finish()
    return results


def until_seen(process, text, send):
    """Sends again what may be left out, until it is there."""
    for _ in range(10):
        send()
        try:
            return process.see(text, patience=PATIENCE / 10)
        except Failure as error:
            failure = error
    raise failure


@scenario("merge", roles=3)
def _(world, writing, merging, reading):
    writers = [world.start(writing, f"write /w{number}") for number in (0, 1)]
    merger = world.start(merging, "merge --input /w0 /w1 --output /m --worker /mi --carrier tcp", "Ready.")
    reader = world.start(reading, "read /r")
    results = [world.run(reading, "connect /m /r")]
    reader.see("Receiving input")
    # What is not there yet is left out. It may be sent before the connection is there.
    writers[0].type("a 1")
    reader.see("a 1")
    # It goes on only if the acknowledgement of the first is there.
    until_seen(reader, "a 1 (b) 2", lambda: writers[1].type("(b) 2"))
    for writer in writers:
        results.append(writer.end_input().finish())
    # Stock has no handler there: it dies of the signal and leaves its names behind.
    merger.signal().finish()
    said = [line for line in merger.out if not REPORTS.match(line) and line != "Interrupting..."]
    results.append((0, said))
    reader.see("Removing input")
    code, lines = reader.signal().finish()
    results.append((code, list(dict.fromkeys(lines))))
    return results


@scenario("sample", roles=3)
def _(world, writing, sampling, reading):
    writer = world.start(writing, "write /w")
    reader = world.start(reading, "read /r")
    sampler = world.start(sampling, "sample --input /w --output /s --carrier tcp --rate 20 --show", "Receiving input")
    results = [world.run(reading, "connect /s /r")]
    reader.see("Receiving input")
    writer.see("Sending output").type("hello (a b) 1.5")
    # It is sent again and again, and shown as often.
    reader.see("hello (a b) 1.5", 3)
    sampler.see("hello (a b) 1.5", 3)
    results.append(writer.end_input().finish())
    # Stock has no handler there: it dies of the signal and leaves its name behind.
    sampler.signal().finish()
    # Whether empty messages went before it depends on who was faster.
    said = {line for line in sampler.out if line and not REPORTS.match(line) and line != "Interrupting..."}
    results.append((0, sorted(said)))
    reader.see("Removing input")
    code, lines = reader.signal().finish()
    return results + [(code, sorted(set(lines) - {""}))]


@scenario("clock", roles=2)
def _(world, ticking, reading):
    clock = world.start(ticking, "clock --name /tick --period 20 --rtf 0.001", "running happily")
    reader = world.start(reading, "read /r")
    results = [world.run(reading, "connect /tick /r")]
    reader.see("Receiving input").see("0 ", 5)
    clock.signal().finish()
    said = [line for line in clock.out if not REPORTS.match(line) and line != "Interrupting..."]
    # A clock of ours takes requests, for which it has a port that stock's has not.
    said = [line for line in said if " Port /tick/rpc:i " not in line]
    results.append((0, sorted(set(said))))
    reader.see("Removing input")
    code, lines = reader.signal().finish()
    times = [line.split() for line in lines if re.fullmatch(r"\d+ \d+", line)]
    times = [int(seconds) * 1_000_000_000 + int(nanoseconds) for seconds, nanoseconds in times]
    forward = len(times) > 3 and times == sorted(times)
    return results + [(code, ["forward" if forward else repr(lines)])]


# What a program of stock's does that follows a clock of the network: the time that it has is that of the clock.
FOLLOWING = """
import yarp
yarp.Network.init()
first = yarp.now()
yarp.delay(0.2)
print("follows" if first < 1e6 and yarp.now() >= first + 0.2 else "does not follow", flush=True)
yarp.Network.fini()
"""


@scenario("a program follows the clock")
def _(world, tool):
    clock = world.start(tool, "clock --name /sim/clock --period 10", "running happily")
    environment = dict(world.environment, YARP_CLOCK="/sim/clock")
    ended = subprocess.run([sys.executable, "-c", FOLLOWING], env=environment, cwd=world.directory, text=True,
                           capture_output=True, timeout=PATIENCE)
    clock.signal().finish()
    said = [line for line in ended.stdout.splitlines() if "follow" in line]
    return [(ended.returncode, said or ended.stdout.splitlines() + ended.stderr.splitlines())]


@scenario("trafficgen and stats", roles=2)
def _(world, sending, counting):
    line = "trafficgen /t --period 0.1 --size 0.001"
    traffic = world.start(sending, line)
    results = []
    for kind in ("", " --port_type Port", " --protocol fast_tcp"):
        code, lines = world.run(counting, f"stats /t --duration 2{kind}")
        results.append((code, [re.sub(r"(?<![\w/])(\d[\d.e+-]*|inf)(?= )", "9", line) for line in lines]))
    traffic.signal().finish()
    said = [line for line in traffic.out if not REPORTS.match(line) and line != "Interrupting..."]
    results.append((0, said))
    results.append(world.run(sending, "trafficgen /t --bandwidth 1 --duration 0.2"))
    return results


@scenario("latency-test", roles=2)
def _(world, serving, measuring):
    # Stock's server reads an empty first frame in about 1 of 20 tests, with stock's client, too (which then waits for ever).
    for _ in range(LATENCY_ATTEMPTS):
        server = world.start(serving, "latency-test --server --details", "I am the server")
        try:
            results = latency_results(world, server, measuring)
        except Failure:
            if not missed_a_frame(serving, server):
                raise
        else:
            if not missed_a_frame(serving, server):
                return results
        world.sweep()
    raise Failure(f"stock's server read an empty frame in each of {LATENCY_ATTEMPTS} attempts")


def missed_a_frame(serving, server):
    return serving == "stock" and 'Received: ""' in server.out


def latency_results(world, server, measuring):
    """Measures over every kind of connection."""
    results = []
    for index, way in enumerate(["--payload_size 100", "--payload_size 10 --details", "--payload_size 10 --no-reply",
                                 "--customtest (10)", "--payload_size 10 --protocol udp", "--payload_size 10 --protocol nothing"]):
        if "nothing" not in way:
            server.see("I am the server", index + 1)
        code, lines = world.run(measuring, f"latency-test --client --nframes 3 {way}")
        # How a connection of datagrams ends has no fixed order.
        lines = [re.sub(r"\d[\d.e+-]*(?= ms|\[ms\])", "T", line) for line in lines if not REPORTS.match(line)]
        results.append((code, lines))
    for size in ["100", "10"]:
        with open(os.path.join(world.directory, f"log_{size}.txt")) as file:
            results.append((0, [str(len(line.split())) for line in file]))
    # The end of datagrams may get lost.
    server.see("Test 3 complete").signal().finish()
    said = [line for line in server.out if not REPORTS.match(line) and "latencyTest/server active" not in line]
    # Numbers that are measured, and how far it was with the next test.
    said = [re.sub(r"\d+\.\d+(e-\d+)?|(?<= )\d+e-\d+", "T", line) for line in said[:said.index("Test 3 complete") + 1]]
    return results + [(0, said)]


def asked(world, tool, *words):
    """Runs `yarp run` to its end; what it prints on standard error counts from the reply on."""
    process = Process(world, tool, ["run", *words])
    process.end_input()
    code, lines = process.finish()
    said = process.err[process.err.index("RESPONSE:"):] if "RESPONSE:" in process.err else ["no reply"]
    return code, lines + [re.sub(r"(?<=pid=)\d+|(?<=\(pid )\d+|^\d+$", "9", line) for line in said]


def until_gone(world, tool, tag):
    """Waits until a server has noticed the end of a command."""
    end = time.monotonic() + PATIENCE
    while asked(world, tool, "--on", "/host", "--isrunning", tag)[0] == 0:
        if time.monotonic() > end:
            raise Failure(f"{tag} runs on")


# Which there are, and where they come from, is no business of stock's.
single("plugin", "plugin", "plugin --help", "plugin nonsense", "plugin /nonsense.so nonsense")
single("run, usage", "run", "run --help", "run --on /host", "run --cmd", "run --cmd ls", "run --cmd ls --as t", "run --sigterm",
       "run --kill t --on /host", "run --ps", "run --exit", "run --isrunning --on /host", "run --server host")


@scenario("run", roles=2)
def _(world, serving, asking):
    # Ours starts without a key or roles only if it is told to.
    words = "run --server /host --insecure" if serving == "ours" else "run --server /host"
    server = world.start(serving, words, "successfully started")
    results = [world.run(asking, "name get /host yarprun")]

    def ask(*words):
        results.append(asked(world, asking, "--on", "/host", *words))

    told = os.path.join(world.directory, "told")
    ask("--as", "t1", "--cmd", "sleep 1000", "--env", "A=1;B=2")
    ask("--as", "t2", "--cmd", "sleep", "1000")
    until_gone(world, asking, "t2")
    ask("--ps")
    ask("--isrunning", "t1")
    ask("--isrunning", "other")
    ask("--sigterm", "other")
    ask("--kill", "other", "9")
    ask("--sigterm", "t1")
    until_gone(world, asking, "t1")
    ask("--ps")
    ask("--as", "t3", "--cmd", "sleep 1000", "--workdir", "/tmp")
    ask("--kill", "t3", "9")
    until_gone(world, asking, "t3")
    ask("--as", "t4", "--cmd", f'sh -c "echo $A $YARP_IS_YARPRUN > {told}"', "--env", "A=blue")
    until_gone(world, asking, "t4")
    with open(told) as file:
        results.append((0, file.read().splitlines()))
    os.remove(told)
    ask("--as", "t5", "--cmd", "sleep 1000")
    ask("--sigtermall")
    until_gone(world, asking, "t5")
    ask("--which", "sleep")
    ask("--which", "nothing")
    # Stock looks after a hundredth of a second whether a command was refused, and may be too early.
    for words in (["t6"], ["t7", "--workdir", "/no/such/place"]):
        for _ in range(20):
            refused = asked(world, asking, "--on", "/host", "--cmd", "/no/such/program", "--as", *words)
            if refused[0]:
                break
        results.append(refused)
    ask("--exit")
    code, lines = server.finish()
    results.append((code, lines))
    results.append(world.run("stock", "exists /host"))
    return [(code, [line.replace(world.directory, "DIR") for line in lines]) for code, lines in results]


@scenario("time", roles=1)
def _(world, tool):
    results = []
    for line in ("time", "time --ros"):
        clock = world.start(tool, line, "1")
        clock.signal().finish()
        # Nanoseconds come without leading zeros, so the number of digits is not told.
        results.append((0, [re.sub(r"\d+", "9", clock.out[0])]))
    return results


@scenario("wait for a port to come", roles=2, codes=WAIT_SUCCEEDS)
def _(world, waiting, coming):
    waiter = world.start(waiting, "wait /late", "Waiting for /late")
    reader = world.start(coming, "read /late")
    return [waiter.finish(), reader.signal().finish()]


@scenario("wait for a connection to come", roles=2, codes=WAIT_SUCCEEDS)
def _(world, waiting, coming):
    reader, writer = world.start(coming, "read /r"), world.start(coming, "write /w")
    waiter = world.start(waiting, "wait /w /r", "Waiting for /w->/r")
    results = [world.run(coming, "connect /w /r"), waiter.finish()]
    reader.see("Receiving input")
    results.append(writer.end_input().finish())
    reader.see("Removing input")
    results.append(reader.signal().finish())
    return results


@scenario("persistent connection is made", roles=3)
def _(world, asking, writing, reading):
    results = [world.run(asking, "connect --persist /w /r")]
    reader = world.start(reading, "read /r")
    writer = world.start(writing, "write /w", "Sending output")
    reader.see("Receiving input")
    writer.type("hello")
    reader.see("hello")
    results.append(world.run(asking, "connect /w"))
    results.append(world.run(asking, "disconnect --persist /w /r"))
    results.append(writer.end_input().finish())
    reader.see("Removing input")
    results.append(reader.signal().finish())
    return results


@scenario("topic connects", roles=3)
def _(world, asking, writing, reading):
    results = [world.run(asking, "topic /t")]
    reader = world.start(reading, "read /r")
    writer = world.start(writing, "write /w")
    results.append(world.run(asking, "connect /w topic://t"))
    results.append(world.run(asking, "connect topic://t /r"))
    writer.see("Sending output").type("hello")
    reader.see("hello")
    results.append(world.run(asking, "connect"))
    results.append(writer.end_input().finish())
    reader.see("Removing input")
    results.append(reader.signal().finish())
    for line in ("disconnect --persist /w topic://t", "disconnect --persist topic://t /r", "topic --remove /t"):
        results.append(world.run(asking, line))
    return results


def free_port():
    """A TCP port that nobody has, away from those that systems give to outgoing connections: the
    ports of a network are numbered from there, and stock does not step over one that is taken."""
    for port in random.sample(range(11000, 30000, 200), 50):
        with socket.socket() as listener:
            try:
                listener.bind(("", port))
                return port
            except OSError:
                continue
    raise Failure("no free TCP port")


def start_server(world, tool):
    """Starts the name server and waits until it answers."""
    words = ["server", "--ip", "127.0.0.1", "--socket", str(free_port()), "--write"]
    server = Process(world, tool, words)
    # It outlives the scenarios.
    world.children.remove(server)
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if server.child.poll() is not None:
            break
        if os.path.exists(os.path.join(world.directory, "yarp.conf")):
            try:
                if world.run("stock", "name list")[0] == 0:
                    return server
            except Failure:
                pass
        time.sleep(0.1)
    server.kill()
    raise Failure(f"{server.label}: does not serve; {server.out} {server.err}")


def forget_names(world):
    """Takes back names that were left behind."""
    _, lines = world.run("stock", "name list")
    for name in re.findall(r"registration name (/\S+)", "\n".join(lines)):
        if name != "/root":
            world.run("stock", f"name unregister {name}")


def play(world, function, tools):
    """Runs a scenario; gives what it was compared by."""
    try:
        return [masked(result) for result in function(world, *tools)]
    except (Failure, OSError) as error:
        return f"{type(error).__name__}: {error}"
    finally:
        world.sweep()
        forget_names(world)


def played(world, function, tools, label):
    """What a scenario does. Seldom a program of stock's gets stuck, with stock alone too; then it is played again."""
    def attempt():
        found = play(world, function, tools)
        return found, found if isinstance(found, str) and found.startswith("Failure: stock") else None

    return tried(attempt, f"{label}:")[0]


def differences(expected, found, codes):
    """What differs, as lines to print; `codes` translates stock's exit codes."""
    if isinstance(expected, str) or isinstance(found, str):
        return [f"stock: {expected}" if isinstance(expected, str) else f"ours:  {found}"]
    lines = []
    for index, (theirs, ours) in enumerate(zip(expected, found)):
        code = codes.get(theirs[0], theirs[0])
        if ours[0] not in (code, theirs[0]):
            lines.append(f"step {index}: exit code {ours[0]}, stock {theirs[0]}; printed {ours[1]}")
        for what in (1, 2):
            if theirs[what] != ours[what]:
                lines += [f"step {index}: stock {theirs[what]}", f"step {index}: ours  {ours[what]}"]
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stock-yarp", required=True, help="stock's `yarp`")
    parser.add_argument("--our-yarp", required=True, help="our `yarp`")
    parser.add_argument("--server", choices=["stock", "ours"], required=True, help="whose name server")
    parser.add_argument("--only", default="", help="only scenarios whose name holds this text")
    parser.add_argument("--show", action="store_true", help="print what stock does")
    arguments = parser.parse_args()
    failures = 0
    with tempfile.TemporaryDirectory() as directory:
        world = World(os.path.abspath(arguments.stock_yarp), os.path.abspath(arguments.our_yarp), directory)
        server = None
        try:
            server = start_server(world, arguments.server)
            print(f"stock: {world.run('stock', 'version')[1][0]}; ours: {world.run('ours', 'version')[1][0]}; "
                  f"name server: {arguments.server}", flush=True)
            for name, roles, function, codes in SCENARIOS:
                if arguments.only not in name:
                    continue
                combinations = itertools.product(["stock", "ours"], repeat=roles)
                expected = played(world, function, next(combinations), f"{name}, with stock alone")
                if arguments.show:
                    print(f"   {name}: {expected}")
                for tools in combinations:
                    label = name if roles == 1 else f"{name} ({', '.join(tools)})"
                    found = played(world, function, tools, label)
                    wrong = differences(expected, found, codes)
                    failures += bool(wrong)
                    print("FAIL" if wrong else "ok", label, flush=True)
                    for line in wrong:
                        print("    ", line, flush=True)
        except Failure as error:
            print("FAIL", error)
            failures += 1
        finally:
            world.sweep()
            if server:
                server.kill()
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
