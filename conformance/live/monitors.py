"""Modifiers of carriers: what stock does with them, and what ours does.

    with_stock python monitors.py OUR_YARP [PLUGIN...]

Needs a name server. A port of stock writes to a reader of stock and to one of ours, which is
`yarp read`, over carriers with modifiers, and what they read and answer is compared, with PLUGINs
also what stock's port monitors of these names make of messages. 3.5.0 has those of depths;
`bottle_compression_zlib` came with 4.0.0, and YARP_DATA_DIRS has to lead to one that was built
from there. Prints `ok` or `FAIL` per comparison and
ends with 1 if any failed. Checked with stock 3.5.0.
"""

import random
import struct
import sys

import yarp
from asking import ask, until
from checks import same, verdict
from programs import Program


class Stock:
    """A reader of stock's."""

    name = "/monitors/stock/r"

    def __init__(self):
        self.port = yarp.BufferedPortBottle()
        self.port.setStrict()
        self.port.open(self.name)

    def read(self):
        message = self.port.read(False)
        return message.toString() if message else None

    def close(self):
        self.port.close()


class Ours(Program):
    """`yarp read` of ours."""

    name = "/monitors/ours/r"

    def __init__(self, yarp_command):
        super().__init__(yarp_command, "read", self.name)
        until("yarp read", lambda: yarp.Network.exists(self.name))

    def read(self):
        return self.next(0)


class Writer:
    """A writer of stock's that is connected to one reader at a time."""

    name = "/monitors/w"

    def __init__(self):
        self.port = yarp.Port()
        self.port.open(self.name)

    def connect(self, reader, carrier):
        for other in ask(self.name, "[list] [out]").replace('"', "").split():
            yarp.Network.disconnect(self.name, other)
            until("the end of a connection", lambda: self.name not in ask(other, "[list] [in]"))
        return yarp.Network.connect(self.name, reader.name, carrier)

    def through(self, reader, carrier, message):
        """What the reader gets of a message."""
        if not self.connect(reader, carrier):
            return "no connection"
        until("a connection", lambda: self.name in ask(reader.name, "[list] [in]"))
        message = yarp.Bottle(message)
        if "send.portmonitor+recv.portmonitor+type.dll+file.depthimage" in carrier:
            # Its plugin wants the image itself.
            picture = yarp.ImageFloat()
            yarp.Portable.copyPortable(message, picture)
            message = picture
        self.port.write(message)
        return until(f"a message over {carrier}", reader.read)


def image(code, depth, width, height, numbers):
    pixels = " ".join(map(str, numbers))
    return f"[mat] [{code}] ({depth} {len(numbers)} 1 {width} {height}) {{{pixels}}}"


def shown(text):
    """An image without what says how its rows are padded."""
    words = text.replace("(", " ").replace(")", " ").split()
    return words[:3] + words[5:]


def bayer(writer, stock, ours):
    rng = random.Random(7)
    methods = ["", "+method.bilinear", "+method.nearest", "+method.simple", "+method.hqlinear", "+method.vng", "+method.ahd", "+method.downsample", "+size.half"]
    for width, height in [(8, 6), (16, 5), (6, 4), (9, 1), (40, 31)]:
        orders = ["", "+order.grbg", "+order.gbrg", "+order.rggb", "+order.bggr"]
        for order in orders if width == 8 else orders[-1:]:
            for method in methods:
                # An odd last row is read beyond its end by stock.
                if width % 8 == 0 and height % 2 and ("half" in method or "down" in method):
                    continue
                # Of fewer than six rows its vng makes some black.
                if width % 8 == 0 and height < 6 and "vng" in method:
                    continue
                # Nor has it anything to say about edges wider than the image.
                if "half" in method and (width < 4 or height < 2):
                    continue
                raw = image("mono", 1, width, height, [rng.randrange(256) for _ in range(width * height)])
                carrier = f"tcp+recv.bayer{order}{method}"
                got, expected = (shown(writer.through(reader, carrier, raw)) for reader in (ours, stock))
                same(f"{carrier}, {width} x {height}", got, expected)


