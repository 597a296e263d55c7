"""A page talks in frames with ports of stock and with ports of ours, and is answered the same by both.

    python websocket.py OUR_YARP STOCK_YARP
    python websocket.py --serve NAME

A page is a raw connection that speaks RFC 6455 and, within it, the blocks and messages of ports. The
same conversations are had with a port of stock 3.5.0 and with one of ours; the streams that their
frames hold must be equal, byte for byte. Where frames begin and end is each side's own affair. The
second form is the port of stock's that the first one starts: it tells what it gets and answers with it.

What stock cannot do is asked of ours alone: a message cut elsewhere than between its numbers and texts
is lost by stock, and so is all that follows a ping, of which it reads only two bytes. It takes note of
no page that closes or goes away, keeps it in its lists, and reads from it at full speed for ever; its
close frame is not the last of a message, and the connection stays open behind it.

Prints `ok` or `FAIL` per check and ends with 1 if any failed. Needs a name server, and stock's bindings.
"""

import base64
import hashlib
import os
import socket
import struct
import sys

import yarp
from asking import PATIENCE, ask, eventually, until
from checks import leave, same
from programs import Program

# The line of a port that has got a message.
MESSAGE = "Message: "
# What a key is answered with; source: RFC 6455, section 1.3.
GUID = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
CONTINUATION, TEXT, BINARY, CLOSE, PING, PONG = 0, 1, 2, 8, 9, 10


class Peer(Program):
    """A program with a port that pages talk with; its lines are the messages that the port has got."""

    def __init__(self, name, *command):
        super().__init__(*command, name)
        self.name = name
        until(name, lambda: yarp.Network.exists(name))
        self.place = yarp.Network.queryName(name)

    def taken(self, line):
        return line.removeprefix(MESSAGE) if line.startswith(MESSAGE) else None

    def pages(self):
        """How many pages write to the port, and how many it writes to."""
        return [ask(self.name, f"[list] [{side}]").split().count("web") for side in ("in", "out")]


