"""Stock's `yarp read` hears on `async:o` how moves of an arm of ours end. Prints `ok` or `FAIL` per check.

    finished_moves.py /wam "YARP"

`YARP` is stock's command. The arm must have room to move its first joint by a few degrees; it is left elsewhere.
Every wait has a deadline.
"""

import os
import subprocess
import sys
import threading
import time

import yarp
from checks import check, verdict
from tied import TIED

# Seconds that anything may take.
PATIENCE = 60


class Reader:
    """`yarp read` of stock, with what it has printed so far."""

    def __init__(self, command, name, source):
        self.child = subprocess.Popen([*TIED, *command, "read", name, source], stdin=subprocess.DEVNULL,
                                      stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.lines = []
        self.changed = threading.Condition()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.child.stdout:
            with self.changed:
                self.lines.append(line.strip())
                self.changed.notify_all()

    def see(self, text):
        """Whether a line comes that is `text`, without the quotes that some versions put around words."""
        end = time.monotonic() + PATIENCE
        with self.changed:
            while not any(line.replace('"', "") == text for line in self.lines):
                left = end - time.monotonic()
                if left <= 0 or not self.changed.wait(left):
                    return False
        return True


def main():
    remote, command = sys.argv[1], sys.argv[2].split()
    yarp.Network.init()
    rpc = yarp.RpcClient()
    rpc.open(f"/live-{os.getpid()}/rpc:o")
    if not check("the arm can be asked", rpc.addOutput(f"{remote}/rpc:i")):
        return 1

    def ask(text):
        asked, answer = yarp.Bottle(), yarp.Bottle()
        asked.fromString(text)
        rpc.write(asked, answer)
        return answer.toString()

    name = f"/live-{os.getpid()}/reader"
    reader = Reader(command, name, f"{remote}/async:o")
    end = time.monotonic() + PATIENCE
    while not yarp.Network.isConnected(f"{remote}/async:o", name, True) and time.monotonic() < end:
        time.sleep(0.1)
    check("stock's yarp read is connected", time.monotonic() < end)

    def number(answer):
        words = answer.split()
        good = len(words) >= 3 and words[0] == "[move]"
        check("a move tells its number", good, answer)
        return words[1] if good else "none"

    ask("set icmd cmod 0 pos")
    ask("set vel 0 20.0")
    done = number(ask("numb set pos 0 2.0"))
    check("its end is heard", reader.see(f"[done] {done} (0)"), reader.lines[-3:])
    ask("set vel 0 0.01")
    first = number(ask("numb set pos 0 9.0"))
    second = number(ask("numb set pos 0 8.0"))
    check("a newer move takes its place", reader.see(f"[over] {first} (0) {second}"), reader.lines[-3:])
    check("it is under way", ask(f"numb get {second}") == f"[move] {second} (0)")
    check("a plain stop is ok", ask("set sto 0") == "[ok]")
    check("and the move stopped", reader.see(f"[stop] {second} (0)"), reader.lines[-3:])
    check("which can be asked for", ask(f"numb get {second}") == f"[stop] {second} (0)")
    ask("set vel 0 20.0")
    seen = len(reader.lines)
    check("a move without number is ok", ask("set pos 0 1.0") == "[ok]")
    end = time.monotonic() + PATIENCE
    heard = False
    while not heard and time.monotonic() < end:
        time.sleep(0.05)
        heard = any(line.replace('"', "").startswith("[done] ") for line in reader.lines[seen:])
    check("its end is heard, too", heard, reader.lines[seen:])
    check("drops can be asked for", ask("numb drop").startswith("[is] [drop] "), ask("numb drop"))
    reader.child.terminate()
    reader.child.wait(PATIENCE)
    rpc.close()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