def answers(writer, stock, ours):
    for carrier in [
        "tcp+recv.priority", "fast_tcp+recv.priority+tc.3+tr.1+st.5+bs.-10", "tcp+virtual+recv.priority",
        "tcp+recv.priority+(ex (/a -10) (/b 20))", "tcp+recv.priority+ex.(/a -10)", "tcp+unknown.x+other",
    ]:
        told = []
        for reader in (ours, stock):
            writer.connect(reader, carrier)
            until("a connection", lambda: writer.name in ask(reader.name, "[list] [in]"))
            if "recv" in carrier:
                # Stock lists it before its modifier is there.
                until("its modifier", lambda: ask(reader.name, f"[get] [in] {writer.name}") != "()")
            requests = ["[list] [in] {w}", "[get] [in] {w}", "[set] [in] {w} (tc 7) (st 3) (virtual 1)", "[get] [in] {w}",
                        "[set] [in] {w} (ex (/c 5)) (bs 2.5)", "[get] [in] {w}", "[get] [in] /nobody", "[set] [in] /nobody (a 1)"]
            replies = [ask(reader.name, request.format(w=writer.name)) for request in requests]
            told.append([reply.replace(reader.name, "READER") for reply in replies])
        same(f"parameters over {carrier}", *told)
    for side in ["out", "in"]:
        told = []
        for reader in (ours, stock):
            requests = [
                f"[atch] [{side}]", f"[atch] [{side}] foo", f'[atch] [{side}] "(type dll) (file nonesuch)"',
                f"[atch] [{side}] (type dll) (file nonesuch)", f"[get] [{side}] {reader.name}", f"[set] [{side}] {reader.name} (a 1)",
                f"[dtch] [{side}]", f"[dtch] [{side}]", "[atch]", "[atch] foo", "[dtch]", "[dtch] foo", f"[get] [{side}]",
            ]
            # Ours says why behind stock's words.
            told.append([ask(reader.name, request).split("plug-in\"")[0] for request in requests])
        same(f"what is attached, {side}", *told)


def refusals(writer, ours, our_yarp):
    """Neither side is left with a connection that the other has not.

    Stock's `text` and `text_ack` do not look at what answers their header: they notice when they write.
    """
    missing = ["recv.nonesuch", "recv.portmonitor+type.dll+file.nonesuch", "recv.portmonitor+type.lua+file.x", "recv.bayer+method.nonesuch"]
    for carrier in ["tcp", "fast_tcp", "udp"]:
        for modifier in missing:
            over = f"{carrier}+{modifier}"
            same(f"stock to ours over {over}", writer.connect(ours, over), False)
            same("  no end has it", (ask(writer.name, "[list] [out]"), writer.name in ask(ours.name, "[list] [in]")), ("", False))
    stock = Stock()
    sender = "/monitors/ours/w"
    program = Program(our_yarp, "write", sender)
    until("yarp write", lambda: yarp.Network.exists(sender))
    for carrier in ["tcp", "fast_tcp", "text", "text_ack", "shmem", "unix_stream", "mcast"]:
        for modifier in ["recv.nonesuch", "recv.portmonitor+type.dll+file.nonesuch", "send.nonesuch"]:
            over = f"{carrier}+{modifier}"
            answer = ask(sender, f'[add] "{over}:/{stock.name}"')
            same(f"ours to stock over {over}", ("Cannot connect to" in answer, "nonesuch" in answer.split("//")[1]), (True, True))
            until("the end", lambda: sender not in ask(stock.name, "[list] [in]"))
            same("  no end has it", ask(sender, "[list] [out]"), "")
    answer = ask(sender, f'[add] "tcp+recv.priority:/{stock.name}"')
    same("ours to stock over what it has", "Added connection" in answer, True)
    program.say("hello 1 2")
    same("  and it reads", until("a message", stock.read), "hello 1 2")
    program.finish()
    stock.close()


