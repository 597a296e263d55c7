"""Pictures between image ports of stock and of ours.

    with_stock python mjpeg.py OUR_YARP

A writer of each side shows the same images: the pictures that a viewer gets must be the same, byte for
byte. Then readers of each side, connected over `mjpeg` by either side's `yarp connect`, read images of
each writer, and ends are killed and come back. What two readers expand may differ by a level or two, as
they round. Prints `ok` or `FAIL` per check and ends with 1 if any failed. Needs a name server, and
stock's bindings.
"""

import os
import random
import socket
import subprocess
import sys

import yarp
from asking import PATIENCE, ask, eventually, until
from checks import check, leave
from programs import Program

WIDTH, HEIGHT = 48, 32
REQUEST = b"GET /?action=stream HTTP/1.1\r\nHost: localhost\r\n\r\n"


def outputs(port):
    return len(ask(port, "[list] [out]").split())


def disconnect(writer, reader):
    """Ends a connection at the reader, which made it: stock's own `yarp disconnect` does not find such."""
    ask(reader.name, f"[del] {writer.name}")
    return eventually(lambda: writer.name not in ask(reader.name, "[list] [in]"))


def settle(writer):
    """Waits until nobody is connected any more: a writer may notice it when it writes."""
    until(f"the end of all connections of {writer.name}", lambda: writer.show(image("rgb", 3, 0)) or outputs(writer.name) == 0)


class StockWriter:
    """A port of stock's."""

    def __init__(self, name):
        self.name = name
        self.port = yarp.Port()
        self.port.open(name)

    def show(self, text, stamp=None):
        if stamp is not None:
            self.port.setEnvelope(yarp.Stamp(stamp, 1.5))
        image = yarp.ImageRgb() if "[rgb]" in text else yarp.ImageMono()
        yarp.Portable.copyPortable(yarp.Bottle(text), image)
        self.port.write(image)


class OurWriter(Program):
    """`yarp write` of ours."""

    def __init__(self, name, ours):
        super().__init__(ours, "write", name)
        self.name = name
        until(name, lambda: yarp.Network.exists(name))

    def show(self, text):
        self.say(text)


class StockReader:
    """A port of stock's."""

    def __init__(self, name):
        self.name = name
        self.port = yarp.BufferedPortBottle()
        self.port.setStrict()
        self.port.open(name)

    def next(self):
        """The next image, and its envelope."""
        got = []
        eventually(lambda: got.append(self.port.read(False)) or got[-1] is not None)
        stamp = yarp.Stamp()
        self.port.getEnvelope(stamp)
        return got[-1] and got[-1].toString(), stamp.getCount()


class OurReader(Program):
    """`yarp read` of ours."""

    def __init__(self, name, ours):
        super().__init__(ours, "read", name, "envelope")
        self.name = name
        until(name, lambda: yarp.Network.exists(name))

    def next(self):
        """The next image, and its envelope."""
        envelope, text = super().next(), super().next()
        return text, int((envelope or "0").split()[0] or 0)


def image(code, depth, seed):
    """Slopes with a little noise."""
    grain = random.Random(seed)
    numbers = [
        3 * x + 2 * y + 20 * channel + grain.randrange(8)
        for y in range(HEIGHT) for x in range(WIDTH) for channel in range(depth)
    ]
    pixels = " ".join(map(str, numbers))
    return f"[mat] [{code}] ({depth} {len(numbers)} 8 {WIDTH} {HEIGHT}) {{{pixels}}}"


def pixels(text):
    """The code, width and height of an image, and the bytes of its pixels."""
    if text is None:
        return None
    head, numbers = text.rstrip("} ").split("{")
    words = head.replace("(", " ").replace(")", " ").split()
    return words[1], words[-2:], [int(number) for number in numbers.split()]


def alike(got, expected, mean):
    """Whether two images differ by so much on average at the most."""
    if got is None or got[1] != expected[1] or len(got[2]) != len(expected[2]):
        return False
    return sum(abs(a - b) for a, b in zip(got[2], expected[2])) <= mean * len(expected[2])


class Viewer:
    """A browser or VLC."""

    def __init__(self, name):
        place = yarp.Network.queryName(name)
        before = outputs(name)
        self.socket = socket.create_connection((place.getHost(), place.getPort()), PATIENCE)
        self.socket.sendall(REQUEST)
        self.file = self.socket.makefile("rb")
        until(f"the viewer of {name}", lambda: outputs(name) > before)

    def picture(self):
        """The next picture; nothing if none comes."""
        length = 0
        while True:
            line = self.file.readline()
            if line == b"":
                return b""
            if line.lower().startswith(b"content-length:"):
                length = int(line.split(b":")[1])
            if line in (b"\r\n", b"\n") and length > 0:
                return self.file.read(length)

    def close(self):
        self.file.close()
        self.socket.close()


