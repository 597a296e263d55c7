"""What another host, and another user of the same host, may not do.

    untrusted_peers.py OUR_YARP

Hosts are network namespaces, as in `two_hosts`: host a has the name server and an arm, host b is
somebody else's. Needs root, iproute2 and setpriv; fails, and never skips, where they are missing.
Prints `ok NAME` per check.
"""

import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from two_hosts import A, ADDRESS_A, B, PATIENCE, Failure, Process, hosts

NOBODY = 65534
# Exit code of a program that another one connected to.
MET = 7
# The client's part of the program, on a host.
ASK = """
import socket, sys
host, number, text = sys.argv[1], int(sys.argv[2]), sys.argv[3]
with socket.create_connection((host, number), 20) as stream:
    stream.sendall(text.encode().decode("unicode_escape").encode())
    stream.shutdown(socket.SHUT_WR)
    stream.settimeout(20)
    answer = b""
    while more := stream.recv(65536):
        answer += more
sys.stdout.write(answer.decode(errors="replace"))
"""
failures = []


def check(title, passed, found):
    print(f"{'ok  ' if passed else 'FAIL'} {title}{'' if passed else ': ' + repr(found)}", flush=True)
    if not passed:
        failures.append(title)


def ask(host, number, text):
    """Sends text to a port of host a from a host; returns the answer."""
    done = subprocess.run(["ip", "netns", "exec", host, sys.executable, "-c", ASK, ADDRESS_A, str(number), text],
                          capture_output=True, text=True, timeout=PATIENCE)
    return done.stdout + done.stderr[-300:]


def admin(host, number, request):
    """Sends one administrative request in text mode; `a` in the header asks for an administrative connection."""
    return ask(host, number, f"CONNECT stranger\\r\\na\\r\\n{request}\\r\\n")


class Lab:
    """A name server and an arm on host a, with a configuration folder for each host."""

    def __init__(self, ours, home, roles=None, encrypted=False):
        self.ours, self.running = ours, []
        self.home_a, self.home_b = Path(home) / "a", Path(home) / "b"
        for folder in (self.home_a, self.home_b):
            folder.mkdir(parents=True)
        if roles:
            (self.home_a / "roles.conf").write_text(roles)
            (self.home_a / "roles.conf").chmod(0o600)
        if encrypted:
            other = self.home_a / "other"
            self.run(A, "keys", "init", "--required")
            self.run(A, "keys", "host", "b", "--out", str(other))
            shutil.copytree(other, self.home_b, dirs_exist_ok=True)
        self.start(A, "server", "--ip", ADDRESS_A, "--socket", "10000", "--write").see("Ok. Ready!")
        (self.home_b / "yarp.conf").write_text((self.home_a / "yarp.conf").read_text())
        self.start(A, "up", "--name", "/wam", "--bind", "0.0.0.0")
        self.wait_for("/wam/rpc:i")
        self.number = {name: self.where(name) for name in ("/wam/rpc:i", "/wam/command:i", "/root")}

    def start(self, host, *words):
        process = Process(host, str(self.home_a if host == A else self.home_b), self.ours, *words)
        self.running.append(process)
        return process

    def run(self, host, *words, typed=""):
        home = self.home_a if host == A else self.home_b
        done = subprocess.run(["ip", "netns", "exec", host, self.ours, *words], input=typed, text=True,
                              capture_output=True, timeout=PATIENCE,
                              env=dict(os.environ, YARP_CONFIG_HOME=str(home), YARP_FORWARD_LOG_ENABLE="0"))
        return done.stdout + done.stderr

    def wait_for(self, name):
        end = time.monotonic() + PATIENCE
        while "is available" not in (found := self.run(A, "exists", name, "--verbose")) and \
                "registration" not in self.run(A, "name", "query", name):
            if time.monotonic() > end:
                raise Failure(f"{name} does not come: {found}")
            time.sleep(0.2)

    def where(self, name):
        words = self.run(A, "name", "query", name).split()
        return int(words[words.index("port") + 1])

    def position(self):
        """The first joint, as the arm says it on its own host."""
        end = time.monotonic() + PATIENCE
        while "enc" not in (found := self.run(A, "rpc", "/wam/rpc:i", typed="get enc 0\n")):
            if time.monotonic() > end:
                raise Failure(f"the arm does not tell its position: {found}")
            time.sleep(0.2)
        return found.split("[tsta]")[0]

    def end(self):
        for process in self.running:
            process.kill()


