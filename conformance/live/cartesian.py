"""Types a conversation with a controller of a tool with stock YARP's own `yarp rpc`, and prints `ok` or `FAIL` per line.

    yarp up --cartesian &
    conformance/stock/with_stock "$STOCK/bin/python" conformance/live/cartesian.py /cartController/wam

The tool is left elsewhere. Ends with 1 if any line was answered otherwise.
"""

import re
import subprocess
import sys
import time

from checks import check, verdict
from tied import TIED

INFO = (
    r'\[ack\] \(\(server_version "2.0"\) \(arm_version "1.0"\) \(arm_type wam7\) '
    r'\(events \(motion-onset motion-done motion-ongoing closing "?\*"?\)\)\)'
)
NUMBER = r"-?[0-9.e-]+"
SEVEN = " ".join([NUMBER] * 7)
# What is typed, and what the answer looks like.
CONVERSATION = [
    ("[get] [info]", INFO),
    ("[get] [ison]", r"\[ack\] \[true\]"),
    ("[set] [dof] (1 1 2 2 1 1 1)", r"\[ack\] \(1 1 1 1 1 1 1\)"),
    ("[set] [time] 1.5", r"\[ack\]"),
    ("[get] [time]", r"\[ack\] 1.5"),
    ("[stor]", r"\[ack\] [0-9]+"),
    ("[ask] ([xd] (0.4 0.1 0.4)) ([pose] [xyz])", rf"\[ack\] \(\[?x\]? \({SEVEN}\)\) \(\[?q\]? \({SEVEN}\)\)"),
    ("[go] [xyz] 200.0 (0.4 0.1 0.4)", r"\[ack\]"),
    ("[get] [done]", r"\[ack\] \[fals\]"),
    ("[stop]", r"\[ack\]"),
    ("[get] [done]", r"\[ack\] \[true\]"),
    ("[go] [xyz] 200.0 (0.4 0.1)", r"\[nack\]"),
    ("[get] [done]", r"\[ack\] \[true\]"),
    ("[get] [pose] 3", rf"\[ack\] \({SEVEN}\) \([0-9]+ {NUMBER}\)"),
    ("[rest] 0", r"\[ack\]"),
    ("[go] [xyz] 0.5 (0.4 0.1 0.4)", r"\[ack\]"),
]
PATIENCE = 60


def ask(server, lines):
    """The answers of `yarp rpc` to these lines."""
    typed = "".join(f"{line}\n" for line in lines)
    done = subprocess.run(
        ["yarp", "rpc", f"{server}/rpc:i"], input=typed, capture_output=True, text=True, timeout=PATIENCE
    )
    return [line.removeprefix("Response: ").strip() for line in done.stdout.splitlines() if line.startswith("Response:")]


def main():
    server = sys.argv[1]
    answers = ask(server, [line for line, _ in CONVERSATION])
    check("each line has an answer", len(answers) == len(CONVERSATION), len(answers))
    for (line, expected), answer in zip(CONVERSATION, answers):
        check(line, re.fullmatch(expected, answer), answer)
    deadline = time.monotonic() + PATIENCE
    while ask(server, ["[get] [done]"]) != ["[ack] [true]"] and time.monotonic() < deadline:
        time.sleep(0.2)
    reader = subprocess.Popen([*TIED, "yarp", "read", "...", f"{server}/state:o"], stdout=subprocess.PIPE, text=True)
    try:
        # Its log stands in between.
        line = next((line for line in reader.stdout if not line.startswith("[")), "")
        pose = [float(word) for word in line.split()]
    finally:
        reader.kill()
    there = len(pose) == 7 and all(abs(now - goal) < 0.011 for now, goal in zip(pose, [0.4, 0.1, 0.4]))
    check("`yarp read` shows the tool there", there, pose)
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
