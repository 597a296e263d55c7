"""A YARP network with an arm, a hand and a camera of ours, and a board of stock's to compare with."""

import os
import re
import signal
import subprocess

from desktop import finish, until


class Stock:
    """Stock programs of one generation: what runs them, and where the windows are."""

    def __init__(self, generation, environment, windows):
        self.generation = generation
        self.environment = environment
        self.windows = windows

    def env(self):
        return {**os.environ, **self.environment, "YARP_FORWARD_LOG_ENABLE": "0"}


class Network:
    def __init__(self, yarp, work, port):
        self.yarp = yarp
        self.work = work
        self.running = {}
        home = os.path.join(work, "yarp")
        os.environ.update(YARP_CONFIG_HOME=home, YARP_DATA_HOME=os.path.join(home, "data"))
        os.makedirs(home)
        self.start("server", "server", "--ip", "127.0.0.1", "--socket", str(port), "--write")
        until("the name server", lambda: self.tool("where").returncode == 0)

    def tool(self, *words, text=None):
        return subprocess.run([self.yarp, *words], input=text, capture_output=True, text=True, timeout=30)

    def launch(self, name, command, env=None):
        with open(os.path.join(self.work, f"{name}.log"), "ab") as log:
            self.running[name] = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=env)
        return self.running[name]

    def start(self, name, *words):
        return self.launch(name, [self.yarp, *words])

    def exists(self, port):
        until(f"port {port}", lambda: self.tool("exists", port).returncode == 0)

    def arm(self):
        self.start("arm", "dev", "--device", "simulatedWam", "--name", "/lab/arm")
        self.exists("/lab/arm/stateExt:o")

    def hand(self):
        line = os.path.join(self.work, "line")
        self.start("hand-sim", "hand-sim", "--link", line)
        until("the line of the hand", lambda: os.path.exists(line))
        self.start("hand", "hand-board", "--serial", line, "--name", "/lab/hand")
        self.exists("/lab/hand/stateExt:o")

    def camera(self, *options):
        self.start("camera", "camera", "--name", "/lab/eye", *options)
        self.exists("/lab/eye")

    def stock_board(self, stock):
        """Stock's own simulated board with as many joints as the arm."""
        devices = ["--device", "controlBoard_nws_yarp", "--subdevice", "fakeMotionControl"]
        if stock.generation >= "4":
            devices = ["--device", "deviceBundler", "--wrapper_device", "controlBoard_nws_yarp", "--attached_device",
                       "fakeMotionControl"]
        self.launch("stock", ["yarpdev", *devices, "--name", "/stock/arm", "--period", "0.02", "--GENERAL::Joints", "7"],
                    stock.env())
        self.exists("/stock/arm/stateExt:o")

    def end(self, name, how=signal.SIGTERM):
        process = self.running.pop(name, None)
        if process is not None:
            finish(process, how=how)

    def close(self):
        for name in reversed(list(self.running)):
            self.end(name)

    def ask(self, part, request):
        """What a board answers, in words."""
        answer = self.tool("rpc", f"{part}/rpc:i", text=request + "\n")
        return answer.stdout.strip().removeprefix("Response: ").split(" [tsta]")[0]

    def numbers(self, part, request):
        return [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", self.ask(part, request))]

    def encoders(self, part):
        return self.numbers(part, "get encs")

    def mode(self, part, joint):
        return (re.findall(r"\[(\w+)\]", self.ask(part, f"get icmd cmod {joint}")) or ["?"])[-1]
