"""Two hosts, each a network namespace, whose link is taken down and up while ports are connected.

    two_hosts.py OUR_YARP HOSTS

`HOSTS` is the program `hosts`. Host a has the name server and the writers, host b the readers. Needs
root and iproute2; fails, and never skips, where there are no namespaces. Every wait has a deadline;
nothing is left behind. Prints `ok NAME` per check.
"""

import os
import subprocess
import sys
import tempfile
import threading
import time

from tied import TIED

# Seconds that a step may take.
PATIENCE = 60
# Numbers of this run's own, so that two runs do not meet.
RUN = os.getpid() % 100000
A, B = f"ya{RUN}", f"yb{RUN}"
LINK_A, LINK_B = f"va{RUN}", f"vb{RUN}"
ADDRESS_A, ADDRESS_B = "10.213.77.1", "10.213.77.2"


class Failure(Exception):
    """A step did not come to its end."""


def ip(*words):
    """Runs `ip`."""
    done = subprocess.run(["ip", *words], capture_output=True, text=True)
    if done.returncode != 0:
        raise Failure(f"ip {' '.join(words)}: {done.stderr.strip()}; two hosts need root, network "
                      "namespaces and iproute2 (run where CAP_NET_ADMIN is granted)")


class Process:
    """A program on one of the hosts, with what it has printed so far."""

    def __init__(self, host, home, *command):
        self.label = " ".join(command)
        environment = dict(os.environ, YARP_CONFIG_HOME=home, YARP_FORWARD_LOG_ENABLE="0")
        self.child = subprocess.Popen(
            [*TIED, "ip", "netns", "exec", host, *command], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
        self.lines = []
        self.changed = threading.Condition()
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self):
        for line in self.child.stdout:
            with self.changed:
                self.lines.append(line.rstrip("\n"))
                self.changed.notify_all()

    def mark(self):
        """A place behind all that was printed so far."""
        with self.changed:
            return len(self.lines)

    def see(self, text, since=0, patience=PATIENCE):
        """Waits for a line that begins with `text`, printed behind `since`."""
        end = time.monotonic() + patience
        with self.changed:
            while not any(line.startswith(text) for line in self.lines[since:]):
                left = end - time.monotonic()
                if left <= 0 or not self.changed.wait(left):
                    raise Failure(f"{self.label}: no {text!r} in {self.lines[since:][-20:]}")
        return self

    def finish(self, patience=PATIENCE):
        """Ends its input and waits for its end; gives the seconds that this took."""
        begin = time.monotonic()
        self.child.stdin.close()
        try:
            code = self.child.wait(patience)
        except subprocess.TimeoutExpired:
            raise Failure(f"{self.label}: does not end: {self.lines[-20:]}") from None
        self.thread.join(PATIENCE)
        if code != 0:
            raise Failure(f"{self.label}: ended with {code}: {self.lines[-20:]}")
        return time.monotonic() - begin

    def kill(self):
        """Ends it, whatever it does."""
        if self.child.poll() is None:
            self.child.kill()
            self.child.wait()


def hosts():
    """Makes both hosts and the link between them."""
    ip("netns", "add", A)
    ip("netns", "add", B)
    ip("link", "add", LINK_A, "netns", A, "type", "veth", "peer", "name", LINK_B, "netns", B)
    for host, link, address in [(A, LINK_A, ADDRESS_A), (B, LINK_B, ADDRESS_B)]:
        ip("-n", host, "address", "add", f"{address}/24", "dev", link)
        ip("-n", host, "link", "set", "lo", "up")
        ip("-n", host, "link", "set", link, "up")


def link(state, host=B):
    """Takes the end of the link at a host down, or up again."""
    ip("-n", host, "link", "set", LINK_A if host == A else LINK_B, state)


def main():
    ours, program = sys.argv[1:]
    running = []

    def start(host, home, *command):
        process = Process(host, home, *command)
        running.append(process)
        return process

    with tempfile.TemporaryDirectory() as home:
        try:
            hosts()
            server = start(A, home, ours, "server", "--ip", ADDRESS_A, "--socket", "10000", "--write")
            server.see("Ok. Ready!")
            for carrier in ["tcp", "fast_tcp", "text_ack"]:
                check(start, home, program, carrier)
            for carrier in ["udp", "mcast"]:
                check_datagrams(start, home, program, carrier)
            check_closing(start, home, program)
        finally:
            for process in running:
                process.kill()
            for host in (A, B):
                subprocess.run(["ip", "netns", "delete", host], capture_output=True)


def check(start, home, program, carrier):
    """The link goes down until both ends have noticed, and comes up again; then for a moment."""
    reader = start(B, home, program, "serve").see("ready")
    writer = start(A, home, program, "watch", "/hosts/reader", carrier)
    writer.see("link up").see("call ok")
    reader.see("read ")
    mark = writer.mark()
    link("down")
    writer.see("link lost", mark)
    writer.see("call failed", mark)
    print(f"ok {carrier}: the supervised connection is told lost, a call fails at its deadline")
    mark = writer.mark()
    link("up")
    writer.see("link up", mark)
    writer.see("call ok", mark)
    reader.see("read ", reader.mark())
    print(f"ok {carrier}: it comes back, messages flow, calls are answered")
    link("down")
    time.sleep(0.5)
    link("up")
    reader.see("read ", reader.mark())
    print(f"ok {carrier}: a short interruption is survived")
    writer.finish()
    reader.finish()
    print(f"ok {carrier}: all close")


def check_datagrams(start, home, program, carrier):
    """What is written while the link is down is lost; what comes behind it arrives, whichever end was down."""
    reader = start(B, home, program, "serve").see("ready")
    writer = start(A, home, program, "watch", "/hosts/reader", carrier)
    writer.see("link up")
    reader.see("read ")
    for host, name in [(B, "reader"), (A, "writer")]:
        link("down", host)
        # Longer than a silence after which a host is taken for gone.
        time.sleep(5)
        mark = reader.mark()
        link("up", host)
        reader.see("read ", mark)
        print(f"ok {carrier}: messages flow again when the link of the {name} is up")
    writer.finish()
    reader.finish()
    print(f"ok {carrier}: all close")


def check_closing(start, home, program):
    """Ports close in bounded time while nobody can be reached, whoever goes first."""
    for first in ["writers", "readers"]:
        reader = start(B, home, program, "serve").see("ready")
        writer = start(A, home, program, "watch", "/hosts/reader", "tcp")
        writer.see("link up").see("call ok")
        # At the other end, so that a host does not see at once that its own end is down.
        link("down", B if first == "writers" else A)
        order = [("writers", writer), ("readers", reader)]
        for name, process in order if first == "writers" else reversed(order):
            took = process.finish(30)
            print(f"ok the {name} close while the link is down ({took:.1f} s)")
        link("up", A)
        link("up", B)


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        sys.exit(f"FAIL {failure}")
