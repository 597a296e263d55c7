"""Stock's logger shows programs of ours, and the output of commands that `yarp run` of ours starts.

    with_stock python log_forwarding.py OUR_YARP LOGGER

Needs a name server. LOGGER is `logger_peer.cpp`: the engine of stock's yarplogger. Prints `ok` or `FAIL` per check; ends with 1
if any failed.
"""

import os
import subprocess
import sys
import time

from checks import check, leave
from tied import TIED

OURS, LOGGER = sys.argv[1:]
PATIENCE = 30


class Logger:
    """Stock's logger."""

    def __init__(self):
        self.process = subprocess.Popen([LOGGER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.until("started")

    def until(self, last):
        lines = []
        for line in self.process.stdout:
            if line.strip() == last:
                return lines
            lines.append(line.strip())
        raise SystemExit("FAIL the logger ended")

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return [found.split("|", 3) for found in self.until("end") if found.startswith(("entry|", "program|"))]

    def sees(self, condition, line="show"):
        """What the logger has as soon as an entry or a program fulfils the condition, else everything at the end."""
        end = time.monotonic() + PATIENCE
        while True:
            found = self.ask(line)
            if any(condition(each) for each in found) or time.monotonic() > end:
                return found
            time.sleep(0.1)


def ours(*words, **variables):
    return subprocess.Popen([*TIED, OURS, *words], env=dict(os.environ, **variables), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def entry(level, text):
    return lambda found: found[0] == "entry" and found[1] == f"<{level}>" and text in found[3]


def has(found, condition):
    return any(condition(each) for each in found)


camera = ours("dev", "--device", "fakeFrameGrabber", "--name", "/camera", YARP_FORWARD_LOG_ENABLE="1")
early = ours("dev", "--device", "no_such_device", YARP_FORWARD_LOG_ENABLE="1")
early.wait(PATIENCE)
logger = Logger()
program = lambda found: found[0] == "program" and found[1] == "yarp" and found[2].endswith(f"/{camera.pid}")
check("a program that runs already is found", has(found := logger.sees(program, "discover"), program), found)
camera.terminate()
check("it ends while it is logged", camera.wait(PATIENCE) == 0)

failing = ours("dev", "--device", "no_such_device", YARP_FORWARD_LOG_ENABLE="1")
condition = entry("ERROR", "no_such_device")
check("an error of a program of ours is an error", has(found := logger.sees(condition), condition), found)
# The last line of a program has neither text nor component, as with stock's.
check("and has a component", all(each[2] for each in found if each[0] == "entry" and each[3]), found)
failing.wait(PATIENCE)

server = ours("run", "--server", "/commands", "--insecure", "--log")
end = time.monotonic() + PATIENCE
while subprocess.run([OURS, "exists", "/commands"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode and time.monotonic() < end:
    time.sleep(0.1)
shell = 'sh -c "echo plain; echo [WARNING] careful >&2; sleep 2"'
subprocess.run([OURS, "run", "--on", "/commands", "--as", "shell", "--cmd", shell], timeout=PATIENCE, stderr=subprocess.DEVNULL)
for condition, what in (entry("UNDEFINED", "plain"), "output"), (entry("WARNING", "careful"), "a warning of a foreign program"):
    check(f"{what} of a command is shown", has(found := logger.sees(condition), condition), found)
command = f"{OURS} dev --device no_such_device_either"
subprocess.run([OURS, "run", "--on", "/commands", "--as", "ours", "--cmd", command], timeout=PATIENCE, stderr=subprocess.DEVNULL)
condition = entry("ERROR", "no_such_device_either")
check("a program of ours below yarp run has levels", has(found := logger.sees(condition), condition), found)
subprocess.run([OURS, "run", "--on", "/commands", "--exit"], timeout=PATIENCE, stderr=subprocess.DEVNULL)
check("the server ends", server.wait(PATIENCE) == 0)
names = subprocess.run([OURS, "name", "list"], capture_output=True, text=True, timeout=PATIENCE).stdout
check("no name of a log is left", "/log/" not in names, names)
logger.process.stdin.close()
logger.process.wait(PATIENCE)
leave()
