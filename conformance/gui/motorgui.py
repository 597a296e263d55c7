"""What a person does with `yarpmotorgui`, and what the robot makes of it.

What is shown is compared with what the board answers to `yarp rpc`, and so is what is pressed, dragged and chosen.
"""

import os
import re
import subprocess
import time

from desktop import finish, until

# Words of the window for the modes, and the modes.
MODES = {
    "Idle": "idl", "Position": "pos", "Position Direct": "posd", "Velocity": "vel", "Velocity Direct": "veld",
    "Torque": "torq", "PWM": "ipwm", "Current": "icur",
}


class Motorgui:
    def __init__(self, desktop, network, stock, check, parts):
        self.desktop, self.network, self.check, self.stock = desktop, network, check, stock
        # How long to wait for what a board does; stock's does not do everything.
        self.patience = 40 if check.counts else 4
        name = re.sub(r"\W+", "-", check.title)
        self.log = os.path.join(network.work, f"{name}.log")
        # What the window remembers from one run to the next is no business of the user's.
        self.home = os.path.join(network.work, f"home-{name}")
        os.makedirs(self.home, exist_ok=True)
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(
                [os.path.join(stock.windows, "bin/yarpmotorgui"), "--names", f"({' '.join(parts)})", "--admin"],
                env={**stock.env(), "HOME": self.home}, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        self.application = desktop.program(self.process)

    def close(self):
        finish(self.process)

    def open(self):
        self.application.one("push button", "OK")
        def begun():
            # A click that comes while the window manager still moves the dialog is lost.
            button = self.application.any("push button", "OK")
            if button is not None:
                button.click()
                time.sleep(1)
            return self.application.any("frame", "Qt Robot Motor GUI.*")
        self.window = until("the main window", begun)
        self.desktop.fill("Qt Robot Motor GUI")
        time.sleep(1)

    def complaints(self):
        """What the window called an error or warned of, without what differs between two runs."""
        found = set()
        for line in self.lines():
            if re.search(r"\[(ERROR|WARNING|FATAL)\]|QObject::|Critical|terminate", line):
                line = re.sub(r"/(lab|stock)/", "/ROBOT/", line)
                line = re.sub(r"\d+", "N", line)
                found.add(line.strip())
        return found

    def joint(self, number):
        return self.window.one("panel", rf"JOINT {number} .*")

    def joints(self):
        return sorted(part.name for part in self.window.all("panel", r"JOINT \d+ .*"))

    def shown(self, joint, label):
        """The number beside a label."""
        def read():
            beside = joint.any("label", re.escape(label))
            if beside is None:
                return None
            height = beside.place()[1]
            for field in joint.all("text"):
                if abs(field.place()[1] - height) < 12:
                    return (float(field.text),)
            return None
        return until(f"{label} of {joint.name}", read)[0]

    def button(self, joint, name):
        joint.one("push button", name).click()

    def slide(self, joint, name, *keys):
        """Moves a slider by keys, as many notches as it returns.

        Afterwards it follows what the robot does: what was asked for is to be seen at the robot.
        """
        slider = joint.one("slider", name)
        slider.focus()
        time.sleep(0.3)
        self.desktop.type(*keys)
        time.sleep(0.3)
        return sum({"Prior": 10, "Next": -10, "Right": 1, "Left": -1}[key] for key in keys)

    def notch(self, part, joint, number, name):
        """How far a notch of a slider for positions goes, degrees."""
        low, high = self.network.numbers(part, f"get llim {number}")[:2]
        lowest, highest = joint.one("slider", name).range
        return (high - low) / (highest - lowest)

    def menu(self, *words):
        self.window.one("menu item", words[0] + " ?").click()
        for word in words[1:]:
            self.application.one(name=re.escape(word)).click()
        time.sleep(0.3)

    def dialogs(self):
        return [part for part in self.application.children() if part.role in ("dialog", "alert") and part.has("SHOWING")]

    def answer_dialog(self, button, patience=20):
        """Presses a button of the dialog that comes; the words in it, none if none comes."""
        try:
            dialog = until("a dialog", lambda: next(iter(self.dialogs()), None), patience)
        except TimeoutError:
            return None
        words = " ".join(part.name for part in dialog.all("label"))
        dialog.one("push button", button).click()
        until("the dialog to go", lambda: not self.dialogs())
        return words or dialog.name

    # What is done, and seen.

    def comes_up(self, part, count):
        network = self.network
        names = until(f"{count} joints", lambda: (j := self.joints()) and len(j) == count and j)
        self.check("every joint has its place and name", [n.split(" ")[1] for n in names], [str(i) for i in range(count)])
        if part.startswith("/lab"):
            told = [re.sub(r'.*"(.*)".*|.* (\w+)$', lambda m: m[1] or m[2], network.ask(part, f"get name {i}")) for i in range(count)]
            # They come with the first states.
            self.seen("under the names that the robot tells",
                      lambda: [re.sub(r".*\((.*)\)", r"\1", name) for name in self.joints()] == told)
        def same():
            encoders = network.encoders(part)[:count]
            shown = [self.shown(self.joint(i), "Encoder:") for i in range(count)]
            return all(abs(a - b) < 0.02 for a, b in zip(encoders, shown, strict=True))
        self.seen("encoders are shown as they are", same)

    def seen(self, what, condition):
        """Checks that something comes to be so."""
        try:
            until(what, condition, self.patience)
            self.check(what, True, True)
        except (TimeoutError, ValueError, IndexError) as error:
            self.check(what, f"not within {self.patience} s ({type(error).__name__})", True)

    def at_rest(self, part, number):
        """Where a joint stands, once it does."""
        places = []

        def stands():
            places.append(self.network.encoders(part)[number])
            return len(places) > 1 and places[-1] == places[-2]

        until(f"joint {number} at rest", stands, self.patience)
        return places[-1]

    def follows(self, part):
        """The window shows what others do."""
        network = self.network
        network.ask(part, "set pos 6 12.0")
        self.seen("what another moves is shown", lambda: abs(self.shown(self.joint(6), "Encoder:") - 12.0) < 0.1)
        network.ask(part, "set icmd cmod 6 idl")
        self.seen("a mode that another sets is shown",
                  lambda: next(self.joint(6).all("combo box")).name == "Idle")
        network.ask(part, "set icmd cmod 6 pos")
        self.seen("and the next", lambda: next(self.joint(6).all("combo box")).name == "Position")

    def moves(self, part, number=0, keys=("Prior", "Right")):
        network, joint = self.network, self.joint(number)
        notch, before = self.notch(part, joint, number, "Position"), network.encoders(part)[number]
        moved = notch * self.slide(joint, "Position", *keys)
        target = lambda: network.numbers(part, f"get pos {number}")[0]
        self.seen("the slider sets a target", lambda: abs(target() - before - moved) < 1.01 * abs(notch))
        goal = target()
        self.seen("the slider moves the joint", lambda: abs(network.encoders(part)[number] - goal) < 0.1)
        self.seen("the window shows where it is", lambda: abs(self.shown(joint, "Encoder:") - goal) < 0.1)
        speed = lambda: network.numbers(part, f"get vel {number}")[0]
        before = speed()
        self.slide(joint, "Velocity", "Next")
        self.seen("the slider sets the speed", lambda: speed() < before - 1)
        # For the next window: no joint can be slower than its slowest.
        network.ask(part, f"set vel {number} {before}")

    def idles_and_runs(self, part):
        network, joint = self.network, self.joint(1)
        self.button(joint, "Idle")
        self.seen("Idle makes it idle", lambda: network.mode(part, 1) == "idl")
        self.seen("the window shows idle", lambda: next(joint.all("combo box")).name == "Idle")
        self.button(joint, "Run")
        self.seen("Run makes it take positions", lambda: network.mode(part, 1) == "pos")
        self.seen("the window shows position", lambda: next(joint.all("combo box")).name == "Position")

    def modes(self, part):
        """Every mode by the list, and what its slider does."""
        network = self.network
        later = ("Torque", "Velocity Direct") if self.stock.generation >= "4" else ()
        for word in ("Velocity", "Position Direct", "PWM", "Current", *later):
            self.menu("View", f"Enable {word} Control")
        def to(number, word):
            joint = self.joint(number)
            next(joint.all("combo box")).choose(word)
            self.seen(f"the list sets {word}", lambda: network.mode(part, number) == MODES[word])
            self.seen(f"the window shows {word}", lambda: next(joint.all("combo box")).name == word)
            return joint
        joint = to(2, "Velocity")
        before = network.encoders(part)[2]
        self.slide(joint, "Velocity", "Prior")
        self.seen("a velocity moves it", lambda: network.encoders(part)[2] > before + 1)
        if later:
            joint = to(2, "Velocity Direct")
            before = self.at_rest(part, 2)
            # Its keys do nothing in 4.0.0.
            joint.one("slider", "Velocity.*").drag(-0.2)
            self.seen("a direct velocity moves it", lambda: network.encoders(part)[2] < before - 1)
        to(2, "Position")
        joint = to(3, "Position Direct")
        before = network.encoders(part)[3]
        self.slide(joint, "Position", "Left")
        self.seen("a direct position moves it", lambda: network.encoders(part)[3] < before - 0.5)
        to(3, "Position")
        for number, word, slider, question in ((4, "Torque", "Torque", "torq"), (5, "PWM", ".*", "ipwm"),
                                               (6, "Current", ".*", "icur")):
            joint = to(number, word)
            reference = lambda: network.numbers(part, f"get {question} ref {number}")[0]
            before = reference()
            self.slide(joint, slider, "Prior")
            self.seen(f"{word}: the slider arrives", lambda: reference() > before)
            to(number, "Idle")
        joint = self.joint(0)
        interaction = list(joint.all("combo box"))[1]
        interaction.choose("Compliant Mode")
        self.seen("compliance arrives", lambda: "comp" in network.ask(part, "get intm mode 0"))
        self.seen("and is shown", lambda: interaction.name == "Compliant Mode")
        interaction.choose("Stiff Mode")
        self.seen("stiffness arrives", lambda: "stif" in network.ask(part, "get intm mode 0"))

    def gains(self, part):
        """The dialog of the control loops: shows, sends, is closed."""
        network, joint = self.network, self.joint(0)
        self.button(joint, "PID")
        dialog = self.application.one("dialog", "Pid Control.*")
        def cells():
            table = next((t for t in dialog.all("table")), None)
            return table and [c for c in table.all("table cell")]
        first = until("the table of gains", cells)
        gain = re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", network.ask(part, "get pid pid pos 0"))
        self.check("the dialog shows the gain", float(first[0].name), float(gain[0]) if gain else None)
        wanted = first[1]
        wanted.click(times=2)
        time.sleep(0.3)
        self.desktop.type("ctrl+a")
        self.desktop.text("3.5")
        self.desktop.type("Return")
        self.click_in(dialog, "Send")
        self.seen("Send sets the gain", lambda: network.numbers(part, "get pid pid pos 0")[0] == 3.5)
        self.seen("and shows it", lambda: float(cells()[0].name) == 3.5)
        tabs = [tab.name for tab in dialog.all("page tab")]
        for tab in tabs:
            next(dialog.all("page tab", re.escape(tab))).click()
            time.sleep(0.3)
        self.click_in(dialog, "Refresh")
        self.click_in(dialog, "Cancel|Exit|Close")
        self.seen("the dialog closes", lambda: not self.dialogs())

    def click_in(self, dialog, name):
        dialog.one("push button", name).click()
        time.sleep(0.3)

    def sequence(self, part):
        """Opens a sequence from a file, runs it, stops it."""
        network = self.network
        path = os.path.join(self.home, "dance.pos" + part.split("/")[-1])
        places = [[5, -90, 5, 120, 5, 5, 5], [-15, -105, -15, 100, -15, -15, -15]]
        with open(path, "w", encoding="utf-8") as file:
            file.write(f'<?xml version="1.0"?><Sequence_pos TotPositions="2" ReferencePart="{part.split("/")[-1]}">')
            for index, place in enumerate(places):
                file.write(f'\n<Position Index="{index}" Timing="3.00">\n<JointPositions Count="7">\n')
                file.write("".join(f"<PosValue>{value}</PosValue>\n" for value in place))
                file.write('</JointPositions>\n<JointVelocities Count="7">\n')
                file.write("<SpeedValue>40</SpeedValue>\n" * 7 + "</JointVelocities>\n</Position>\n")
            file.write("</Sequence_pos>\n")
        self.window.one("push button", "Run all joints of this part").click()
        self.seen("Run takes all joints", lambda: all(network.mode(part, i) == "pos" for i in range(7)))
        self.window.one("push button", "Open Sequence Tab").click()
        frame = self.application.one("frame", "Sequence Window.*")
        frame.one("push button", "Open").click()
        dialog = until("the dialog of files", lambda: next(iter(self.dialogs()), None))
        time.sleep(0.5)
        self.desktop.text(path)
        self.desktop.type("Return")
        until("the dialog of files to go", lambda: not self.dialogs())
        self.seen("the sequence is read", lambda: len([c for c in frame.all("table cell") if c.name in ("3", "3.00")]) >= 2)
        frame.one("push button", r"Run \(ignore.*").click()
        for place in places:
            self.seen(f"the arm goes to {place}", lambda: all(
                abs(a - b) < 4 for a, b in zip(network.encoders(part), place)))
        run = frame.one("push button", r"Run \(ignore.*")
        self.seen("the run ends", lambda: run.has("ENABLED"))
        def cycles():
            # While the run goes on this does nothing.
            frame.one("push button", r"Cycle \(use.*").click()
            time.sleep(1)
            return network.encoders(part)[0] > 0
        self.seen("a cycle begins again", cycles)
        frame.one("push button", "Stop").click()
        self.seen("Stop ends the cycle", lambda: run.has("ENABLED"))

    def whole(self, part):
        """The buttons for a whole part, and for all parts."""
        network = self.network
        all_in = lambda mode: all(network.mode(part, i) == mode for i in range(7))
        for button, mode in (("Idle all joints of this part", "idl"), ("Run all joints of this part", "pos"),
                             ("Idle All Parts", "idl"), ("Run All Parts", "pos")):
            self.window.one("push button", button).click()
            if button == "Idle All Parts":
                self.answer_dialog("&?Yes")
            self.seen(button, lambda: all_in(mode))

    def hand(self, part):
        """Another part with fewer joints, and without currents."""
        network = self.network
        self.window.one("page tab", "/hand").click()
        self.comes_up("/lab/hand", 4)
        joint, before = self.joint(0), network.encoders("/lab/hand")[0]
        self.slide(joint, "Position", "Prior", "Prior")
        self.seen("the slider moves a finger", lambda: network.encoders("/lab/hand")[0] > before + 5)
        self.seen("and it is shown",
                  lambda: abs(self.shown(joint, "Encoder:") - network.encoders("/lab/hand")[0]) < 0.5)
        self.window.one("page tab", part.replace("/lab", "")).click()
        until("the arm's joints", lambda: len(self.joints()) == 7)

    def outlives(self, part, end, start):
        """The board is killed under the window, and comes back."""
        network = self.network
        before = len(self.lines())
        end()
        self.seen("the window says that something is missing", lambda: any(
            re.search(r"ERROR|WARN", line) for line in self.lines()[before:]))
        start()
        time.sleep(3)
        self.check("the window is still there", self.process.poll(), None)
        network.ask(part, "set pos 6 -20.0")
        def again():
            return abs(self.shown(self.joint(6), "Encoder:") + 20) < 0.1
        try:
            until("what the board does now", again, 10)
            return True
        except TimeoutError:
            return False

    def lines(self):
        with open(self.log, errors="replace") as log:
            return re.sub(r"\x1b\[[0-9;]*m", "", log.read()).splitlines()

    def homes(self, part):
        """Home and Calib; what stock's board, which cannot, is told in a dialog."""
        network = self.network
        self.slide(self.joint(0), "Position", "Prior", "Prior")
        self.seen("the joint leaves its home", lambda: network.encoders(part)[0] > 10)
        self.button(self.joint(0), "Home")
        self.check("Home is done without a complaint", self.answer_dialog("OK", patience=4), None)
        self.seen("Home moves the joint home", lambda: abs(network.encoders(part)[0]) < 0.1)
        self.button(self.joint(0), "Calib")
        self.answer_dialog("&?Yes")
        self.check("Calib is done without a complaint", self.answer_dialog("OK", patience=6), None)
        self.seen("the joint takes positions after that", lambda: network.mode(part, 0) == "pos")
        before = network.encoders(part)[0]
        self.slide(self.joint(0), "Position", "Prior")
        self.seen("and moves", lambda: network.encoders(part)[0] > before + 5)
