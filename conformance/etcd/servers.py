"""Two of our name servers on three members of etcd, all in network namespaces, under load.

    servers.py OUR_YARP [--crashes N]      OUR_YARP is built with the feature `etcd`

One after the other: a member of etcd is killed, another is cut off; a name server is cut off, the other
is killed; one is killed again and again. All comes back each time. Throughout, clients register, look up
and take back names. Afterwards every acknowledged registration must be there and every acknowledged
end hold, at both servers; no number may have been handed out twice; programs of ours must have gone on by
themselves.

Needs root, iproute2 and etcd; fails, and never skips, where they are missing. Every wait has a deadline;
nothing is left behind. Prints `ok NAME` per check.
"""

import argparse
import ctypes
import itertools
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

# Seconds that a step may take.
PATIENCE = 60
# Seconds that a client of the load waits for an answer: longer than a server takes to refuse.
ANSWER = 6
# Names of this run's own, so that two runs do not meet.
RUN = os.getpid() % 100000
HUB = f"yeh{RUN}"
NET = "10.214.78"
MEMBERS = {f"ye{i}-{RUN}": f"{NET}.1{i}" for i in (1, 2, 3)}
SERVERS = {f"ys{i}-{RUN}": f"{NET}.2{i}" for i in (1, 2)}
CLIENT = {f"yec{RUN}": f"{NET}.31"}
PORT = 10000
# What the servers hand out: enough for all, few enough to be handed out again.
RANGE = "20000-20999"


class Failure(Exception):
    """A step did not come to its end."""


def ip(*words):
    """Runs `ip`."""
    done = subprocess.run(["ip", *words], capture_output=True, text=True)
    if done.returncode != 0:
        raise Failure(f"ip {' '.join(words)}: {done.stderr.strip()}; this needs root, network "
                      "namespaces and iproute2 (run where CAP_NET_ADMIN is granted)")


def network():
    """One namespace per host, each on a cable to a switch."""
    ip("netns", "add", HUB)
    ip("-n", HUB, "link", "add", "hub", "type", "bridge")
    ip("-n", HUB, "link", "set", "hub", "up")
    for host, address in {**MEMBERS, **SERVERS, **CLIENT}.items():
        ip("netns", "add", host)
        ip("-n", host, "link", "add", "eth0", "type", "veth", "peer", "name", host, "netns", HUB)
        ip("-n", HUB, "link", "set", host, "master", "hub", "up")
        ip("-n", host, "address", "add", f"{address}/24", "dev", "eth0")
        ip("-n", host, "link", "set", "lo", "up")
        ip("-n", host, "link", "set", "eth0", "up")
        # Multicast goes there, too.
        ip("-n", host, "route", "add", "default", "dev", "eth0")


def link(host, state):
    """Pulls the cable of a host out of the switch, or plugs it in again."""
    ip("-n", HUB, "link", "set", host, state)


def until(what, condition, patience=PATIENCE):
    """Waits until a condition holds; gives what it gave."""
    end = time.monotonic() + patience
    while True:
        result = condition()
        if result:
            return result
        if time.monotonic() > end:
            raise Failure(f"gave up waiting for: {what}")
        time.sleep(0.1)


class Program:
    """Something that runs on a host, and can be killed and started again."""

    def __init__(self, host, command, log, environment=None):
        self.command = ["ip", "netns", "exec", host, *command]
        self.log = log
        self.environment = dict(os.environ, **(environment or {}))
        self.child = None

    def start(self):
        with open(self.log, "ab") as log:
            self.child = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, stdout=log,
                                          stderr=log, env=self.environment)
        return self

    def kill(self, how=signal.SIGKILL):
        if self.child and self.child.poll() is None:
            self.child.send_signal(how)
            self.child.wait(PATIENCE)


def ask(address, request, patience=ANSWER):
    """One question to a name server; gives the lines of its answer, or an exception."""
    with socket.create_connection((address, PORT), timeout=patience) as link_:
        link_.settimeout(patience)
        link_.sendall(f"NAME_SERVER {request}\n".encode())
        text = b""
        while b"*** end of message" not in text:
            some = link_.recv(65536)
            if not some:
                raise OSError("the answer breaks off")
            text += some
    lines = text.decode().splitlines()
    if lines[0].startswith("refused: this name server cannot"):
        raise OSError(lines[0])
    return lines


