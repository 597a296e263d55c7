"""A laboratory in one program: any number of names, as ports that answer administration.

Each port is a listener of its own that speaks text_ack, describes itself, and answers `[list]` and `[prop] [get]`,
with counters that grow. What a name server shows of a large network is tested against it.
"""

import asyncio
import random
import threading
import time

CARRIERS = "tcp fast_tcp text text_ack udp mcast"


class Port:
    """A name with its program and its connections."""

    def __init__(self, name, program, pid, type_name=""):
        self.name, self.program, self.pid, self.type_name = name, program, pid, type_name
        self.inputs, self.outputs = [], []
        self.number = 0
        self.began = time.monotonic()

    def answer(self, request):
        """The answer to one administrative request, as text."""
        if "counters" in request:
            groups = [self._group("in", "from", *link) for link in self.inputs]
            groups += [self._group("out", "to", *link) for link in self.outputs]
            return "(port (waiting 0)) " + " ".join(groups)
        if request.startswith("[prop] [get]"):
            return (
                f'(process ((arguments "--name {self.name}") (name "/opt/lab/bin/{self.program}")'
                f" (pid {self.pid}))) (platform ((hostname lab-{self.pid % 4}) (os Linux)))"
            )
        return ""

    def _group(self, kind, key, peer, carrier, speed, size):
        count = int((time.monotonic() - self.began) * speed)
        return (
            f'({kind} ({key} "{peer}") (carrier {carrier}) (messages {count})'
            f" (bytes {count * size}) (dropped 0) (age {0.004 + 0.3 / (speed + 1):.3f}))"
        )


class Lab:
    """Ports that are registered and answer until the `with` block ends."""

    def __init__(self, server):
        self.server = server
        self.ports = {}

    def port(self, name, program="program", pid=1, type_name=""):
        """Adds a port, before the block begins."""
        return self.ports.setdefault(name, Port(name, program, pid, type_name))

    def connect(self, source, reader, carrier="tcp", speed=0.0, size=64):
        """Adds a connection, before the block begins."""
        self.ports[source].outputs.append((reader, carrier, speed, size))
        if reader in self.ports:
            self.ports[reader].inputs.append((source, carrier, speed, size))

    def __enter__(self):
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self.thread.start()
        asyncio.run_coroutine_threadsafe(self._open(), self.loop).result()
        return self

    def __exit__(self, *_):
        asyncio.run_coroutine_threadsafe(self._close(), self.loop).result()
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join()
        self.loop.close()

    async def _close(self):
        for listener in self.listeners:
            listener.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    async def _open(self):
        self.listeners = []
        for port in self.ports.values():
            serve = lambda reader, writer, port=port: self._serve(port, reader, writer)
            listener = await asyncio.start_server(serve, "127.0.0.1", 0)
            port.number = listener.sockets[0].getsockname()[1]
            self.listeners.append(listener)
        lines = []
        for port in self.ports.values():
            lines.append(f"register {port.name} tcp 127.0.0.1 {port.number}")
            lines.append(f"set {port.name} accepts {CARRIERS}")
            if port.type_name:
                lines.append(f"set {port.name} type {port.type_name}")
        await self.tell(lines)

    async def tell(self, lines):
        """Sends requests to the name server, one after the other over one connection."""
        reader, writer = await asyncio.open_connection(*self.server)
        writer.write(b"CONNECT /lab\r\n")
        await reader.readline()
        for line in lines:
            writer.write(b"d\r\n" + line.encode() + b"\r\n")
            while not (await reader.readline()).startswith(b"***"):
                pass
        writer.close()

    async def _serve(self, port, reader, writer):
        try:
            if not (await reader.readline()).startswith(b"CONNACK "):
                return
            writer.write(f"Welcome {port.name}\r\n".encode())
            while (line := (await reader.readline()).strip()) in (b"a", b"*"):
                if line == b"*":
                    answer = f"This is {port.name} at tcp://127.0.0.1:{port.number}/"
                else:
                    answer = port.answer((await reader.readline()).decode().strip())
                writer.write(f"{answer}\r\n<ACK>\r\n".encode())
                await writer.drain()
        except (ConnectionError, asyncio.CancelledError):
            pass  # The other side or the lab has ended it.
        finally:
            writer.close()


def laboratory(lab, names):
    """Fills a lab: robots with cameras, arms and the programs that use them; then idle names."""
    chance = random.Random(7)
    pid = 4000
    robot = 0
    while len(lab.ports) + 40 < names and robot < 12:
        robot += 1
        body = f"/robot{robot}"
        pid += 10
        for part in ("head", "left_arm", "right_arm", "torso"):
            lab.port(f"{body}/{part}/state:o", "robotInterface", pid, "yarp/vector")
            lab.port(f"{body}/{part}/command:i", "robotInterface", pid, "yarp/vector")
            lab.port(f"{body}/{part}/rpc:i", "robotInterface", pid)
        for side in ("left", "right"):
            lab.port(f"{body}/cam/{side}:o", "grabber", pid + 1, "yarp/image")
            lab.port(f"{body}/tracker/{side}:i", "tracker", pid + 2, "yarp/image")
            lab.connect(f"{body}/cam/{side}:o", f"{body}/tracker/{side}:i", "mjpeg", 30.0, 40_000)
            lab.port(f"{body}/view/{side}", "viewer", pid + (3 if side == "left" else 4), "yarp/image")
            lab.connect(f"{body}/cam/{side}:o", f"{body}/view/{side}", "udp", 30.0, 230_400)
        lab.port(f"{body}/tracker/target:o", "tracker", pid + 2, "yarp/vector")
        for name in ("target:i", "head:i", "head:o"):
            lab.port(f"{body}/gaze/{name}", "gazeControl", pid + 5, "yarp/vector")
        lab.connect(f"{body}/tracker/target:o", f"{body}/gaze/target:i", "tcp", 30.0, 64)
        lab.connect(f"{body}/head/state:o", f"{body}/gaze/head:i", "udp", 100.0, 56)
        lab.connect(f"{body}/gaze/head:o", f"{body}/head/command:i", "fast_tcp", 100.0, 56)
        for side in ("left", "right"):
            for name in ("state:i", "command:o", "rpc:o"):
                lab.port(f"{body}/reach/{side}/{name}", "reach", pid + 6, "yarp/vector")
            lab.connect(f"{body}/{side}_arm/state:o", f"{body}/reach/{side}/state:i", "udp", 100.0, 160)
            lab.connect(f"{body}/reach/{side}/command:o", f"{body}/{side}_arm/command:i", "fast_tcp", 100.0, 160)
            lab.connect(f"{body}/reach/{side}/rpc:o", f"{body}/{side}_arm/rpc:i", "tcp", 0.0)
    for index in range(names - len(lab.ports)):
        room = chance.choice(["sensor", "log", "skin", "audio", "base"])
        lab.port(f"/{room}/{index:04}/data:o", f"{room}Server", 9000 + index // 8)
