"""Stock follows our clock with its pauses and steps, and ours follows stock's, and prints `ok` or `FAIL` per check.

    with_stock python clock.py OUR_YARP STOCK_YARP

Needs a name server. A program of stock's bindings follows the clock by `YARP_CLOCK`, and so does `yarp time` of ours.
Ends with 1 if any check failed.
"""

import os
import subprocess
import sys

from asking import until
from checks import check, leave, same
from programs import Program

OURS, STOCK = [sys.argv[1]], sys.argv[2].split()
# Prints the time for each line, and `slept` after a second of it for the line `sleep`.
FOLLOWER = """
import sys, yarp
yarp.Network.init()
print("started", flush=True)
for line in sys.stdin:
    if line.strip() == "sleep":
        yarp.delay(1.0)
        print("slept", flush=True)
    else:
        print("%.6f" % yarp.now(), flush=True)
"""


def ask(clock, request):
    """The reply of a clock of ours."""
    ended = subprocess.run([*OURS, "rpc", f"{clock}/rpc:i"], input=request + "\n", text=True, capture_output=True, timeout=30)
    replies = [line.split("Response: ")[1].strip() for line in ended.stdout.splitlines() if "Response: " in line]
    return replies[0] if replies else ended.stdout + ended.stderr


def names():
    return subprocess.run([*OURS, "name", "list"], text=True, capture_output=True, timeout=30).stdout


class Follower:
    """A program of stock's bindings that follows a clock."""

    def __init__(self, clock):
        self.process = subprocess.Popen([sys.executable, "-u", "-c", FOLLOWER], env=dict(os.environ, YARP_CLOCK=clock),
                                        text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def line(self):
        """The next line that is not of stock's log."""
        for line in self.process.stdout:
            if line.strip() and not line.startswith("["):
                return line.strip()
        return "(ended)"

    def say(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def now(self):
        self.say("now")
        return float(self.line())


def stock_follows_ours():
    clock = Program(*OURS, "clock", "--name", "/live/clock", "--period", "10", "--paused")
    until("the clock", lambda: ask("/live/clock", "get").startswith("[ok]"))
    follower = Follower("/live/clock")
    same("stock starts by a paused clock", follower.line(), "started")
    same("the time of a paused clock", follower.now(), 0.0)
    same("step", ask("/live/clock", "step 41.5"), "[ok] 41 500000000 paused 1.0")
    check("stock has the time of the step", until("the step", lambda: follower.now() == 41.5))
    follower.say("sleep")
    same("half a step", ask("/live/clock", "step 0.5"), "[ok] 42 0 paused 1.0")
    same("the rest", ask("/live/clock", "step 0.5"), "[ok] 42 500000000 paused 1.0")
    same("stock sleeps a second of the clock", follower.line(), "slept")
    ask("/live/clock", "rate 100")
    ask("/live/clock", "resume")
    check("stock goes on with the clock", until("the clock", lambda: follower.now() > 50.0))
    ask("/live/clock", "pause")
    until("the pause", lambda: follower.now() == follower.now())
    standing = follower.now()
    same("and stands still with it", follower.now(), standing)
    follower.process.kill()
    clock.end()


def ours_follows_stock():
    clock = Program(*STOCK, "clock", "--name", "/live/stock_clock", "--period", "10")
    until("stock's clock", lambda: "/live/stock_clock" in names())
    with subprocess.Popen([*OURS, "time"], env=dict(os.environ, YARP_CLOCK="/live/stock_clock"), text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as program:
        times = []
        for line in program.stdout:
            if line[0].isdigit():
                times.append(float(line))
            if len(times) == 10:
                break
        check("ours has the time of stock's clock", 0.0 < times[0] and times[-1] < 1e6, times)
        check("it advances", times == sorted(times) and times[-1] > times[0], times)
        check("the port has stock's name", f"/{program.pid}/clock:i" in names())
        program.terminate()
        program.stdout.read()
    same("ours ends", program.returncode, 0)
    check("its name is not left", f"/{program.pid}/clock:i" not in names())
    clock.end()


stock_follows_ours()
ours_follows_stock()
leave()