class Load:
    """Clients that register, look up and take back names, and remember what they were told.

    Runs in a process that is on the client host.
    """

    CLIENTS = 4

    def __init__(self):
        self.lock = threading.Lock()
        self.stop = threading.Event()
        # Acknowledged and not taken back: name to number.
        self.held = {}
        # Numbers that an acknowledged name has that nobody has begun to take back.
        self.numbers = {}
        self.gone = set()
        self.problems = []
        # Registrations, by client.
        self.counts = [0] * self.CLIENTS
        self.uncertain = 0
        self.threads = [threading.Thread(target=self._client, args=(i,)) for i in range(self.CLIENTS)]

    def start(self):
        for thread in self.threads:
            thread.start()

    @property
    def acknowledged(self):
        """Registrations so far."""
        return sum(self.counts)

    def finish(self):
        self.stop.set()
        for thread in self.threads:
            thread.join(PATIENCE)

    def _client(self, index):
        addresses = itertools.cycle(list(SERVERS.values())[index % 2:] + list(SERVERS.values())[:index % 2])
        address = next(addresses)
        for count in itertools.count():
            if self.stop.is_set():
                return
            # Others shall have some of the machine.
            time.sleep(0.005)
            name = f"/load/{index}/{count}"
            try:
                lines = ask(address, f"register {name}")
            except OSError:
                # It may be there or not.
                self.uncertain += 1
                address = next(addresses)
                time.sleep(0.05)
                continue
            words = lines[0].split()
            if words[:3] != ["registration", "name", name]:
                self.problems.append(f"register {name}: {lines}")
                return
            number = int(words[6])
            with self.lock:
                self.counts[index] += 1
                if number in self.numbers:
                    self.problems.append(
                        f"number {number} was given to {name} while {self.numbers[number]} has it")
                self.numbers[number] = name
                self.held[name] = number
            # Every second one stays for a while, so that numbers are used again.
            if count % 4 == 0 and count < 200:
                continue
            with self.lock:
                del self.numbers[number]
                del self.held[name]
            try:
                ask(address, f"unregister {name}")
                self.gone.add(name)
            except OSError:
                self.uncertain += 1
                address = next(addresses)


def client(host):
    """Moves this process to a host."""
    with open(f"/run/netns/{host}") as space:
        if ctypes.CDLL(None, use_errno=True).setns(space.fileno(), 0) != 0:
            raise Failure(f"cannot enter the network namespace: {os.strerror(ctypes.get_errno())}")


def names(address):
    """Name to number, of all names of the load."""
    lines = ask(address, "list /load", PATIENCE)
    words = [line.split() for line in lines if line.startswith("registration name ")]
    return {word[2]: int(word[6]) for word in words}


def more(load, what, count=5):
    """Waits until each client of the load was acknowledged so many registrations more."""
    before = list(load.counts)
    begin = time.monotonic()
    until(f"{what}: requests are done", lambda: load.problems or all(
        now >= then + count for now, then in zip(load.counts, before)))
    if load.problems:
        raise Failure(f"{what}: {load.problems}")
    print(f"ok {what}: requests are done, {load.acknowledged} by now "
          f"({time.monotonic() - begin:.1f} s)", flush=True)


def knows(address, name):
    """Whether a server knows a port."""
    try:
        return f"name {name} " in ask(address, f"query {name}")[0]
    except OSError:
        return False


def lives(address, name):
    """Whether a server knows that a port is alive."""
    try:
        return any(line.endswith("state alive") for line in ask(address, f"state {name}"))
    except OSError:
        return False


def answers(address):
    """Whether a server does what changes something."""
    try:
        return ask(address, "set /nobody k v") is not None
    except OSError:
        return False


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("ours")
    parser.add_argument("--crashes", type=int, default=5)
    parser.add_argument("--with-stock", help="runs a tool of stock")
    options = parser.parse_args()
    ours = os.path.realpath(options.ours)
    for tool in ("ip", "etcd"):
        if not shutil.which(tool):
            raise Failure(f"{tool} is missing; conformance/etcd/setup.sh installs it")
    programs = []
    # What is killed has told the system by then: memory is as good as a disk.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(dir=memory) as work:
        log = os.path.join(work, "log")
        try:
            run(ours, options, work, log, programs)
        except BaseException:
            for name in sorted(os.listdir(work)):
                if name.startswith("log"):
                    with open(os.path.join(work, name), errors="replace") as text:
                        print(f"---- {name}", "".join(text.readlines()[-40:]), sep="\n")
            raise
        finally:
            for program in programs:
                program.kill()
            for host in [HUB, *MEMBERS, *SERVERS, *CLIENT]:
                subprocess.run(["ip", "netns", "delete", host], capture_output=True)


