"""Terminals for commands (`yarp run --stdio`): clients, servers of commands and servers of terminals of ours and of stock's.

    with_stock python run_terminals.py OUR_YARP

Needs a name server. A script stands for xterm: it runs what xterm would run, with a pipe for its keyboard and a file for its
screen. Prints `ok` or `FAIL` per check and ends with 1 if any failed. Checked with stock 3.5.0.
"""

import contextlib
import os
import re
import signal
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

# Requests without a command, without a session, with words for other values and with options of programs in the place of names.
MALFORMED = (
    "nonsense", "()", "17 (18 (19))", "(stdio)", "(stdio 17)", "(stdio \"\") (on SERVER)", "(stdio /other) (as t)",
    "(stdio /other) (cmd sh) (as t)", "(stdio /other) (on SERVER)", "(stdio /other) (stdiouuid 17)",
    "(stdio /other) (stdiouuid --server)", "(stdio /other) (stdiouuid \"/a b\")",
    "(stdio /other) (stdiouuid /s) (forward)", "(stdio /other) (stdiouuid /s) (forward --on -x)",
    "(stdio /nobody) (cmd sh) (as t) (on SERVER)", "(stdio SERVER) (cmd /no/such/program) (as \"../..\") (on SERVER)",
    "(stdio SERVER) (cmd) (as t) (on SERVER)", "(stdio SERVER) (cmd \"\") (on SERVER)", "(cmd)", "(cmd \"\")", "(kill)", "(kill t)",
    "(kill t 9999999)", "(killstdio)", "(killstdio t 17)", "(sigterm)", "(isrunning (1 2))", "(which)",
    "(stdio /other) (as " + "t" * 20000 + ")", "(" * 30 + ")" * 30,
)


class Server:
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


def play(client, host, terminal, more):
    """Runs a command on `host` with a terminal on `terminal`; gives the masked reply."""
    tag = "tag"
    for name in ("screen", "pid"):
        terminal.write(name, "")
    code, reply = ask(client, host.name, "--as", tag, "--stdio", terminal.name, *more, "--cmd", SHELL)
    check("  it starts", code == 0, reply.replace("\n", "|"))
    line = "hello terminal\n"

    def is_shown():
        terminal.type(line)
        return "got hello terminal\n" in terminal.screen()

    check("  what is typed reaches the command, and its output the terminal", becomes_true(is_shown), terminal.read("screen"))
    same("  the command runs", ask(client, host.name, "--isrunning", tag)[0], 0)
    same("  it is asked to end", ask(client, host.name, "--sigterm", tag)[0], 0)
    check("  the terminal closes", becomes_true(lambda: not terminal.window_runs()))
    check("  no name is left", becomes_true(lambda: f"{host.name}/" not in names()), names())
    arguments = terminal.read("arguments").partition(" -e ")[0]
    return masked(reply.replace(host.name, "HOST").replace(terminal.name, "TERMINAL")), arguments


def kill_processes(process, is_chosen):
    """Kills a process and the chosen ones of its descendants: stock's server leaves its work to a child, which has children."""
    chosen, found = [], [process.pid]
    while found:
        pid = found.pop()
        # Before anything is killed, whose children would change.
        found += map(int, subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, timeout=TIMEOUT).stdout.split())
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            if pid == process.pid or is_chosen(file.read().split(b"\0")):
                chosen.append(pid)
    for pid in chosen:
        os.kill(pid, signal.SIGKILL)
    process.wait()


def started_processes(server):
    """What a server of ours says that it runs."""
    return ask([sys.argv[1], "run"], server.name, "--ps")[1]


