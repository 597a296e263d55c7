"""Copies of what a port receives, over `+log.in`: between stock and ours the same as between stock and stock.

    with_stock python copies.py OUR_YARP STOCK_YARP

Needs a name server, and YARP_RUNTIME_DIR for stock's unix_stream. A port receives, and another looks on;
either is `yarp read` or `yarp rpcserver` of stock or of ours. What both print, and what they answer, is
compared with what two of stock's do.
Prints `ok` or `FAIL` per comparison and ends with 1 if any failed.
"""

import re
import sys
import time

import yarp
from again import tried
from asking import ask, until
from checks import leave, same
from programs import Program

OURS, STOCK = [sys.argv[1]], sys.argv[2].split()
WRITER, CLIENT, LOGGED, LOGGER = "/copies/writer", "/copies/client", "/copies/logged", "/copies/logger"
# Carriers from the one that receives to the one that looks on.
CARRIERS = ["tcp+log.in", "fast_tcp+log.in", "udp+log.in", "mcast+log.in", "unix_stream+log.in", "shmem+log.in"]
# Those over which stock sends copies as binary that its reader takes for text.
TEXT_CARRIERS = ["text+log.in", "text_ack+log.in"]
# Those to the one that receives.
OVERS = ["tcp", "fast_tcp", "udp", "text_ack", "shmem"]
# Stock gives the other half a second to listen, which a busy machine may not have, and now and then
# it loses a connection between two of its own.
UNSTEADY = "unix_stream"
TEXTS = ["1 2.5 hello", "5", "2.5", "()", "(a (b c)) [vocb] \"two words\"", "1 2 3", "1.5 2.5", "{1 2 255}", "0 text", "x" * 5000]


def messages(over):
    """What is written: bottles, and what is more than that."""
    yield from ((text[:20], yarp.Bottle(text)) for text in TEXTS)
    # Stock crashes when it is to write these as text.
    if over.startswith("text"):
        return
    vector = yarp.Vector(3)
    for at in range(3):
        vector[at] = at + 0.25
    yield "a vector", vector
    image = yarp.ImageRgb()
    image.resize(5, 3)
    image.zero()
    yield "an image", image


# What ends the programs and ports of the part that runs.
ends = []


def start(command, name, *words):
    program = Program(*command, *words, name, *(["envelope"] if words == ("read",) else []))
    ends.append(program.kill)
    until(name, lambda: yarp.Network.exists(name))
    return program


def opened(port, name):
    ends.append(port.close)
    assert port.open(name)
    return port


def stop():
    while ends:
        ends.pop()()
    for name in (LOGGED, LOGGER):
        yarp.Network.unregisterName(name)


def plain(answer):
    """An answer without addresses and numbers of sockets."""
    return re.sub(r"(\d+\.){3}\d+:\d+", "PLACE", answer)


def look_on(carrier):
    """Has what the one receives copied to the other; what it says to that."""
    told = [plain(ask(LOGGED, f'[add] "{carrier}:/{LOGGER}"'))]
    until(f"{LOGGER} over {carrier}", lambda: LOGGED in ask(LOGGER, "[list] [in]"))
    if carrier.startswith("mcast"):
        # It is listed a moment before it joins the group.
        time.sleep(0.3)
    return [*told, *(ask(LOGGED, request) for request in ("[list] [out]", f"[list] [out] {LOGGER}"))]


def connect(source, over):
    """Connects to the one that receives."""
    until(f"a connection over {over}", lambda: yarp.Network.connect(source, LOGGED, over, True))
    until(f"{source} over {over}", lambda: source in ask(LOGGED, "[list] [in]"))


def disconnect(source, target):
    yarp.Network.disconnect(source, target, True)
    until("the end of a connection", lambda: source not in ask(target, "[list] [in]"))


def until_last(program, last):
    """The lines up to `last`."""
    lines = []
    while not lines or lines[-1] != last:
        lines.append(next_of(program, f"{last!r} behind {lines[-2:]}"))
    return lines


def next_of(program, what):
    if (line := program.next()) is None:
        raise SystemExit(f"FAIL gave up waiting for {what}")
    return line