class Page:
    """A page at a port."""

    def __init__(self, peer):
        self.socket = socket.create_connection((peer.place.getHost(), peer.place.getPort()), PATIENCE)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())
        self.bytes = b""
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += self.exactly(1)
        accept = base64.b64encode(hashlib.sha1((key + GUID).encode()).digest()).decode()
        self.head = head.decode().replace(accept, "ACCEPT")
        # What data frames held and nobody used yet, and the other frames.
        self.stream = b""
        self.others = []
        # Lengths of the data frames.
        self.frames = []

    def exactly(self, count):
        """The next bytes of the connection; EOFError at its end."""
        while len(self.bytes) < count:
            try:
                more = self.socket.recv(1 << 16)
            except ConnectionResetError:
                more = b""
            if not more:
                raise EOFError
            self.bytes += more
        taken, self.bytes = self.bytes[:count], self.bytes[count:]
        return taken

    def frame(self):
        """Takes the next frame."""
        first, second = self.exactly(2)
        assert first & 0x80 and not first & 0x70 or first == CLOSE, f"a frame in pieces or of an extension: {first:#x}"
        assert not second & 0x80, "a frame under a mask"
        length = second
        if second == 126:
            (length,) = struct.unpack(">H", self.exactly(2))
        elif second == 127:
            (length,) = struct.unpack(">Q", self.exactly(8))
        body = self.exactly(length)
        if first == 0x80 | BINARY:
            self.stream += body
            self.frames.append(length)
        else:
            self.others.append((first, body))

    def take(self, count):
        """The next bytes of the stream that data frames hold; what there is when the connection ends or is silent."""
        try:
            while len(self.stream) < count:
                self.frame()
        except (EOFError, TimeoutError):
            count = len(self.stream)
        taken, self.stream = self.stream[:count], self.stream[count:]
        return taken

    def rest(self):
        """All that comes until the other side ends the connection, with the frames that are no data."""
        try:
            while True:
                self.frame()
        except EOFError:
            return self.take(len(self.stream)), self.others
        except TimeoutError:
            return "the connection stays open"

    def send(self, body, kind=BINARY, last=True, wide=0):
        """Sends a frame; `wide` is how many bytes more than needed its length has."""
        mask = os.urandom(4)
        length = len(body)
        if length < 126 and wide == 0:
            head = struct.pack(">BB", kind | 0x80 * last, 0x80 | length)
        elif length < 65536 and wide < 8:
            head = struct.pack(">BBH", kind | 0x80 * last, 0x80 | 126, length)
        else:
            head = struct.pack(">BBQ", kind | 0x80 * last, 0x80 | 127, length)
        whole = (mask * (length // 4 + 1))[:length]
        masked = (int.from_bytes(body, "big") ^ int.from_bytes(whole, "big")).to_bytes(length, "big")
        self.socket.sendall(head + mask + masked)

    def answers(self, *messages, end="end"):
        """What data frames hold between `messages` and the answer to the question `end`."""
        for message in messages:
            self.send(message)
        self.send(question(end))
        return self.until(encoded(end))

    def until(self, ending):
        """What data frames hold in front of `ending`, which is the last in one."""
        try:
            while not self.stream.endswith(ending):
                self.frame()
        except (EOFError, TimeoutError) as error:
            return f"{error!r} behind {self.stream}"
        taken, self.stream = self.stream.removesuffix(ending), b""
        return taken

    def close(self):
        self.socket.close()


def block(letter):
    """A block with a command of one letter."""
    return bytes([0, 0, 0, 0]) + b"~" + letter.encode() + bytes([0, 1])


def spelled(text):
    """A block with a command in words."""
    words = text.encode() + b"\0"
    return struct.pack("<I", len(words)) + b"~\0\0\1" + words


# Codes of values; source: the recorded conversations in vectors/.
INT32, VOCAB, FLOAT64, STRING, LIST = 1, 9, 10, 4, 256


def encoded(*values):
    """A Bottle of whole numbers, fractions, texts, vocabs (bytes) and lists (tuples), as in a binary message."""
    kinds = {code(value) for value in values}
    same = kinds.pop() if len(kinds) == 1 else 0
    parts = [struct.pack("<ii", LIST | same & ~LIST, len(values))]
    for value in values:
        if not same or same & LIST:
            parts.append(b"" if isinstance(value, tuple) else struct.pack("<i", code(value)))
        if isinstance(value, tuple):
            parts.append(encoded(*value))
        elif isinstance(value, str):
            text = value.encode()
            parts.append(struct.pack("<i", len(text)) + text)
        elif isinstance(value, bytes):
            parts.append(value.ljust(4, b"\0"))
        else:
            parts.append(struct.pack("<i" if isinstance(value, int) else "<d", value))
    return b"".join(parts)


def code(value):
    return {int: INT32, float: FLOAT64, str: STRING, bytes: VOCAB, tuple: LIST}[type(value)]


def question(*values):
    return block("d") + encoded(*values)


def several(page):
    return page.answers(question(1, 2) + question("a", (1, 2), 2.5) + question("three"))


def pieces(page):
    """A message in pieces between its numbers, in frames that are text and go on, and that are binary."""
    message = question(7, 8)
    page.send(message[:8], TEXT, last=False)
    page.send(message[8:12], CONTINUATION, last=False)
    page.send(message[12:16], CONTINUATION)
    page.send(message[16:20], BINARY)
    page.send(message[20:], TEXT)
    return page.answers()


def lengths(page):
    """Frames on both sides of where their length changes its form, to the port and from it."""
    for length in [125, 126, 127, 65535, 65536, 300_000]:
        for rest in (len(question("")), len(encoded(""))):
            page.send(question("x" * (length - rest)))
    return page.answers()


def long_lengths(page):
    """Short frames with long lengths."""
    page.send(question(1), wide=2)
    page.send(question(2), wide=8)
    return page.answers()


def administration(page):
    requests = [(b"ver",), (b"list", b"in"), (b"list", b"out"), (b"list", b"in", "web"), (b"get", b"in", "web"),
                (b"prop", b"get", "nothing"), ("nonsense", 1), ()]
    return page.answers(*(block("a") + encoded(*request) for request in requests))


# What is said to a port that answers with what it gets, and in how many messages.
CONVERSATIONS = {
    "a question": (lambda page: page.answers(question("how", "much", 1)), 1),
    "several questions in a frame": (several, 3),
    "a text": (lambda page: page.answers(question("two words \"quoted\"", b"voc")), 1),
    "nothing in a list": (lambda page: page.answers(question()), 1),
    "a message that wants no answer": (lambda page: page.answers(block("D") + encoded(9)), 1),
    "messages with envelopes": (lambda page: page.answers(spelled("d 7 1.5") + encoded(9), spelled("D 8 2.5") + encoded(10)), 2),
    "commands in words": (lambda page: page.answers(spelled("d") + encoded(9), spelled("D") + encoded(10)), 2),
    "a message in pieces": (pieces, 1),
    "frames of all lengths": (lengths, 12),
    "short frames with long lengths": (long_lengths, 2),
    "administration": (administration, 0),
    "commands that nobody answers": (lambda page: page.answers(*map(block, "*?hx")), 0),
    "all at once": (lambda page: page.answers(b"".join(question(number) for number in range(500))), 500),
}


def wait_until_alone(page, server):
    """Waits until the port no longer lists the connection over which it was asked for its pages."""
    def alone():
        listed = page.answers(block("a") + encoded(b"list", b"in"))
        server.next()
        return b"admin" not in listed

    until("the end of other connections", alone)


def talk(server):
    """What a port says in all conversations, and what it gets; one connection, and one with each alone."""
    told = {}
    page = Page(server)
    # Stock spells it `WebSocket`, which means the same.
    told["the handshake"] = page.head.replace("WebSocket", "websocket")
    for shared in (True, False):
        for name, (talk, count) in CONVERSATIONS.items():
            if not shared:
                page = Page(server)
            if talk is administration:
                wait_until_alone(page, server)
            said = talk(page)
            # And the question at its end.
            got = [server.next() for _ in range(count + 1)]
            if isinstance(said, str) or None in got:
                raise SystemExit(f"FAIL {name}: {said!r}, {got}")
            told[f"{name}, {'one after the other' if shared else 'alone'}"] = (said, got)
            if not shared:
                page.send(block("q"))
                until("the end of a connection", lambda: server.pages() == [0, 0])
        if shared:
            page.send(block("q"))
            until("the end of a connection", lambda: server.pages() == [0, 0])
    return told


def listen(writer):
    """What a page reads that has turned its connection round, and another one beside it."""
    pages = []
    for count in (1, 2):
        pages.append(Page(writer))
        pages[-1].send(block("r"))
        until("a page that reads", lambda: writer.pages() == [0, count])
    lines = ["hello 1", "(a (b 2.5)) [voc]", "x" * 100, "y" * 5000, "z" * 100_000, "z" * 1_000_000, *map(str, range(300)), "end"]
    for line in lines:
        writer.say(line)
    last = block("D") + encoded("end")
    return [page.until(last) for page in pages]


def ours_alone(server):
    """What stock cannot do."""
    page = Page(server)
    message = question("in pieces", 5)
    page.send(message[:1], TEXT, last=False)
    for at in range(1, len(message) - 1):
        page.send(message[at : at + 1], CONTINUATION, last=False)
    page.send(message[-1:], CONTINUATION)
    same("ours reads a message whose bytes come one by one", page.take(len(message) - 8), message[8:])
    page.send(message[:10], last=False)
    page.send(b"there?", PING)
    page.send(b"", PING)
    page.send(b"unasked", PONG)
    page.send(message[10:], CONTINUATION)
    same("ours reads a message with a ping in it", page.take(len(message) - 8), message[8:])
    same("  and answers the ping", page.others, [(0x80 | PONG, b"there?"), (0x80 | PONG, b"")])
    for what, goodbye, answer in [
        ("a close with a reason", lambda page: page.send(struct.pack(">H", 1001) + b"gone", CLOSE), struct.pack(">H", 1001)),
        ("a close without one", lambda page: page.send(b"", CLOSE), b""),
        ("the command to end", lambda page: page.send(block("q")), struct.pack(">H", 1000)),
    ]:
        page = Page(server)
        page.answers(question(1))
        goodbye(page)
        same(f"ours answers {what}, and ends the connection", page.rest(), (b"", [(0x80 | CLOSE, answer)]))


def gone(side, server, writer):
    """Pages that go away in the middle, and ports that are killed."""
    message = question("never", "whole")
    ways = [("after a message", b""), ("in the head of a frame", b"\x82"), ("in a long length", b"\x82\xfe\x01"),
            ("in a mask", b"\x82\x85ab"), ("in a frame", b"\x82\xa0abcdefgh"), ("between frames", b"\x02\x88\0\0\0\0" + message[:8])]
    for what, sent in ways if side == "ours" else ways[:1]:
        for how, linger in [("closes", 0), ("is reset", 1)]:
            page = Page(server)
            page.answers(question(1))
            page.socket.sendall(sent)
            page.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", linger, 0))
            page.close()
            if side == "ours":
                same(f"ours notices a page that {how} {what}", eventually(lambda: server.pages() == [0, 0]), True)
    page = Page(server)
    same(f"{side}: the next page is answered", page.answers(question(2)), encoded(2))
    server.kill()
    same(f"{side}: a page notices that its port was killed", page.rest(), (b"", []))

    for count in range(2):
        page = Page(writer)
        page.send(block("r"))
        until("a page that reads", lambda: writer.pages()[1] > (0 if side == "ours" else count))
        writer.say("before")
        before = block("D") + encoded("before")
        same(f"{side}: a page reads", page.take(len(before)), before)
        if count == 0:
            page.close()
            # The first is lost on the way; ours takes note of the page at once.
            writer.say("nobody")
            if side == "ours":
                same("ours notices that a page that read is gone", eventually(lambda: writer.pages() == [0, 0]), True)
    writer.kill()
    same(f"{side}: a page that reads notices that its port was killed", page.rest(), (b"", []))


def closed(writer):
    """A port that closes while a page reads says goodbye to it."""
    page = Page(writer)
    page.send(block("r"))
    until("a page that reads", lambda: writer.pages() == [0, 1])
    writer.process.stdin.close()
    same("ours says goodbye to a page that reads", page.rest(), (spelled("q"), [(0x80 | CLOSE, struct.pack(">H", 1000))]))
    same("  and ends", writer.process.wait(PATIENCE), 0)


def serve(name):
    """A port of stock's that tells what it gets and answers with it, until the end of its input."""

    class Reader(yarp.PortReader):
        def read(self, connection):
            message = yarp.Bottle()
            if not message.read(connection):
                return False
            print(MESSAGE + message.toString(), flush=True)
            if (writer := connection.getWriter()) is not None:
                message.write(writer)
            return True

    port, reader = yarp.Port(), Reader()
    port.setReader(reader)
    assert port.open(name)
    sys.stdin.read()
    os._exit(0)


def main():
    yarp.Network.init()
    if sys.argv[1] == "--serve":
        serve(sys.argv[2])
    our_yarp, stock_yarp = sys.argv[1:]
    servers = {"stock": [sys.executable, __file__, "--serve"], "ours": [our_yarp, "rpcserver", "--echo"]}
    writers = {"stock": [*stock_yarp.split(), "write"], "ours": [our_yarp, "write"]}
    told, read = {}, {}
    for side in servers:
        # The same names, so that answers can be compared.
        server = Peer("/websocket/server", *servers[side])
        writer = Peer("/websocket/writer", *writers[side])
        told[side] = talk(server)
        read[side] = listen(writer)
        if side == "ours":
            ours_alone(server)
        # Stock lists pages that went away, so that these come last.
        writer.kill()
        gone(side, server, Peer("/websocket/writer", *writers[side]))
    for name, expected in told["stock"].items():
        same(name, told["ours"][name], expected)
    for at, expected in enumerate(read["stock"]):
        same(f"page {at + 1} that reads gets {len(expected)} bytes", read["ours"][at], expected)
    closed(Peer("/websocket/writer", *writers["ours"]))
    leave()


main()
