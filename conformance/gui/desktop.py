"""A screen without a monitor, and the windows on it as a user sees and moves them.

What is in a window is read the way screen readers do it (AT-SPI, which Qt speaks), and so is where it is; what is
pressed, dragged and typed goes through the X server, as from a mouse and a keyboard (`xdotool`).
"""

import os
import re
import signal
import subprocess
import time
import warnings

# How long a window may take to show something, on a machine with other work.
PATIENCE = 60
WIDTH, HEIGHT = 2600, 1500

warnings.filterwarnings("ignore", category=DeprecationWarning)


def until(what, condition, patience=PATIENCE):
    """What `condition` returns, as soon as it is something; an error that says what was waited for else."""
    end = time.monotonic() + patience
    while True:
        found = condition()
        if found:
            return found
        if time.monotonic() > end:
            raise TimeoutError(f"waited {patience} s for {what}")
        time.sleep(0.1)


def finish(process, patience=20, how=signal.SIGTERM):
    """Asks a program to end, and sees to it; what it started ends with it, if it is asked."""
    process.send_signal(how)
    try:
        process.wait(patience)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class Desktop:
    """Starts a screen, a window manager and a bus for readers; ends them at `close`."""

    def __init__(self, work):
        self.work = work
        self.running = []
        try:
            self.open()
        except BaseException:
            self.close()
            raise

    def open(self):
        screen = ["-screen", "0", f"{WIDTH}x{HEIGHT}x24"]
        os.environ["DISPLAY"] = ":" + self.telling(lambda end: ["Xvfb", "-noreset", *screen, "-displayfd", end])
        session = self.telling(lambda end: ["dbus-daemon", "--session", "--nofork", f"--print-address={end}"])
        os.environ["DBUS_SESSION_BUS_ADDRESS"] = session
        os.environ["XDG_RUNTIME_DIR"] = os.path.join(self.work, "runtime")
        os.makedirs(os.environ["XDG_RUNTIME_DIR"], mode=0o700, exist_ok=True)
        self.start(["/usr/libexec/at-spi-bus-launcher", "--launch-immediately"])
        readers = until("the bus of readers", self.readers)
        # Where Qt looks first; the way over the session's bus comes too late for some programs.
        subprocess.run(["xprop", "-root", "-f", "AT_SPI_BUS", "8s", "-set", "AT_SPI_BUS", readers], check=True)
        self.start(["openbox"])
        os.environ["QT_LINUX_ACCESSIBILITY_ALWAYS_ON"] = "1"
        os.environ["AT_SPI_BUS_ADDRESS"] = readers
        import gi

        gi.require_version("Atspi", "2.0")
        from gi.repository import Atspi, GLib

        self.atspi = Atspi
        # What a question to a part that is gone ends with.
        self.gone = GLib.Error
        self.messages = GLib.MainContext.default()
        # Only this program takes the address from here: of Qt's programs some would miss it.
        Atspi.init()
        until("the registry of windows", lambda: Atspi.get_desktop(0) is not None)
        del os.environ["AT_SPI_BUS_ADDRESS"]

    def start(self, command, log="desktop.log", **options):
        with open(os.path.join(self.work, log), "ab") as out:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=out, **options)
        self.running.append(process)
        return process

    def telling(self, command):
        """Starts a command that writes a line to the descriptor it is given; the line."""
        (ready, end) = os.pipe()
        self.start(command(str(end)), pass_fds=[end])
        os.close(end)
        with os.fdopen(ready) as line:
            return line.readline().strip()

    def readers(self):
        """The address of the bus that programs with windows and those that read windows meet on."""
        question = ["dbus-send", "--session", "--print-reply=literal", "--dest=org.a11y.Bus", "/org/a11y/bus"]
        return subprocess.run([*question, "org.a11y.Bus.GetAddress"], capture_output=True, text=True).stdout.strip()

    def close(self):
        for process in reversed(self.running):
            finish(process, 5)

    def program(self, process):
        """The windows of a program that has been started."""
        def found():
            # Programs come and go in messages, which are taken here.
            while self.messages.iteration(False):
                pass
            desktop = self.atspi.get_desktop(0)
            for i in range(desktop.get_child_count()):
                child = desktop.get_child_at_index(i)
                if child is not None and child.get_process_id() == process.pid:
                    child.set_cache_mask(self.atspi.Cache.NONE)
                    return Part(self, child)
            assert process.poll() is None, "the program ended before it had a window"
            return None
        return until("the program's windows", found)

    def type(self, *keys):
        subprocess.run(["xdotool", "key", "--delay", "30", *keys], check=True)

    def text(self, text):
        subprocess.run(["xdotool", "type", "--delay", "15", text], check=True)

    def fill(self, title):
        """Makes a window as large as the screen and brings it to the front; its X number."""
        found = until(f"a window '{title}'", lambda: subprocess.run(
            ["xdotool", "search", "--onlyvisible", "--name", title], capture_output=True, text=True).stdout.split())
        window = found[-1]
        for command in (["windowmove", window, "0", "20"], ["windowsize", window, str(WIDTH - 20), str(HEIGHT - 80)],
                        ["windowactivate", window]):
            subprocess.run(["xdotool", *command], check=True)
        return window

    def picture(self, path):
        subprocess.run(["import", "-window", "root", path], check=True)


