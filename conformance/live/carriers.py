"""Sends messages both ways between stock YARP and ours over carriers within one machine.

For each carrier: small and large messages, envelopes where stock's bindings have them, requests and
replies, both ways; then either end is killed and started again. At the end nothing may be left of
the shared memory of these connections. Over `mcast` several readers of both sides get each message
of a writer of either side once, whoever of them comes and goes. Prints `ok` or `FAIL` per check and
ends with 1 if any failed.

    "$STOCK/bin/python" conformance/live/carriers.py OUR_YARP STOCK_YARP [CARRIER ...]

The network is that of YARP's configuration; `TMPDIR` and `YARP_RUNTIME_DIR` must name a folder of this
run alone.
"""

import os
import pathlib
import queue
import sys
import time

import yarp
from asking import PATIENCE, ask, eventually
from checks import check, leave
from programs import Program

# Characters of a large message: much more than a ring begins with.
LARGE = 1_000_000


class Reader(yarp.PortReader):
    """What arrives at a port of stock, as text; answers what wants an answer."""

    def __init__(self):
        super().__init__()
        self.got = queue.Queue()

    def read(self, connection):
        message = yarp.Bottle()
        if not message.read(connection):
            return False
        self.got.put(message.toString())
        writer = connection.getWriter()
        if writer is not None:
            answer = yarp.Bottle()
            answer.addString("stock")
            answer.append(message)
            answer.write(writer)
        return True

    def next(self):
        try:
            return self.got.get(timeout=PATIENCE)
        except queue.Empty:
            return None


def port(name):
    opened = yarp.Port()
    assert opened.open(name), name
    return opened


def bottle(text):
    made = yarp.Bottle()
    made.fromString(text)
    return made


def connect(what, source, target, carrier):
    """Without a connection nothing else can be checked."""
    if not check(f"{carrier}: {what}", eventually(lambda: yarp.Network.connect(source, target, carrier, True))):
        raise NoConnection


class NoConnection(Exception):
    """Two ports could not be connected, and that has been told."""


def texts():
    return ["1 2.5 hello", "(a (b c)) [vocb] \"two words\"", "x" * LARGE, "y" * 5000, "z" * (3 * LARGE), "last"]


def shown(text):
    return "nothing" if text is None else text[:40]


def stock_writes(ours, _stock, carrier):
    name = f"/live/{carrier}/ours"
    reader = Program(ours, "read", name, "envelope")
    writer = port(f"/live/{carrier}/stock")
    connect("stock connects to ours", writer.getName(), name, carrier)
    for count, text in enumerate(texts()):
        stamp = yarp.Stamp(count, 1.5)
        writer.setEnvelope(stamp)
        writer.write(bottle(text))
        envelope, got = reader.next(), reader.next()
        check(f"{carrier}: ours reads {len(text)} characters", got == text, shown(got))
        check(f"{carrier}: and their envelope", (envelope or "").split()[:1] == [str(count)], shown(envelope))
    # Many in a row, faster than they are printed.
    for number in range(500):
        writer.write(bottle(str(number)))
    got = [(reader.next(), reader.next())[1] for _ in range(500)]
    check(f"{carrier}: 500 messages in order", got == [str(number) for number in range(500)])

    reader.kill()
    writer.write(bottle("into nothing"))
    check(f"{carrier}: stock outlives our reader", eventually(lambda: writer.getOutputCount() == 0 or not writer.write(bottle("x"))))
    reader = Program(ours, "read", name, "envelope")
    connect("stock connects to it again", writer.getName(), name, carrier)
    writer.write(bottle("again"))
    got = reader.next()
    got = reader.next() if got is not None and got != "again" else got
    check(f"{carrier}: and ours reads again", got == "again", shown(got))
    yarp.Network.disconnect(writer.getName(), name)
    writer.close()
    reader.end()


def ours_writes(ours, _stock, carrier):
    name = f"/live/{carrier}/stock/r"
    got = Reader()
    reader = port(name)
    reader.setReader(got)
    writer_name = f"/live/{carrier}/ours/w"
    for run in ["first", "after a kill"]:
        writer = Program(ours, "write", writer_name)
        connect(f"ours connects to stock, {run}", writer_name, name, carrier)
        for text in texts():
            writer.say(text)
            found = got.next()
            check(f"{carrier}: stock reads {len(text)} characters, {run}", found == text, shown(found))
        for number in range(500):
            writer.say(str(number))
        found = [got.next() for _ in range(500)]
        check(f"{carrier}: 500 messages in order, {run}", found == [str(number) for number in range(500)])
        if run == "first":
            # Stock's locks belong to no process: whoever is killed while it holds one leaves stock waiting forever. It takes
            # one for moments, until it has read the last acknowledgement.
            time.sleep(0.5)
            writer.kill()
            check(f"{carrier}: stock notices", eventually(lambda: reader.getInputCount() == 0))
        else:
            writer.end()
    reader.interrupt()
    reader.close()


def requests(ours, _stock, carrier):
    got = Reader()
    server = port(f"/live/{carrier}/stock/s")
    server.setReader(got)
    client_name = f"/live/{carrier}/ours/c"
    client = Program(ours, "rpc", "--client", client_name)
    connect("our client connects to stock", client_name, server.getName(), carrier)
    for text in ["hello 1", "x" * LARGE]:
        client.say(text)
        answer = client.next()
        while answer is not None and "stock" not in answer:
            answer = client.next()
        good = answer is not None and answer.strip().endswith(f"stock {text}")
        check(f"{carrier}: stock answers {len(text)} characters to ours", good, shown(answer))
    client.end()
    server.interrupt()
    server.close()

    name = f"/live/{carrier}/ours/s"
    server = Program(ours, "rpcserver", "--echo", name)
    client = yarp.RpcClient()
    client.open(f"/live/{carrier}/stock/c")
    connect("stock connects to our server", client.getName(), name, carrier)
    for text in ["hello 1", "x" * LARGE]:
        answer = yarp.Bottle()
        client.write(bottle(text), answer)
        check(f"{carrier}: ours answers {len(text)} characters to stock", answer.toString() == text, shown(answer.toString()))
    client.close()
    server.end()