def of_messages(logged, logger, carrier):
    """What is told of messages over a carrier."""
    told = {}
    reader, looker = start(logged, LOGGED, "read"), start(logger, LOGGER, "read")
    told["what is answered"] = look_on(carrier)
    writer = opened(yarp.Port(), WRITER)
    count = 0
    for over in OVERS:
        connect(WRITER, over)
        for what, message in messages(over):
            count += 1
            stamp = yarp.Stamp(count, count + 0.5)
            writer.setEnvelope(stamp)
            writer.write(message)
            # Tells that all of the message has been printed, and its envelope in front of it.
            writer.write(yarp.Bottle(f"end {count}"))
            told[f"{what}, over {over}"] = [until_last(program, f"end {count}") for program in (reader, looker)]
        disconnect(WRITER, LOGGED)
    connect(WRITER, "tcp")
    disconnect(LOGGED, LOGGER)
    writer.write(yarp.Bottle("alone"))
    told["nobody looks on"] = until_last(reader, "alone")
    look_on(carrier)
    writer.write(yarp.Bottle("again"))
    told["looked on again"] = [until_last(program, "again") for program in (reader, looker)]
    looker.kill()
    # What is written next may be what finds out; nothing is lost to the one that receives.
    for number in range(3):
        writer.write(yarp.Bottle(f"killed {number}"))
    told["who looked on was killed"] = until_last(reader, "killed 2")
    stop()
    return told


def of_requests(logged, logger, carrier):
    """What is told of requests and their replies."""
    told = {}
    for way in ("--echo", None):
        server = start(logged, LOGGED, "rpcserver", *([way] if way else []))
        looker = start(logger, LOGGER, "read")
        kind = way or "an answer that is typed"
        told[f"what is answered, {kind}"] = look_on(carrier)
        client = opened(yarp.RpcClient(), CLIENT)
        for over in ["tcp", "fast_tcp", "text_ack", "shmem"]:
            connect(CLIENT, over)
            for text in ["hello 1 2.5", "(a b) c", "5", "()", "x" * 5000]:
                if way is None:
                    server.say(f"ok ({text}) 1.5")
                answer = yarp.Bottle()
                client.write(yarp.Bottle(text), answer)
                told[f"{text[:20]}, {kind}, over {over}"] = answer.toString(), next_of(looker, "a copy")
            disconnect(CLIENT, LOGGED)
        stop()
    return told


def refusals(logged, logger, _carrier):
    told = {}
    reader, looker = start(logged, LOGGED, "read"), start(logger, LOGGER, "read")
    for mode in ("out", "both", "x"):
        told[f"log.{mode}"] = [ask(LOGGED, request) for request in (f'[add] "tcp+log.{mode}:/{LOGGER}"', "[list] [out]")]
    stop()
    return told


def ours_alone(side, logger):
    """What stock cannot do."""
    for carrier in TEXT_CARRIERS:
        writer = opened(yarp.Port(), WRITER)
        reader, looker = start(OURS, LOGGED, "read"), start(logger, LOGGER, "read")
        look_on(carrier)
        for over in ["tcp", "text_ack"]:
            connect(WRITER, over)
            for text in [*TEXTS, "end"]:
                writer.write(yarp.Bottle(text))
            # Text has no envelopes.
            read, copied = (until_last(program, "end") for program in (reader, looker))
            same(f"{carrier} ours to {side}: what comes over {over}", (len(read), copied), (len(TEXTS) + 1, read))
            disconnect(WRITER, LOGGED)
        stop()
    # That of stock crashes: where nobody waits for an answer it writes one nevertheless.
    writer = opened(yarp.Port(), WRITER)
    server, looker = start(OURS, LOGGED, "rpcserver", "--echo"), start(logger, LOGGER, "read")
    look_on("tcp+log.in")
    connect(WRITER, "tcp")
    stamp = yarp.Stamp(7, 7.5)
    writer.setEnvelope(stamp)
    writer.write(yarp.Bottle("one way"))
    copied = [line.rstrip() for line in until_last(looker, "one way")]
    same(f"ours to {side}: a message that wants no answer", copied, ["7 7.5", "one way"])
    stop()


def told_by(part, logged, logger, carrier):
    """What a part tells. It runs again only where stock may be what got stuck."""

    def attempt():
        try:
            return part(logged, logger, carrier), None
        except SystemExit as why:
            stop()
            return None, why

    tries = 3 if carrier.startswith(UNSTEADY) and STOCK in (logged, logger) else 1
    told, why = tried(attempt, f"over {carrier}:", tries)
    if why is not None:
        raise why
    return told


def main():
    sides = {"stock": STOCK, "ours": OURS}
    yarp.Network.init()
    parts = [(of_messages, carrier) for carrier in CARRIERS]
    parts += [(of_requests, carrier) for carrier in CARRIERS[:2]]
    parts += [(refusals, "")]
    for part, carrier in parts:
        expected = told_by(part, STOCK, STOCK, carrier)
        for logged, logger in (("stock", "ours"), ("ours", "stock"), ("ours", "ours")):
            told = told_by(part, sides[logged], sides[logger], carrier)
            for what, got in told.items():
                same(f"{carrier} {logged} to {logger}: {what}", got, expected[what])
    for side, command in sides.items():
        ours_alone(side, command)
    leave()


main()