def run(ours, options, work, log, programs):
    network()
    members, servers = list(MEMBERS), list(SERVERS)

    def program(host, command, name, environment=None):
        made = Program(host, command, f"{log}-{name}", environment)
        programs.append(made)
        return made.start()

    cluster = ",".join(f"{host}=http://{address}:2380" for host, address in MEMBERS.items())
    etcd = {}
    for host, address in MEMBERS.items():
        etcd[host] = program(host, [
            "etcd", "--name", host, "--data-dir", os.path.join(work, host),
            "--listen-peer-urls", f"http://{address}:2380",
            "--initial-advertise-peer-urls", f"http://{address}:2380",
            "--listen-client-urls", f"http://{address}:2379",
            "--advertise-client-urls", f"http://{address}:2379",
            "--initial-cluster", cluster, "--initial-cluster-state", "new",
            "--auto-compaction-mode", "revision", "--auto-compaction-retention", "200",
        ], host)
    url = "etcd://" + ",".join(f"{address}:2379" for address in MEMBERS.values()) + "/lab"
    (host_c, _), = CLIENT.items()
    home = {"YARP_CONFIG_HOME": os.path.join(work, "home"), "YARP_DATA_HOME": work,
            "YARP_FORWARD_LOG_ENABLE": "0"}
    os.mkdir(home["YARP_CONFIG_HOME"])
    client(host_c)
    first, second = SERVERS.values()
    until("etcd has a leader", lambda: subprocess.run(
        ["etcdctl", "--endpoints", ",".join(f"{a}:2379" for a in MEMBERS.values()), "endpoint", "health"],
        env=dict(os.environ, ETCDCTL_API="3"), capture_output=True).returncode == 0)

    check_bad_input(ours, url, home)
    server = {}
    for host, address in SERVERS.items():
        command = [ours, "server", "--store", url, "--ip", address, "--socket", str(PORT), "--local",
                   "--ports", RANGE]
        server[host] = program(host, command, host, home)
    for address in SERVERS.values():
        until(f"{address} is ready", lambda: answers(address))
    print("ok both servers are ready", flush=True)

    with open(os.path.join(home["YARP_CONFIG_HOME"], "yarp.conf"), "w") as file:
        file.write(f"{first} {PORT} yarp\n{second} {PORT} yarp\n")
    # A program of ours that was there before, and looks after its name.
    reader = program(host_c, [ours, "read", "/early"], "early", home)
    until("/early is registered", lambda: knows(second, "/early"))

    load = Load()
    load.start()
    try:
        more(load, "at rest")
        etcd[members[0]].kill()
        more(load, "a member of etcd is killed")
        etcd[members[0]].start()
        link(members[1], "down")
        more(load, "another member is cut off")
        link(members[1], "up")
        more(load, "the member is back")
        check_without_majority(load, members, second)

        link(servers[0], "down")
        more(load, "a server is cut off")
        program(host_c, [ours, "read", "/late"], "late", home)
        until("/late is registered with the other server",
              lambda: knows(second, "/late"))
        until("/early speaks to the other server", lambda: lives(second, "/early"))
        print("ok programs of ours go on with the other server", flush=True)
        if options.with_stock:
            stock(options.with_stock, work, first, second)
        link(servers[0], "up")
        until("the server is back", lambda: answers(first))
        server[servers[1]].kill()
        more(load, "the other server is killed")
        until("/early is known there", lambda: knows(first, "/early"))
        server[servers[1]].start()
        until("the other server is back", lambda: answers(second))

        for count in range(options.crashes):
            more(load, f"before crash {count + 1}")
            server[servers[0]].kill()
            server[servers[0]].start()
            until("it is back", lambda: answers(first))
        more(load, "after the crashes")
    finally:
        load.finish()
    if load.problems:
        raise Failure(load.problems)

    for address in SERVERS.values():
        # The last news may be on their way.
        until(f"{address} knows every acknowledged name",
              lambda: load.held.items() <= names(address).items())
        found = names(address)
        back = load.gone & found.keys()
        if back:
            raise Failure(f"{address}: names that were taken back are there: {sorted(back)[:5]}")
        if len(set(found.values())) != len(found):
            raise Failure(f"{address}: a number was handed out twice: {found}")
    both = [names(address) for address in SERVERS.values()]
    if both[0] != both[1]:
        raise Failure("the servers do not agree")
    print(f"ok {load.acknowledged} registrations were acknowledged, {load.uncertain} requests were not; "
          f"{len(load.held)} names that must be there are, at both servers; no number twice", flush=True)
    for name in ("/early", "/late"):
        until(f"{name} has its name", lambda: knows(second, name))
    print("ok programs of ours have kept their names", flush=True)