def compressed(writer, stock, ours, our_yarp):
    zlib = "portmonitor+type.dll+file.bottle_compression_zlib"
    for carrier in ["tcp", "fast_tcp", "udp", "text_ack"]:
        for message in ["1 2.5 hello (a b)", "0", "()", "x" * 50000, "1 2 3"]:
            for end in ["send", "recv", "send.portmonitor+recv"]:
                over = f"{carrier}+{end}.{zlib}"
                got, expected = (writer.through(reader, over, message) for reader in (ours, stock))
                same(f"{over} {message[:20]!r}", got, expected)
    # Ours compresses, stock expands.
    sender = "/monitors/ours/w"
    program = Program(our_yarp, "write", sender)
    until("yarp write", lambda: yarp.Network.exists(sender))
    for carrier in ["tcp", "fast_tcp", "udp", "text_ack"]:
        yarp.Network.connect(sender, stock.name, f"{carrier}+send.portmonitor+recv.{zlib}")
        until("a connection", lambda: sender in ask(stock.name, "[list] [in]"))
        for message in ["1 2.5 hello (a b)", "7", "y" * 3000]:
            program.say(message)
            same(f"ours to stock, {carrier}", until("a message", stock.read), message)
        yarp.Network.disconnect(sender, stock.name)
        until("the end", lambda: sender not in ask(stock.name, "[list] [in]"))
    program.finish()


def depths(writer, stock, ours, our_yarp, name):
    """Only rows of a length that needs no padding: stock's plugins do not heed it."""
    metres = [0.1, 0.2, 0.5, 1, 2.5, 9.8, 10, 50, 0, -1, float("nan"), float("inf"), 1e-9, 3.3, 7, 9.99]
    message = image("dec", 4, 8, 2, struct.pack("<16f", *metres))
    both = "zlib" in name
    end = "send.portmonitor+recv" if both else "recv"
    over = f"tcp+{end}.portmonitor+type.dll+file.{name}"
    got, expected = (shown(writer.through(reader, over, message)) for reader in (ours, stock))
    code = {"depthimage_to_mono": "[mono]", "depthimage_to_rgb": "[rgb]"}.get(name, "[dec]")
    same(f"{over}: what stock makes of it", expected[:2], ["[mat]", code])
    same(over, got, expected)
    if both:
        # Ours compresses, stock expands.
        sender = "/monitors/ours/w"
        program = Program(our_yarp, "write", sender)
        until("yarp write", lambda: yarp.Network.exists(sender))
        same(f"ours to stock, {over}", yarp.Network.connect(sender, stock.name, over), True)
        program.say(message)
        same("  and it reads", shown(until("a message", stock.read)), expected)
        program.finish()


def rotations(writer, ours):
    """Stock 3.5 has no image_rotation; its pixels are worked out by hand from 3.8's sources."""
    picture = image("rgb", 3, 2, 2, [1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4])
    for options, expected in [("", [3, 1, 4, 2]), ("+options_rotate.rotate_ccw", [2, 4, 1, 3]), ("+options_rotate.rotate_180", [4, 3, 2, 1]),
                              ("+options_rotate.rotate_none+options_flip.flip_x", [3, 4, 1, 2])]:
        over = f"tcp+recv.portmonitor+type.dll+file.image_rotation{options}"
        words = writer.through(ours, over, picture).replace("{", " ").replace("}", " ").replace("(", " ").replace(")", " ").split()
        # Rows of two pixels of three bytes are padded to eight.
        numbers = [int(word) for word in words[-16:]]
        same(over, [numbers[row * 8 + column * 3] for row in (0, 1) for column in (0, 1)], expected)


def main():
    our_yarp = sys.argv[1]
    yarp.Network.init()
    writer, stock, ours = Writer(), Stock(), Ours(our_yarp)
    try:
        bayer(writer, stock, ours)
        answers(writer, stock, ours)
        if "bottle_compression_zlib" in sys.argv[2:]:
            compressed(writer, stock, ours, our_yarp)
        for name in sys.argv[2:]:
            if name.startswith("depthimage"):
                depths(writer, stock, ours, our_yarp, name)
        rotations(writer, ours)
        stock.close()
        refusals(writer, ours, our_yarp)
    finally:
        ours.kill()
        writer.port.close()
    sys.exit(verdict())


main()