class Part:
    """A part of a window: a button, a table, a whole window."""

    def __init__(self, desktop, node):
        self.desktop = desktop
        self.node = node

    @property
    def name(self):
        return self.node.get_name() or ""

    @property
    def role(self):
        return self.node.get_role_name()

    def has(self, state):
        return self.node.get_state_set().contains(getattr(self.desktop.atspi.StateType, state))

    def children(self):
        for i in range(self.node.get_child_count()):
            child = self.node.get_child_at_index(i)
            if child is not None:
                yield Part(self.desktop, child)

    def all(self, role=None, name=None):
        """Parts of this part: those of a role, or whose whole name is of a pattern; only what is shown."""
        for child in self.children():
            try:
                if not child.has("SHOWING"):
                    continue
                if (role is None or child.role == role) and (name is None or re.fullmatch(name, child.name)):
                    yield child
                yield from child.all(role, name)
            except self.desktop.gone:
                continue

    def one(self, role=None, name=None, patience=PATIENCE):
        return until(f"a {role or 'part'} named {name!r} in '{self.name}'",
                     lambda: next(self.all(role, name), None), patience)

    def any(self, role=None, name=None):
        return next(self.all(role, name), None)

    def place(self):
        where = self.node.get_extents(self.desktop.atspi.CoordType.SCREEN)
        return where.x, where.y, where.width, where.height

    def click(self, times=1, button=1):
        x, y, width, height = self.place()
        subprocess.run(["xdotool", "mousemove", str(x + width // 2), str(y + height // 2), "click", "--repeat",
                        str(times), "--delay", "60", str(button)], check=True)

    def drag(self, part):
        """Takes a slider at its middle, where it must stand, and moves it by a part of its width."""
        x, y, width, height = self.place()
        begin, end = x + width // 2, x + int((0.5 + part) * width)
        row = str(y + height // 2)
        subprocess.run(["xdotool", "mousemove", str(begin), row, "mousedown", "1", "sleep", "0.3", "mousemove", str(end),
                        row, "sleep", "0.3", "mouseup", "1"], check=True)

    @property
    def text(self):
        return self.desktop.atspi.Text.get_text(self.node, 0, -1)

    @property
    def value(self):
        return self.desktop.atspi.Value.get_current_value(self.node)

    @property
    def range(self):
        values = self.desktop.atspi.Value
        return values.get_minimum_value(self.node), values.get_maximum_value(self.node)

    def focus(self):
        self.desktop.atspi.Component.grab_focus(self.node)

    def choose(self, item):
        """Opens a list of choices, and takes one."""
        items = [entry.name for entry in self.all("list item")]
        self.click()
        time.sleep(0.4)
        self.desktop.type("Home", *["Down"] * items.index(item), "Return")
