"""Who is heard of several writers over `recv.priority`: the same at a reader of ours as at one of stock's.

    with_stock python priority.py OUR_YARP STOCK_YARP

Needs a name server. Writers of stock and of ours say the same at the same times to a `yarp read` of
stock and to one of ours, and what these print is compared with what stock's prints of stock's
writers. Times lie apart from what they decide by more than a busy machine is late; a case whose
messages were late all the same is played again. Prints `ok` or `FAIL` per case and ends with 1 if
any failed.
"""

import sys
import time

import yarp
from asking import ask, until
from checks import leave, same
from programs import Program

# Seconds that a message may be late, and how often a case is played until none is.
LATE, TRIES = 0.3, 5
# Seconds between messages at least: those of ours come from several programs, whose order has to be known.
APART = 0.06

# For each case: what writers ask for; who says something when, with the seconds since the first; and
# what stock prints, so that it is known that the case decides something. `cut` ends a connection,
# `set` changes parameters.
CASES = {
    "the higher one is heard while it is active, and then the other": (
        {"low": "+bs.5", "high": "+bs.20"},
        [(0, "low"), (0.2, "high"), (0.4, "low"), (0.7, "low"), (1, "high"),
         (1.6, "low"), (2.4, "low"), (2.5, "high"), (2.7, "low")],
        [0, 1, 4, 6, 7],
    ),
    "an active one lasts as long as it says": (
        {"low": "+bs.5+tc.9", "high": "+bs.20+tc.2"},
        [(0, "high"), (0.1, "low"), (1.5, "low"), (2.4, "low"), (2.5, "high"), (3, "low")],
        [0, 3, 4],
    ),
    "one that rests lets others through": (
        {"low": "+bs.5+tc.5", "high": "+bs.20+tc.1+tr.1"},
        [(0, "high"), (0.2, "low"), (0.5, "high"), (1.4, "high"), (1.5, "low"), (2.5, "high"), (2.7, "low"), (3, "high")],
        [0, 2, 4, 5, 7],
    ),
    "one that needs several messages": (
        {"weak": "+bs.20+st.4+tc.2", "low": "+bs.5+tc.9"},
        [(0, "low"), (0.1, "weak"), (0.2, "weak"), (0.3, "low"), (0.4, "weak"),
         (0.5, "weak"), (0.6, "low"), (3, "low"), (3.1, "weak")],
        [0, 3, 4, 5, 7],
    ),
    "a virtual one chooses between two": (
        {"ball": "+bs.0+tc.9", "line": "+bs.10+tc.9", "chooser": "+tc.1+virtual+(ex (line -10) (ball 10))"},
        [(0, "ball"), (0.1, "line"), (0.2, "chooser"), (0.3, "ball"), (0.4, "line"), (1.6, "ball"), (1.7, "line")],
        [1, 3, 6],
    ),
    "an active one helps another": (
        {"weak": "+bs.2+tc.9", "middle": "+bs.12+tc.9", "helper": "+bs.1+tc.1+(ex (weak 300))"},
        [(0, "weak"), (0.1, "middle"), (0.2, "weak"), (0.3, "helper"), (0.4, "weak"),
         (0.5, "middle"), (1.7, "weak"), (1.8, "middle")],
        [0, 1, 4, 7],
    ),
    "weights that contradict each other silence all": (
        {"one": "+tc.1+(ex (two 10))", "two": "+tc.1+(ex (one 10))"},
        [(0, "one"), (0.1, "two"), (0.2, "one"), (1.5, "two")],
        [0, 3],
    ),
    "nobody without a priority is heard": (
        {"none": "+bs.0", "less": "+bs.-10+tc.9", "some": "+bs.1"},
        [(0, "none"), (0.1, "less"), (0.2, "some"), (0.3, "less")],
        [2],
    ),
    "one that lasts no time is heard and forgotten": (
        {"low": "+bs.5+tc.9", "high": "+bs.20+tc.0"},
        [(0, "low"), (0.1, "high"), (0.2, "low"), (0.3, "high")],
        [0, 1, 2, 3],
    ),
    "one that does not ask for it is always heard": (
        {"high": "+bs.20+tc.9", "low": "+bs.5+tc.9", "plain": None},
        [(0, "plain"), (0.1, "high"), (0.2, "plain"), (0.3, "low")],
        [0, 1, 2],
    ),
    "the other is heard once the higher one is gone": (
        {"high": "+bs.20+tc.9", "low": "+bs.5+tc.9"},
        [(0, "high"), (0.1, "low"), (0.2, "cut", "high"), (0.7, "low")],
        [0, 3],
    ),
    "parameters are changed": (
        {"high": "+bs.20+tc.9", "low": "+bs.5+tc.9"},
        [(0, "high"), (0.1, "low"), (0.2, "set", "low", "(bs 3)"), (0.6, "low"), (0.7, "high"), (0.8, "set", "low", "(virtual 1)"),
         (1.2, "low"), (1.3, "high"), (1.4, "set", "high", "(tc 0.3)"), (1.8, "high"), (1.9, "set", "low", "(virtual 0) (bs 0.1)"),
         (2.6, "low"), (2.7, "set", "low", "(ex (high -300))"), (3.1, "high"), (3.2, "low")],
        [0, 3, 7, 9, 11, 14],
    ),
}