def check_bad_input(ours, url, home):
    """What cannot be used is named, and left as it is."""
    etcdctl = ["etcdctl", "--endpoints", f"{list(MEMBERS.values())[0]}:2379"]
    version_3 = dict(os.environ, ETCDCTL_API="3")

    def put(key, value):
        subprocess.run([*etcdctl, "put", key, value], env=version_3, check=True, capture_output=True)

    def stored(prefix):
        got = subprocess.run([*etcdctl, "get", "--prefix", prefix], env=version_3, check=True,
                             capture_output=True, text=True)
        return got.stdout.split()

    put("/others/key", "value")
    put("/newer/format", "yarp-nameserver 2 5")
    base = url.removesuffix("/lab")
    for store, words in [
        ("etcd://nowhere", "no prefix follows the members"),
        ("sqlite:///lab", "it does not begin with etcd://"),
        (f"etcd://{list(CLIENT.values())[0]}:2379/lab", "is etcd running there"),
        (f"{base}/others", "holds data of another program: the key \"key\""),
        (f"{base}/newer", "format 2, this program knows 1"),
    ]:
        done = subprocess.run([ours, "server", "--store", store, "--local", "--socket", str(PORT)],
                              env=dict(os.environ, **home), capture_output=True, text=True,
                              timeout=PATIENCE)
        said = done.stdout + done.stderr
        if done.returncode == 0 or words not in said or "panicked" in said:
            raise Failure(f"--store {store}: no {words!r} in {said!r}, it ended with {done.returncode}")
    if stored("/others") != ["/others/key", "value"] or len(stored("/newer")) != 4:
        raise Failure("what others have in etcd was changed")
    print("ok what cannot be used is named and left", flush=True)


def check_without_majority(load, members, address):
    """Two of three members are cut off: changes are refused in words, questions are answered."""
    for host in members[:2]:
        link(host, "down")

    def refused():
        try:
            ask(address, "set /nobody k v")
        except OSError as error:
            return "this name server cannot: not committed within" in str(error)
        return False

    until("changes are refused in words", refused)
    until("questions are answered", lambda: knows(address, "/early"))
    print("ok without a majority changes are refused, questions are answered", flush=True)
    for host in members[:2]:
        link(host, "up")
    more(load, "the majority is back")


def stock(with_stock, work, first, second):
    """What stock's tools see when the only server that they know of is cut off."""
    home = os.path.join(work, "stock")
    os.mkdir(home)
    environment = dict(os.environ, YARP_CONFIG_HOME=home, YARP_FORWARD_LOG_ENABLE="0")

    def tool(*words):
        # Stock waits long for a host that does not answer.
        try:
            done = subprocess.run([with_stock, "yarp", *words], env=environment, capture_output=True,
                                  text=True, timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            return ""
        return done.stdout + done.stderr

    conf = os.path.join(home, "yarp.conf")

    def detected():
        # What is multicast may get lost.
        tool("detect", "--write")
        if not os.path.exists(conf):
            return False
        with open(conf) as file:
            return f"{second} {PORT}" in file.read()

    until("stock's `yarp detect --write` finds the other server", detected)
    until("stock finds /early", lambda: "name /early ip " in tool("name", "query", "/early"))
    print("ok stock goes on with the other server after `yarp detect --write`", flush=True)
    # An address that moves.
    floating = f"{NET}.100"
    host = list(SERVERS)[1]
    ip("-n", host, "address", "add", f"{floating}/24", "dev", "eth0")
    with open(conf, "w") as file:
        file.write(f"{floating} {PORT} yarp\n{first} {PORT} yarp\n")
    until("stock finds /early by the address that moves",
          lambda: "name /early ip " in tool("name", "query", "/early"))
    print("ok stock goes on by an address that moved, and does not mind a second line", flush=True)


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        print(f"FAILED: {failure}")
        sys.exit(1)
