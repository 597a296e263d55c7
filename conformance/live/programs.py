"""Programs that suites start and talk with."""

import queue
import re
import signal
import subprocess
import threading

from asking import PATIENCE
from tied import TIED

# Lines of the log, which programs print among what they are asked for.
LOG = re.compile(r"\[(TRACE|DEBUG|INFO|WARNING|ERROR)\]")


class Program:
    """A program whose lines are read as they come. It ends with the suite, or the thread, that started it."""

    # The numbers of all processes.
    started = set()

    def __init__(self, *command):
        self.process = subprocess.Popen(
            [*TIED, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1)
        self.started.add(self.process.pid)
        self.lines = queue.Queue()
        threading.Thread(target=self.follow, daemon=True).start()

    def follow(self):
        for line in self.process.stdout:
            if (taken := self.taken(line.rstrip("\r\n"))) is not None:
                self.lines.put(taken)

    def taken(self, line):
        """What of a line is of interest, or None."""
        return None if LOG.match(line) else line

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def next(self, patience=PATIENCE):
        """The next line, or None."""
        try:
            return self.lines.get(timeout=patience)
        except queue.Empty:
            return None

    def kill(self):
        self.process.kill()
        self.process.wait()

    def finish(self):
        """Ends its input, and waits for it to end."""
        self.process.stdin.close()
        self.process.wait(PATIENCE)

    def end(self):
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.kill()
