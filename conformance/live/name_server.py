#!/usr/bin/env python3
"""Every command of the name server in every form: ours answers as stock does, byte by byte.

    name_server.py --our-yarp PATH --stock-server COMMAND...

Starts both on free ports and asks both the same, over `NAME_SERVER` lines and over `text_ack`. Port
numbers are compared by their distance from the server's own, addresses and processes not at all.
What differs on purpose stands in DIFFERENT.
"""

import argparse
import os
import random
import re
import socket
import subprocess
import sys
import tempfile
import time

from tied import TIED

PATIENCE = 60
END = b"*** end of message\r\n"
ACK = b"<ACK>\r\n"

REQUESTS = """
help
bot help
register /a
query /a
bot query /a
register /b tcp 10.0.0.9 12345
register /c udp ... -1 yarp/image
get /c type
register ...
register =x
register /m mcast
register /t topic
query /nope
bot query /nope
query tcp://b
list
list /a
list /
list /tmp
list nope
bot list
bot list /b
set /a k v w
get /a k
check /a k v
check /a k x
bot set /a k 1 (2 3)
bot get /a k
bot check /a k v
set /nope k v
get /nope k
check /nope k v
bot get /nope k
set /a ips 10.0.0.1 192.168.0.7
query /net=192.168/a
get /root nameserver
route /a /b
route /a /nope
route tcp://a udp://b
bot route /a /b
match /a
match /a tcp udp
bot match /a
version
bot version
set /b yarprun true
runners
bot runners
gc
bot gc
unregister /nope
unregister /c
query /c
bot unregister /b
register /c2
set /a owns /c2
unregister /a
list /
get
check
route
unregister
nonsense
NAME_SERVER list /t
exit
quit
kill
nameserver
ips /root
process /root
offers /root
accepts /root
LIST
"""

# Answered by a bottle, which a NAME_SERVER line does not end: over text_ack only.
STRUCTURED = """
announce /t
announce /t 0
announce /nope
subscribe /p /q
subscribe
subscribe /p
subscribe /p udp://q to
subscribe
subscribe topic://top /q
subscribe
topic
unsubscribe /p /q
subscribe
topic /second
topic
topic /second x
untopic /second
topic
type yarp /n v
type yarp /n
type foo /n
bot announce /t
bot subscribe
web
web /
web index.html
"""

# Ours refuses an empty name, which could not be told from others in an answer.
DIFFERENT = {"register", "query"}


def free_ports(servers, each=100):
    """Returns a port number for each of `servers`, with the next `each` free as well.

    A server gives those to the names it registers, and probes the holder of a name that is
    registered again: nothing may listen there, least of all the other server. The numbers lie below
    those that the system gives to connections.
    """
    with open("/proc/sys/net/ipv4/ip_local_port_range", encoding="ascii") as limits:
        end = int(limits.read().split()[0])
    found = []
    for first in random.sample(range(end // 2, end - each, each), (end // 2 - each) // each):
        held = [socket.socket() for _ in range(each)]
        try:
            for number, one in enumerate(held):
                one.bind(("", first + number))
            found.append(first)
        except OSError:
            pass
        finally:
            for one in held:
                one.close()
        if len(found) == servers:
            return found
    raise SystemExit("there are no free port numbers")



class Server:
    """A name server with a configuration directory of its own."""

    def __init__(self, command, port):
        self.home = tempfile.TemporaryDirectory()
        self.port = port
        words = ["--ip", "127.0.0.1", "--socket", str(self.port), "--write"]
        environment = dict(os.environ, YARP_CONFIG_HOME=self.home.name, YARP_DATA_HOME=self.home.name,
                           YARP_PORT_RANGE=str(self.port), YARP_FORWARD_LOG_ENABLE="0")
        self.child = subprocess.Popen([*TIED, *command, *words], env=environment, stdin=subprocess.DEVNULL,
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                if b"registration" in self.ask("query /root", text_ack=False):
                    return
            except OSError:
                pass
            if time.monotonic() > deadline or self.child.poll() is not None:
                raise SystemExit(f"{command} does not serve")
            time.sleep(0.1)

    def ask(self, request, text_ack):
        line, end = f"NAME_SERVER {request}\r\n", END
        if text_ack:
            line, end = f"CONNACK admin\r\nd\r\n{request}\r\n", ACK
        with socket.create_connection(("127.0.0.1", self.port), PATIENCE) as stream:
            stream.sendall(line.encode())
            answer = b""
            while not answer.endswith(end):
                if request.startswith("bot ") and not text_ack and answer.endswith(b"\n"):
                    # A bottle is one line and has no end; some of these are lines nevertheless.
                    stream.settimeout(0.5)
                try:
                    more = stream.recv(65536)
                except TimeoutError:
                    break
                if not more:
                    break
                answer += more
            return answer

    def masked(self, request, text_ack):
        text = self.ask(request, text_ack).decode(errors="replace")
        text = re.sub(r"\b127\.0\.0\.1\b|\b" + re.escape(own_address()) + r"\b", "ADDRESS", text)

        def number(found):
            distance = int(found.group(2)) - self.port
            return f"{found.group(1)}SERVER+{distance}" if 0 <= distance < 100 else found.group(0)

        text = re.sub(r"((?:port|port_number) )(\d+)", number, text)
        return re.sub(r"process = \d+", "process = N", re.sub(r"port \d+ type mcast", "port N type mcast", text))

    def end(self):
        self.child.kill()
        self.child.wait()
        self.home.cleanup()


def own_address():
    """The address that name servers take instead of the loopback."""
    words = subprocess.run(["hostname", "-I"], capture_output=True, text=True, check=False).stdout.split()
    return words[0] if words else "127.0.0.1"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--our-yarp", required=True)
    parser.add_argument("--stock-server", nargs="+", required=True)
    arguments = parser.parse_args()
    ours = stock = None
    failed = asked = 0
    try:
        first, second = free_ports(2)
        ours = Server([os.path.abspath(arguments.our_yarp), "server"], first)
        stock = Server(arguments.stock_server, second)
        plain = [line for line in REQUESTS.splitlines() if line]
        structured = [line for line in STRUCTURED.splitlines() if line]
        for request, text_ack in [(line, way) for line in plain for way in (False, True)] + \
                [(line, True) for line in structured]:
            if request in DIFFERENT:
                continue
            asked += 1
            answers = [server.masked(request, text_ack) for server in (ours, stock)]
            if answers[0] != answers[1]:
                failed += 1
                print(f"FAIL {request!r} over {'text_ack' if text_ack else 'NAME_SERVER'}:\n"
                      f"  ours  {answers[0]!r}\n  stock {answers[1]!r}")
    finally:
        for server in (ours, stock):
            if server:
                server.end()
    print(f"{asked - failed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
