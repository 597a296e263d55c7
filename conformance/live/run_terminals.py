"""Terminals for commands (`yarp run --stdio`): clients, servers of commands and servers of terminals of ours and of stock's.

    with_stock python run_terminals.py OUR_YARP

Needs a name server. A script stands for xterm: it runs what xterm would run, with a pipe for its keyboard and a file for its
screen. Prints `ok` or `FAIL` per check and ends with 1 if any failed. Checked with stock 3.5.0.
"""

import os
import re
import subprocess
import sys
import tempfile
import time

from checks import check, same, verdict
from tied import TIED

TIMEOUT = 60.0
# Stock's terminal gets one word for a shell, as xterm permits.
XTERM = """#!/bin/sh
cd "$(dirname "$0")"
[ -p keyboard ] || mkfifo keyboard
echo $$ > pid
echo "$*" > arguments
while [ "$1" != -e ]; do shift; done
shift
[ $# = 1 ] && set -- sh -c "exec $1"
"$@" <> keyboard > screen 2>&1 &
child=$!
# Stock's program then closes its ports, and ends when its terminal is gone, which a pipe is not.
trap 'kill -TERM $child; sleep 2; kill -KILL $child' TERM
wait $child
wait $child
"""
# What a command says without input is lost with stock, whose terminal connects itself later.
SHELL = 'sh -c "echo begin; while read a; do echo got $a; done"'


class Desk:
    """A server of commands that finds the script."""

    def __init__(self, folder, name, command):
        self.folder = os.path.join(folder, name.replace("/", "_"))
        self.name = name
        os.mkdir(self.folder)
        self.write("xterm", XTERM)
        os.chmod(os.path.join(self.folder, "xterm"), 0o755)
        environment = dict(os.environ, PATH=f"{self.folder}:{os.environ['PATH']}", HOME=self.folder)
        # Stock starts a login shell in its terminal.
        kept = (f"export {key}='{environment[key]}'\n" for key in ("PATH", "LD_LIBRARY_PATH"))
        self.write(".bash_profile", "".join(kept))
        self.process = subprocess.Popen([*TIED, *command, "--server", name], env=environment,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def write(self, name, text):
        with open(os.path.join(self.folder, name), "w", encoding="utf8") as file:
            file.write(text)

    def read(self, name):
        try:
            with open(os.path.join(self.folder, name), encoding="utf8", errors="replace") as file:
                return file.read()
        except FileNotFoundError:
            return ""

    def type(self, line):
        # Open for both, as is the window: it does not wait for a reader.
        keyboard = os.open(os.path.join(self.folder, "keyboard"), os.O_RDWR)
        os.write(keyboard, line.encode())
        os.close(keyboard)

    def screen(self):
        """What the window shows, without what libraries report about connections."""
        lines = self.read("screen").splitlines(keepends=True)
        return "".join(line for line in lines if not line.startswith("["))

    def window_runs(self):
        pid = self.read("pid").strip()
        try:
            with open(f"/proc/{pid}/stat", encoding="utf8") as file:
                return ") Z" not in file.read()
        except FileNotFoundError:
            return False


def becomes_true(condition):
    end = time.monotonic() + TIMEOUT
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.1)
    return True


def ask(client, server, *words):
    told = subprocess.run([*client, "--on", server, *words], capture_output=True, text=True, timeout=TIMEOUT)
    return told.returncode, told.stderr.partition("=========\n")[2]


def masked(reply):
    """A reply without ids of processes; the third value is the prefix of the ports."""
    return re.sub(r"^\d+$|(?<=pid=)\d+|(?<=/)\d+(?=/)|-\d+$", "9", reply, flags=re.MULTILINE)


def play(client, host, desk, more):
    """Runs a command on `host` with a terminal on `desk`; gives the masked reply."""
    tag = "tag"
    for name in ("screen", "pid"):
        desk.write(name, "")
    code, reply = ask(client, host.name, "--as", tag, "--stdio", desk.name, *more, "--cmd", SHELL)
    check("  it starts", code == 0, reply.replace("\n", "|"))
    line = "hello terminal\n"

    def is_shown():
        desk.type(line)
        return "got hello terminal\n" in desk.screen()

    check("  what is typed reaches the command, and its output the terminal", becomes_true(is_shown), desk.read("screen"))
    same("  the command runs", ask(client, host.name, "--isrunning", tag)[0], 0)
    same("  it is asked to end", ask(client, host.name, "--sigterm", tag)[0], 0)
    check("  the terminal closes", becomes_true(lambda: not desk.window_runs()))
    check("  no name is left", becomes_true(lambda: f"{host.name}/" not in names()), names())
    arguments = desk.read("arguments").partition(" -e ")[0]
    return masked(reply.replace(host.name, "HOST").replace(desk.name, "DESK")), arguments


def names():
    return subprocess.run([sys.argv[1], "name", "list"], capture_output=True, text=True, timeout=TIMEOUT).stdout


def main():
    ours = [sys.argv[1], "run"]
    stock = ["yarprun"]
    clients = {"ours": ours, "stock": stock}
    with tempfile.TemporaryDirectory() as folder:
        servers = {}
        for who, command in (("ours", [*ours, "--insecure"]), ("stock", stock)):
            servers[who] = [Desk(folder, f"/terminals/{who}{number}", command) for number in (1, 2)]
        try:
            for server in (*servers["ours"], *servers["stock"]):
                if not becomes_true(lambda: f"{server.name} " in names()):
                    raise SystemExit(f"run_terminals: gave up waiting for {server.name}")
            expected = {}
            # Of each server one has the command and the other one the terminal, or one has both.
            for number in (1, 0):
                for client in ("stock", "ours"):
                    for host in ("stock", "ours"):
                        for desk in ("stock", "ours") if number else (host,):
                            where = "on another server" if number else "on the same server"
                            print(f"client {client}, command {host}, terminal {desk}, {where}", flush=True)
                            more = ("--geometry", "80x24+1+2") if number else ()
                            played = play(clients[client], servers[host][0], servers[desk][number], more)
                            # Stock with itself comes first.
                            same("  reply and terminal are as with stock alone", played, expected.setdefault(number, played))
            window = servers["ours"][1]
            for host in ("ours", "stock"):
                print(f"held windows, command {host}", flush=True)
                for name in ("screen", "pid"):
                    window.write(name, "")
                words = ("--as", "held", "--stdio", window.name, "--hold", "--cmd", SHELL)
                same("  it starts", ask(stock, servers[host][0].name, *words)[0], 0)
                check("  the window is told to stay", becomes_true(lambda: window.read("arguments").startswith("-hold ")))
                ask(stock, servers[host][0].name, "--sigterm", "held")
                check("  its program ends with the command", becomes_true(lambda: not window.window_runs()))
        finally:
            for server in (*servers["ours"], *servers["stock"]):
                server.process.terminate()
            for server in (*servers["ours"], *servers["stock"]):
                try:
                    server.process.wait(5)
                except subprocess.TimeoutExpired:
                    server.process.kill()
                    server.process.wait()
    return verdict()


sys.exit(main())