def without_configuration(ours, home):
    lab = Lab(ours, home)
    try:
        found = lab.run(B, "rpc", "/wam/rpc:i", typed="get axes\n")
        check("another host may use a port, as in stock", "axes" in found, found)
        arm = lab.number["/wam/rpc:i"]
        monitor = "[atch] [in] \\\"(type dll) (file throttleDown) (period_ms 1e12)\\\""
        found = admin(B, arm, monitor)
        check("another host attaches no monitor", "[fail]" in found, found)
        found = lab.run(B, "rpc", "/wam/rpc:i", typed="get axes\n")
        check("... and requests are answered as before", "axes" in found, found)
        root = lab.number["/root"]
        for host, name, number, may in [(A, "/root", root, True), (B, "/root", root, False), (B, "/wam/rpc:i", arm, False)]:
            found = admin(host, number, f"[prop] [set] {name} (process ((policy 0) (priority 0)))")
            title = f"{'the own' if may else 'another'} host {'schedules' if may else 'does not schedule'} a process"
            check(title, ("[fail]" in found) != may and "Welcome" in found, found)
        lab.start(A, "read", "/reader")
        lab.wait_for("/reader")
        lab.run(A, "connect", "/wam/state:o", "/reader")
        state = lab.where("/wam/state:o")
        schedule = "[prop] [set] /reader (sched ((policy 0) (priority 0)))"
        for host, request, may in [(B, schedule, False), (A, schedule, True), (B, "[prop] [set] /reader (qos ((priority NORM)))", True)]:
            found = admin(host, state, request)
            what = "scheduling" if "sched" in request else "packet priority"
            title = f"{'the own' if host == A else 'another'} host {'sets' if may else 'does not set'} the {what} of a connection"
            check(title, ("[fail]" in found) != may and "Welcome" in found, found)
        found = lab.run(B, "name", "set", "/wam/rpc:i", "ips", "10.213.77.2")
        check("another host does not move a living name", "only /wam/rpc:i itself" in found, found)
        found = lab.run(B, "name", "register", "/wam/rpc:i", "tcp", "10.213.77.2", "4000")
        check("another host does not take a living name", "refused" in found, found)
        found = lab.run(B, "name", "query", "/wam/rpc:i")
        check("... which stays where it is", f"port {arm} " in found and ADDRESS_A in found, found)
    finally:
        lab.end()


def with_roles(ours, home):
    lab = Lab(ours, home, "[own]\nports /wam/*\nat local\nrights all\n[others]\nports /wam/*\nrights read\n")
    try:
        before = lab.position()
        arm = lab.number["/wam/rpc:i"]
        for number in (arm, lab.number["/wam/command:i"]):
            found = ask(B, number, f"GET /set/stos HTTP/1.1\\r\\nHost: {ADDRESS_A}:{number}\\r\\n\\r\\n")
            check("a page's address is no command of one who may only read", "not allowed: roles.conf" in found, found)
        found = lab.run(B, "rpc", "/wam/rpc:i", typed="set pos 0 20\n")
        check("nor is a request", "[ok]" not in found, found)
        found = admin(B, lab.number["/root"], "[add] /wam/command:i tcp+log.in")
        check("the name server copies nothing to the arm for another host",
              "[fail]" in found or "not allowed" in found, found)
        ask(B, lab.number["/root"], "CONNECT stranger\\r\\nd\\r\\n(1 0) (45.5 0 0 0 0 0 0)\\r\\n")
        time.sleep(1)
        check("the arm has not moved", lab.position() == before, (before, lab.position()))
        found = lab.run(A, "rpc", "/wam/rpc:i", typed="set pos 0 1\n")
        check("the own host moves it", "[ok]" in found, found)
    finally:
        lab.end()


