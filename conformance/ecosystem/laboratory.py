"""A YARP network of ours for programs of others: a name server, boards, and the programs, each of which can be killed."""

import os
import queue
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "../live"))

from tied import TIED  # noqa: E402

WITH_STOCK = os.path.join(HERE, "../stock/with_stock")
# Seconds that any single step may take, on a machine with other work.
STEP_TIMEOUT = 60
# TCP ports that the name server hands out.
PORTS = 400


class Failed(Exception):
    """States a step, what was expected and what was found."""


def until(what, condition, timeout=STEP_TIMEOUT):
    """Returns what `condition` returns, as soon as that is true."""
    end = time.monotonic() + timeout
    while not (found := condition()):
        if time.monotonic() > end:
            raise Failed(f"{what}: not within {timeout} s")
        time.sleep(0.1)
    return found


def free_ports():
    """Returns the first of a range of TCP ports of which none is in use.

    The range is below that of outgoing connections, which take any port of theirs at any time.
    """
    for _ in range(100):
        first = random.randrange(12000, 32000 - PORTS)
        try:
            for port in range(first, first + PORTS):
                with socket.socket() as listener:
                    listener.bind(("", port))
            return first
        except OSError:
            continue
    raise Failed("no free range of TCP ports between 12000 and 32000")


def close_to(found, expected, tolerance=0.01):
    return len(found) == len(expected) and all(abs(a - b) <= tolerance for a, b in zip(found, expected))


class Reader:
    """Prints the messages of a port, with `yarp read` of ours, and keeps them in a queue."""

    def __init__(self, laboratory, port):
        command = [*TIED, laboratory.yarp, "read", "...", port]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.port = port
        self.lines = queue.Queue()
        threading.Thread(target=self.follow, daemon=True).start()

    def follow(self):
        for line in self.process.stdout:
            if not line.startswith("["):
                self.lines.put(line.strip())

    def next(self):
        try:
            return self.lines.get(timeout=STEP_TIMEOUT)
        except queue.Empty:
            raise Failed(f"no message of {self.port} within {STEP_TIMEOUT} s") from None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


class Laboratory:
    def __init__(self, yarp, programs):
        self.yarp = os.path.abspath(yarp)
        self.programs = os.path.abspath(programs)
        self.work = tempfile.mkdtemp()
        self.running = {}
        self.first_port = free_ports()
        # With a slash: stock looks for relative files in several places.
        home = os.path.join(self.work, "home")
        os.makedirs(os.path.join(home, "data"))
        os.environ.update(YARP_CONFIG_HOME=home, YARP_DATA_HOME=os.path.join(home, "data"), YARP_FORWARD_LOG_ENABLE="0")
        self.name_server()

    def launch(self, name, command):
        with open(self.log(name), "ab") as log:
            self.running[name] = subprocess.Popen(
                [*TIED, *command], stdin=subprocess.PIPE, stdout=log, stderr=log, cwd=self.work)

    def log(self, name):
        return os.path.join(self.work, f"{name}.log")

    def printed(self, name):
        with open(self.log(name), encoding="utf-8", errors="replace") as log:
            return log.read()

    def ours(self, name, *words):
        self.launch(name, [self.yarp, *words])

    def program(self, name, *words):
        """Starts one of the programs as it is."""
        self.launch(name, [WITH_STOCK, os.path.join(self.programs, name), *words])

    def built(self, name):
        return os.access(os.path.join(self.programs, name), os.X_OK)

    def enter(self, name):
        """Presses Enter in a program."""
        self.running[name].stdin.write(b"\n")
        self.running[name].stdin.flush()

    def kill(self, name):
        process = self.running.pop(name)
        process.kill()
        process.wait()

    def end(self, name):
        """Ends a program as with Ctrl-C; one that does not end is killed, which is a failure."""
        process = self.running.pop(name, None)
        if process is None:
            return
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STEP_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise Failed(f"{name} did not end within {STEP_TIMEOUT} s of SIGINT") from None

    def wait(self, name):
        """Waits for a program to end by itself, and returns its exit code."""
        try:
            return self.running[name].wait(STEP_TIMEOUT)
        except subprocess.TimeoutExpired:
            raise Failed(f"{name} did not end by itself within {STEP_TIMEOUT} s") from None
        finally:
            if self.running[name].poll() is not None:
                del self.running[name]

    def end_all(self):
        """Kills whatever but the name server is left of a check."""
        for name in list(self.running):
            if name != "server":
                self.kill(name)

    def close(self):
        for name in list(self.running):
            self.kill(name)
        shutil.rmtree(self.work, ignore_errors=True)

    def name_server(self):
        self.ours("server", "server", "--ip", "127.0.0.1", "--socket", str(self.first_port), "--ports",
                  f"{self.first_port + 1}-{self.first_port + PORTS - 1}", "--write")
        until("the name server starts", lambda: self.tool("where").returncode == 0)

    def tool(self, *words, text=None):
        return subprocess.run([self.yarp, *words], input=text, capture_output=True, text=True, timeout=STEP_TIMEOUT)

    def exists(self, port):
        until(f"port {port} opens", lambda: self.tool("exists", port).returncode == 0)

    def connect(self, source, destination):
        until(f"{source} is connected to {destination}", lambda: self.tool("connect", source, destination).returncode == 0)

    def board(self, name, axes, *words):
        self.ours(name.strip("/").replace("/", "_"), "dev", "--device", "fakeMotionControl", "--name", name,
                  "--GENERAL::Joints", str(axes), *words)
        self.exists(f"{name}/stateExt:o")

    def ask(self, port, *requests):
        """Returns the replies of a port to requests, without the stamps of boards."""
        asked = self.tool("rpc", port, text="".join(f"{request}\n" for request in requests))
        found = re.findall(r"^Response: (.*)$", asked.stdout, re.MULTILINE)
        return [reply.split(" [tsta]")[0] for reply in found]

    def write(self, port, message):
        if (writing := self.tool("write", "...", port, text=f"{message}\n")).returncode != 0:
            raise Failed(f"cannot write to {port}: {writing.stderr}")

    def expect(self, port, requests, expected):
        found = self.ask(port, *requests)
        if found != expected:
            raise Failed(f"{port} replies {found} to {requests}, not {expected}")

    def encoders(self, board):
        replies = self.ask(f"{board}/rpc:i", "get encs")
        return [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", replies[0])] if replies else []

    def reaches(self, board, expected, tolerance=0.01):
        """Waits until a board is at positions; the failure states where it is."""
        try:
            until("", lambda: close_to(self.encoders(board), expected, tolerance))
        except Failed:
            raise Failed(f"{board} is at {self.encoders(board)} instead of {expected} after {STEP_TIMEOUT} s") from None

    def mode(self, board, axes, mode):
        """Sets the mode of the first axes of a board."""
        self.expect(f"{board}/rpc:i", [f"set icmd cmod {axis} {mode}" for axis in range(axes)], ["[ok]"] * axes)

    def prints(self, name, text):
        until(f"{name} prints {text!r}", lambda: text in self.printed(name))