def main():
    ours = sys.argv[1]
    yarp.Network.init()
    writers = {"stock": StockWriter("/mjpeg/stock/w"), "ours": OurWriter("/mjpeg/ours/w", ours)}
    readers = {"stock": StockReader("/mjpeg/stock/r"), "ours": OurReader("/mjpeg/ours/r", ours)}

    viewers = {side: Viewer(writer.name) for side, writer in writers.items()}
    for code, depth in [("rgb", 3), ("mono", 1), ("rgb", 3)]:
        text = image(code, depth, depth)
        for writer in writers.values():
            writer.show(text)
        seen = {side: viewer.picture() for side, viewer in viewers.items()}
        found = f"{len(seen['ours'])} and {len(seen['stock'])} bytes"
        check(f"a viewer gets the same picture of both, {code}", seen["ours"][:2] == b"\xff\xd8" and seen["ours"] == seen["stock"], found)
    for viewer in viewers.values():
        viewer.close()
    for writer in writers.values():
        settle(writer)

    commands = {"stock": None, "ours": ours}
    number = 0
    for tool, command in commands.items():
        for write_side, writer in writers.items():
            for read_side, reader in readers.items():
                what = f"{write_side} to {read_side}, connected by {tool}"
                if command is None:
                    connected = yarp.Network.connect(writer.name, reader.name, "mjpeg")
                else:
                    connected = subprocess.run([command, "connect", writer.name, reader.name, "mjpeg"], timeout=PATIENCE,
                                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0
                check(f"{what}: connected", connected)
                until("the connection", lambda: writer.name in ask(reader.name, "[list] [in]") and outputs(writer.name) > 0)
                text = image("rgb", 3, number)
                number += 1
                writer.show(text, number) if write_side == "stock" else writer.show(text)
                got, envelope = reader.next()
                check(f"{what}: the image is about what was written", alike(pixels(got), pixels(text), 6), got and got[:60])
                if write_side == "stock":
                    check(f"{what}: and its envelope", envelope == number, envelope)
                check(f"{what}: disconnected", disconnect(writer, reader))
                settle(writer)

    # Two readers of one picture round about alike.
    for write_side, writer in writers.items():
        for reader in readers.values():
            yarp.Network.connect(writer.name, reader.name, "mjpeg")
        until("two connections", lambda: outputs(writer.name) >= 2)
        writer.show(image("rgb", 3, 99))
        got = {side: pixels(reader.next()[0]) for side, reader in readers.items()}
        check(f"both read of {write_side} the same image", got["stock"] and alike(got["ours"], got["stock"], 2))
        for reader in readers.values():
            disconnect(writer, reader)
        settle(writer)

    # Ends that are killed come back.
    stock_writer, our_writer = writers["stock"], writers["ours"]
    yarp.Network.connect(stock_writer.name, readers["ours"].name, "mjpeg")
    until("a connection", lambda: outputs(stock_writer.name) > 0)
    readers["ours"].kill()
    gone = eventually(lambda: stock_writer.show(image("rgb", 3, 1)) or outputs(stock_writer.name) == 0)
    check("stock outlives our reader", gone)
    readers["ours"] = OurReader("/mjpeg/ours/r", ours)
    check("our reader comes back", yarp.Network.connect(stock_writer.name, readers["ours"].name, "mjpeg"))
    until("a connection", lambda: outputs(stock_writer.name) > 0)
    stock_writer.show(image("rgb", 3, 2))
    check("and reads again", alike(pixels(readers["ours"].next()[0]), pixels(image("rgb", 3, 2)), 6))

    for side, reader in readers.items():
        disconnect(stock_writer, reader)
        yarp.Network.connect(our_writer.name, reader.name, "mjpeg")
        until("a connection", lambda: our_writer.name in ask(reader.name, "[list] [in]"))
    our_writer.kill()
    for side, reader in readers.items():
        gone = eventually(lambda: our_writer.name not in ask(reader.name, "[list] [in]"))
        check(f"{side} notices that our writer was killed", gone)
    our_writer = OurWriter("/mjpeg/ours/w", ours)
    for side, reader in readers.items():
        check(f"our writer comes back to {side}", yarp.Network.connect(our_writer.name, reader.name, "mjpeg"))
    until("two connections", lambda: outputs(our_writer.name) == 2)
    our_writer.show(image("rgb", 3, 3))
    for side, reader in readers.items():
        check(f"and {side} reads again", alike(pixels(reader.next()[0]), pixels(image("rgb", 3, 3)), 6))
    leave()


try:
    main()
except SystemExit as gave_up:
    print(gave_up, flush=True)
    os._exit(1)