def with_encryption(ours, home):
    """`required others`: plain connections stay within a host."""
    lab = Lab(ours, home, encrypted=True)
    try:
        found = lab.run(A, "rpc", "/wam/rpc:i", typed="get axes\n")
        check("programs of one host connect in plain", "axes" in found, found)
        found = lab.run(B, "rpc", "/wam/rpc:i", typed="get axes\n")
        check("programs of two hosts connect encrypted", "axes" in found, found)
        found = admin(B, lab.number["/wam/rpc:i"], "[ver]")
        check("another host does not connect in plain", "Welcome" not in found and "[ver]" not in found, found)
        found = admin(A, lab.number["/wam/rpc:i"], "[ver]")
        check("... as the own host does", "[ver]" in found, found)
        (lab.home_b / "tls.conf").unlink()
        found = lab.run(B, "rpc", "/wam/rpc:i", typed="get axes\n")
        check("nor does a program without a certificate", "axes" not in found, found)
    finally:
        lab.end()


class SocketOfAnotherUser(threading.Thread):
    """Takes connections over `unix_stream` as a port does, at sockets that a program of another user listens on.

    Root makes the sockets in the folder of the initiator; the system then has another user's program at their ends, as if
    the folder were shared.
    """

    def __init__(self, folder):
        super().__init__(daemon=True)
        self.folder, self.met = folder, False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.number = self.listener.getsockname()[1]

    def run(self):
        streams, children = [], []
        # The initiator may ask what is there before it connects.
        self.listener.settimeout(10)
        while True:
            try:
                stream, (_, initiator) = self.listener.accept()
            except TimeoutError:
                break
            streams.append(stream)
            children.append(self.listen(self.folder / f"{self.number}_{initiator}.sock"))
        for child in children:
            _, status = os.waitpid(child, 0)
            self.met |= os.waitstatus_to_exitcode(status) == MET

    @staticmethod
    def listen(path):
        """Starts a process that listens there, as the user of a process is that of all its threads."""
        child = os.fork()
        if child:
            return child
        try:
            local = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            local.bind(str(path))
            os.chmod(path, 0o777)
            os.setuid(NOBODY)
            local.listen(1)
            local.settimeout(5)
            local.accept()
            time.sleep(2)
            os._exit(MET)
        finally:
            os._exit(1)


def connect_as(user, number, folder):
    """Connects to a port over `unix_stream` as a user; returns whether the socket was reached, and what came over it.

    The folder and the socket are opened to everybody first, as if their modes kept nobody out: what remains is the port's
    look at the peer. Needs root.
    """
    header = socket.create_connection(("127.0.0.1", number), PATIENCE)
    name = b"/intruder\0"
    header.sendall(b"UNIX_STR" + len(name).to_bytes(4, "little") + name)
    path = folder / f"{number}_{header.getsockname()[1]}.sock"
    end = time.monotonic() + PATIENCE
    # The port restricts the mode right after it has made the socket.
    while not path.exists() or path.stat().st_mode & 0o777 != 0o700:
        if time.monotonic() > end:
            raise Failure(f"the port makes no socket at {path}")
        time.sleep(0.001)
    folder.chmod(0o711)
    path.chmod(0o777)
    # The system notes the user of the process that connects.
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.setuid(user)
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as local:
                local.settimeout(PATIENCE)
                local.connect(str(path))
                os.write(write, b"connected:")
                # `[ver]` to the administration, in binary: a list of one word.
                local.sendall(b"\0\0\0\0~a\0\1" + struct.pack("<iii4s", 256, 1, 9, b"ver"))
                os.write(write, local.recv(8))
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        reached, _, reply = pipe.read().partition(b":")
    os.waitpid(child, 0)
    header.close()
    folder.chmod(0o700)
    return reached == b"connected", reply