def killed_stock_writer(ours, stock, carrier):
    name = f"/live/{carrier}/ours/k"
    reader = Program(ours, "read", name)
    writer_name = f"/live/{carrier}/stock/k"
    for run in range(3):
        writer = Program(*stock, "write", writer_name)
        connect(f"stock connects, run {run}", writer_name, name, carrier)
        for text in ["hello", "x" * LARGE]:
            writer.say(text)
            got = reader.next()
            check(f"{carrier}: ours reads, run {run}", got == text, shown(got))
        writer.kill()
    reader.end()


def groups(ours, _stock, carrier):
    """Readers of both sides in one group."""

    def join(what, writer, name):
        connect(what, writer, name, carrier)
        # Nothing answers the header: a reader joins the group a moment after its writer goes on, and what
        # was written before is lost to it. It is listed first.
        check(f"{carrier}: {name} knows", eventually(lambda: writer in ask(name, "[list] [in]").replace('"', "").split()))
        time.sleep(0.2)

    def leave(writer, name):
        yarp.Network.disconnect(writer, name)
        # Until then it may still hear the next message to the others.
        eventually(lambda: writer not in ask(name, "[list] [in]").replace('"', "").split())

    readers, ports = {}, []
    for number in range(2):
        name = f"/live/{carrier}/stock/{number}"
        readers[name] = Reader()
        ports.append(port(name))
        ports[-1].setReader(readers[name])
        name = f"/live/{carrier}/ours/{number}"
        readers[name] = Program(ours, "read", name)
        eventually(lambda: yarp.Network.exists(name))
    stock_writer = port(f"/live/{carrier}/stock/w")
    our_writer = Program(ours, "write", f"/live/{carrier}/ours/w")
    eventually(lambda: yarp.Network.exists(f"/live/{carrier}/ours/w"))
    for side, writer, say in [
        ("stock", stock_writer.getName(), lambda text: stock_writer.write(bottle(text))),
        ("ours", f"/live/{carrier}/ours/w", our_writer.say),
    ]:
        for name in readers:
            join(f"{side} writes to {name}", writer, name)

        def all_get(what, left, messages):
            for message in messages:
                say(message)
            found = {name: [readers[name].next() for _ in messages] for name in left}
            wrong = {name: [shown(text) for text in got][:5] for name, got in found.items() if got != messages}
            check(f"{carrier}: {side} writes, {what}", not wrong, wrong)

        # A message is lost if a socket has no room for its datagrams: these have.
        for text in ["1 2.5 hello", "(a (b c)) [vocb]", "y" * 5000, "z" * 60_000, "x" * 100_000]:
            all_get(f"all read {len(text)} characters once", readers, [text])
        all_get("all read 100 messages once", readers, [str(number) for number in range(100)])
        # The first of a writer's connections sends for all.
        left = list(readers)
        while len(left) > 1:
            leave(writer, left.pop(0))
            all_get(f"{len(left)} are left and read once", left, [f"left {len(left)}", "and more"])
        gone = [name for name in readers if name not in left]
        for name in gone:
            join(f"{side} writes to {name} again", writer, name)
        all_get("all read again once", readers, ["again", "end"])
        for name in readers:
            yarp.Network.disconnect(writer, name)
    # A reader that is killed does not end the group: the others read on.
    connected = [f"/live/{carrier}/{rest}" for rest in ("ours/0", "ours/1", "stock/0")]
    for writer in (stock_writer.getName(), f"/live/{carrier}/ours/w"):
        for name in connected:
            join(f"{writer} to {name}", writer, name)
    readers[connected[0]].kill()
    for writer, say in [("stock", lambda text: stock_writer.write(bottle(text))), ("ours", our_writer.say)]:
        say(f"{writer} after a kill")
        found = [readers[name].next() for name in connected[1:]]
        check(f"{carrier}: {writer} writes, one reader was killed", found == [f"{writer} after a kill"] * 2, found)
    our_writer.end()
    readers[connected[1]].end()
    stock_writer.close()
    for opened in ports:
        opened.interrupt()
        opened.close()


def segments(makers=None):
    """Keys of the segments of shared memory, all or those that these processes have made."""
    lines = pathlib.Path("/proc/sysvipc/shm").read_text().splitlines()[1:]
    rows = [(int(key), int(maker)) for key, _, _, _, maker, *_ in map(str.split, lines)]
    return {key for key, maker in rows if makers is None or maker in makers} - {0}


def main():
    ours, stock, *carriers = sys.argv[1:]
    yarp.Network.init()
    parts = {"mcast": [groups]}
    for carrier in carriers or ["shmem", "unix_stream", "unix_stream+ack", *parts]:
        # All of them: an older one may have been made by a process whose number is used again.
        before = segments()
        for part in parts.get(carrier, [stock_writes, ours_writes, requests, killed_stock_writer]):
            try:
                part(ours, stock.split(), carrier)
            except NoConnection:
                pass
        left = list(pathlib.Path(os.environ["TMPDIR"]).glob("SHMEM_*"))
        check(f"{carrier}: no lock is left", not left, left)
        left = segments({os.getpid(), *Program.started}) - before
        check(f"{carrier}: no segment is left", not left, left)
    yarp.Network.fini()
    leave()


main()