def killed_command_server(folder, stock, terminal):
    """Kills stock's server of a command that has a terminal on a server of ours."""
    victim = Server(folder, "/terminals/killed1", stock)
    becomes_true(lambda: f"{victim.name} " in names())
    for name in ("screen", "pid"):
        terminal.write(name, "")
    shell = SHELL.replace("echo begin", f"echo $$ > {victim.folder}/command")
    same("  it starts", ask(stock, victim.name, "--as", "tag", "--stdio", terminal.name, "--cmd", shell)[0], 0)
    becomes_true(lambda: terminal.type("before\n") or "got before\n" in terminal.screen())
    # The ports of the command, which are processes of their own, die with it, and leave their names.
    kill_processes(victim.process, lambda words: words[0] != b"sh")
    check("  the terminal closes", becomes_true(lambda: not terminal.window_runs()), names())
    with contextlib.suppress(ProcessLookupError):
        os.kill(int(victim.read("command")), signal.SIGKILL)
    check("  no name of the terminal is left", becomes_true(lambda: "/stdio:" not in names()), names())
    same("  its server has nothing left", started_processes(terminal), "")


def killed_terminal_server(folder, ours, stock, host):
    """Kills stock's server of a terminal whose command is on a server of ours, and then the terminal."""
    victim = Server(folder, "/terminals/killed2", stock)
    becomes_true(lambda: f"{victim.name} " in names())
    same("  it starts", ask(ours, host.name, "--as", "tag", "--stdio", victim.name, "--cmd", SHELL)[0], 0)
    becomes_true(lambda: victim.type("before\n") or "got before\n" in victim.screen())
    kill_processes(victim.process, lambda words: b"--server" in words)
    os.kill(int(victim.read("pid")), signal.SIGTERM)
    check("  the window is gone", becomes_true(lambda: not victim.window_runs()))
    same("  the command goes on", ask(ours, host.name, "--isrunning", "tag")[0], 0)
    same("  and is asked to end", ask(ours, host.name, "--sigterm", "tag")[0], 0)
    check("  no name is left", becomes_true(lambda: f"{host.name}/" not in names()), names())
    same("  its server has nothing left", started_processes(host), "")


def malformed(server):
    """Sends requests that are none to a server of ours, with `yarp rpc` of stock."""
    for request in MALFORMED:
        request = request.replace("SERVER", server.name)
        told = subprocess.run(["yarp", "rpc", server.name], input=request + "\n", capture_output=True, text=True, timeout=TIMEOUT)
        reply = "".join(line for line in told.stdout.splitlines() if line.startswith("Response: "))
        check(f"  {request[:60]} is answered", bool(reply), told.stdout + told.stderr)
        # What a command needs is there before it; its terminal closes then.
        check("  and starts no command", "STARTED" not in reply or "ABORTED" in reply, reply)
    same("  the server runs nothing", started_processes(server), "")
    check("  no window is open", becomes_true(lambda: not server.window_runs()))
    check("  it has no port but its own", f"{server.name}/" not in names(), names())


def names():
    return subprocess.run([sys.argv[1], "name", "list"], capture_output=True, text=True, timeout=TIMEOUT).stdout


def main():
    ours = [sys.argv[1], "run"]
    stock = ["yarprun"]
    clients = {"ours": ours, "stock": stock}
    with tempfile.TemporaryDirectory() as folder:
        servers = {}
        for who, command in (("ours", [*ours, "--insecure"]), ("stock", stock)):
            servers[who] = [Server(folder, f"/terminals/{who}{number}", command) for number in (1, 2)]
        try:
            for server in (*servers["ours"], *servers["stock"]):
                if not becomes_true(lambda: f"{server.name} " in names()):
                    raise SystemExit(f"run_terminals: gave up waiting for {server.name}")
            expected = {}
            # Of each server one has the command and the other one the terminal, or one has both.
            for number in (1, 0):
                for client in ("stock", "ours"):
                    for host in ("stock", "ours"):
                        for terminal in ("stock", "ours") if number else (host,):
                            where = "on another server" if number else "on the same server"
                            print(f"client {client}, command {host}, terminal {terminal}, {where}", flush=True)
                            more = ("--geometry", "80x24+1+2") if number else ()
                            played = play(clients[client], servers[host][0], servers[terminal][number], more)
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
            print("stock's server of a command is killed, terminal ours", flush=True)
            killed_command_server(folder, stock, servers["ours"][1])
            print("stock's server of a terminal is killed, command ours", flush=True)
            killed_terminal_server(folder, ours, stock, servers["ours"][0])
            print("malformed requests by stock's yarp rpc", flush=True)
            servers["ours"][0].write("pid", "")
            malformed(servers["ours"][0])
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