def other_user(ours, home):
    """A folder of sockets that another user made first, and a reader of another user's."""
    home = Path(home)
    os.chmod(home, 0o755)
    environment = dict(os.environ, HOME=str(home), YARP_CONFIG_HOME=str(home), YARP_DATA_HOME=str(home),
                       YARP_FORWARD_LOG_ENABLE="0")
    folders = {}
    for name, owner in (("theirs", NOBODY), ("own", 0)):
        folders[name] = home / name
        folders[name].mkdir(mode=0o700)
        os.chown(folders[name], owner, owner)
    running = []

    def start(*words, user=None, folder=None):
        prefix = ["setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups"] if user else []
        process = subprocess.Popen([*prefix, ours, *words], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   env=dict(environment, YARP_RUNTIME_DIR=str(folder or folders["own"])))
        running.append(process)
        return process

    def run(*words, folder=None, user=None):
        prefix = ["setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups"] if user else []
        done = subprocess.run([*prefix, ours, *words], capture_output=True, text=True, timeout=PATIENCE,
                              env=dict(environment, YARP_RUNTIME_DIR=str(folder or folders["own"])))
        return done.returncode, done.stdout + done.stderr

    def until(name):
        end = time.monotonic() + PATIENCE
        while run("exists", name)[0] != 0:
            ended = [(process.args, process.stdout.read()) for process in running if process.poll() is not None]
            if ended or time.monotonic() > end:
                raise Failure(f"{name} does not come; ended: {ended}")
            time.sleep(0.2)

    try:
        start("server", "--ip", "127.0.0.1", "--socket", "10000", "--write")
        until("/root")
        os.chmod(home / "yarp.conf", 0o644)
        # Who may connect to a reader whose folder of sockets belongs to somebody else.
        start("read", "/fooled", folder=folders["theirs"])
        start("read", "/theirs", user=NOBODY, folder=folders["theirs"])
        start("read", "/mine")
        start("write", "/writer")
        start("write", "/writer_fooled", folder=folders["theirs"])
        for name in ("/fooled", "/theirs", "/mine", "/writer", "/writer_fooled"):
            until(name)
        code, found = run("connect", "/writer", "/mine", "unix_stream")
        check("programs of one user talk through a socket", code == 0, found)
        code, found = run("connect", "/writer", "/fooled", "unix_stream")
        check("nobody talks through a folder that another user made first", code != 0, found)
        # Both are of one user and look for sockets in the same folder: only its owner is wrong.
        code, found = run("connect", "/writer_fooled", "/fooled", "unix_stream", folder=folders["theirs"])
        check("not even if both ends use it", code != 0, found)
        made = list(folders["theirs"].iterdir())
        check("... and no socket is left there", made == [], made)
        os.chown(folders["theirs"], 0, 0)
        code, found = run("connect", "/writer_fooled", "/fooled", "unix_stream", folder=folders["theirs"])
        check("... as they do once the folder is theirs", code == 0, found)
        os.chown(folders["theirs"], NOBODY, NOBODY)
        code, found = run("connect", "/writer", "/theirs", "unix_stream")
        check("nor with a program of another user", code != 0, found)
        impostor = SocketOfAnotherUser(folders["own"])
        impostor.start()
        run("name", "register", "/impostor", "unix_stream", "127.0.0.1", str(impostor.number))
        code, found = run("connect", "/writer", "/impostor", "unix_stream")
        impostor.join(PATIENCE)
        check("nor with one that listens in the own folder", code != 0 and impostor.met, (found, impostor.met))
        words = run("name", "query", "/mine")[1].split()
        number = int(words[words.index("port") + 1])
        reached, reply = connect_as(0, number, folders["own"])
        check("a port serves a program of its own user at a socket", reached and len(reply) == 8, (reached, reply))
        reached, reply = connect_as(NOBODY, number, folders["own"])
        check("... and none of another user, even where the modes let it in", reached and reply == b"", (reached, reply))
        code, found = run("connect", "/writer", "/theirs", "tcp")
        check("over tcp they talk, as everybody does", code == 0, found)
    finally:
        for process in running:
            process.kill()
            process.wait()


def main():
    ours = os.path.abspath(sys.argv[1])
    try:
        hosts()
        for suite in (without_configuration, with_roles, with_encryption):
            with tempfile.TemporaryDirectory() as home:
                suite(ours, home)
    finally:
        for host in (A, B):
            subprocess.run(["ip", "netns", "delete", host], capture_output=True)
    with tempfile.TemporaryDirectory() as home:
        other_user(ours, home)
    return 1 if failures else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failure as failure:
        sys.exit(f"FAIL {failure}")
