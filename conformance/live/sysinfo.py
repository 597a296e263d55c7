"""What a server of `yarp run` tells about its machine: all four combinations of servers and clients, stock's and ours.

    with_stock python sysinfo.py OUR_YARP

Needs a name server. Everything that does not change from moment to moment has to be the same, but for the distribution, which
ours takes from /etc/os-release, and the environment, which ours keeps to itself. Prints `ok` or `FAIL` per comparison and ends
with 1 if any failed. Checked with stock 3.5.0.
"""

import subprocess
import sys
import time

from checks import check, same, verdict
from tied import TIED

TIMEOUT = 60.0
# Values of the moment, and those that differ on purpose.
VARIABLE = ("Cpu load", "Memory free", "Storage free", "Processor Mhz", "Platform dist")


def lines(command, server):
    """The lines about the machine, and what follows the heading of the environment."""
    told = subprocess.run([*command, "--on", server, "--sysinfo"], capture_output=True, text=True, timeout=TIMEOUT)
    text = told.stdout.partition("=========\n")[2]
    machine, _, environment = text.partition("Environment variables  :\n")
    return told.returncode, [line for line in machine.splitlines() if not line.startswith(VARIABLE)], environment.strip()


def main():
    ours = sys.argv[1]
    servers = {"ours": [ours, "run", "--server", "/sysinfo/ours", "--insecure"], "stock": ["yarprun", "--server", "/sysinfo/stock"]}
    clients = {"ours": [ours, "run"], "stock": ["yarprun"]}
    running = [subprocess.Popen([*TIED, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for words in servers.values()]
    try:
        for server in servers:
            end = time.monotonic() + TIMEOUT
            while subprocess.run([ours, "exists", f"/sysinfo/{server}"], stdout=subprocess.DEVNULL, timeout=TIMEOUT).returncode:
                if time.monotonic() > end:
                    raise SystemExit(f"sysinfo: gave up waiting for the server of {server}")
                time.sleep(0.1)
        code, expected, environment = lines(clients["stock"], "/sysinfo/stock")
        check("stock tells of its machine", code == 0 and any("Platform kernel" in line for line in expected), len(expected))
        check("and of its environment", "PATH" in environment, len(environment))
        for client, server in [("ours", "stock"), ("stock", "ours"), ("ours", "ours")]:
            code, got, told = lines(clients[client], f"/sysinfo/{server}")
            same(f"client {client}, server {server}", (code, got), (0, expected))
            same("  its environment", told == environment if server == "stock" else told, True if server == "stock" else "")
    finally:
        for process in running:
            process.terminate()
        for process in running:
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    return verdict()


sys.exit(main())