class Stock:
    """A writer of stock's."""

    def __init__(self, name):
        self.port = yarp.Port()
        assert self.port.open(name)

    def say(self, line):
        self.port.write(yarp.Bottle(line))

    def end(self):
        self.port.close()


class Group:
    """A reader and its writers."""

    def __init__(self, sides, reader, writers):
        self.of = f"{writers} to {reader}"
        self.name = f"/priority/{reader}/{writers}"
        self.program = Program(*sides[reader], "read", self.name)
        until(self.name, lambda: yarp.Network.exists(self.name))
        self.make = Stock if writers == "stock" else lambda name: Program(*sides[writers], "write", name)
        self.ends = self.make(f"{self.name}/end")
        self.connect("end", "tcp")

    def connect(self, who, carrier):
        source = f"{self.name}/{who}"
        until(source, lambda: yarp.Network.exists(source))
        until(f"{source} over {carrier}", lambda: yarp.Network.connect(source, self.name, carrier, True))
        until(f"{source} at its reader", lambda: source in self.inputs())
        # Stock lists it before its modifier is there.
        if "recv" in carrier:
            until("its modifier", lambda: ask(self.name, f"[get] [in] {source}") != "()")

    def inputs(self):
        return ask(self.name, "[list] [in]").replace('"', "").split()

    def begin(self, carrier, wishes):
        self.writers = {who: self.make(f"{self.name}/{who}") for who in wishes}
        for who, wish in wishes.items():
            self.connect(who, carrier if wish is None else f"{carrier}+recv.priority{self.named(wish)}")

    def named(self, wish):
        """With the whole names of writers."""
        for who in self.writers:
            wish = wish.replace(f"({who} ", f"({self.name}/{who} ")
        return wish

    def do(self, number, what, *words):
        if what == "cut":
            yarp.Network.disconnect(f"{self.name}/{words[0]}", self.name, True)
        elif what == "set":
            ask(self.name, f"[set] [in] {self.name}/{words[0]} {self.named(words[1])}")
        else:
            self.writers[what].say(f"{what} {number}")

    def heard(self):
        """What was printed since the last time."""
        self.ends.say("the end")
        lines = []
        while (line := self.program.next()) != "the end":
            if line is None:
                raise SystemExit(f"FAIL {self.of} does not hear the end")
            lines.append(line)
        return lines

    def finish(self):
        for who, writer in self.writers.items():
            yarp.Network.disconnect(f"{self.name}/{who}", self.name, True)
            writer.end()
        for who in self.writers:
            until("the end of a connection", lambda: f"{self.name}/{who}" not in self.inputs())


def play(groups, carrier, wishes, steps):
    """What each group hears, and whether everything was said in time."""
    for group in groups:
        group.begin(carrier, wishes)
    late = 0.0
    began = time.monotonic()
    for number, (at, *what) in enumerate(steps):
        time.sleep(max(APART, began + at - time.monotonic()))
        for group in groups:
            group.do(number, *what)
        # Whatever else is done has time until the next message.
        if len(what) == 1:
            late = max(late, time.monotonic() - began - at)
    time.sleep(LATE)
    heard = [group.heard() for group in groups]
    for group in groups:
        group.finish()
    return heard, late < LATE


def main():
    sides = {"stock": sys.argv[2].split(), "ours": [sys.argv[1]]}
    yarp.Network.init()
    groups = [Group(sides, reader, writers) for reader in sides for writers in sides]
    for case, (wishes, steps, numbers) in CASES.items():
        for carrier in ("tcp", "fast_tcp"):
            for _ in range(TRIES):
                heard, in_time = play(groups, carrier, wishes, steps)
                if in_time:
                    break
            else:
                raise SystemExit(f"FAIL {case}: this machine is too busy to say anything in time")
            same(f"{carrier}, stock: {case}", heard[0], [f"{steps[number][1]} {number}" for number in numbers])
            for group, lines in list(zip(groups, heard, strict=True))[1:]:
                same(f"{carrier}, {group.of}: {case}", lines, heard[0])
    for group in groups:
        group.program.kill()
    leave()


main()
