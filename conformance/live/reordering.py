"""The example client in Python commands `yarp demo reorder --wait` with stock's bindings, as its description says.

    with_stock python reordering.py OUR_YARP

The demo starts the name server. Prints `ok` or `FAIL` per check; ends with 1 if any failed.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

from checks import check, leave

OURS = sys.argv[1]
CLIENT = os.path.join(os.path.dirname(__file__), "../../demos/python/reorder_client.py")
# Seconds that a step may take.
PATIENCE = 240


def main():
    with tempfile.TemporaryDirectory(prefix="reordering-") as home:
        # A port of its own, since other suites run beside this one.
        environment = dict(os.environ, YARP_CONFIG_HOME=home, YARP_DATA_HOME=home, YARP_PORT_RANGE=str(20000 + os.getpid() % 10000))
        demo = subprocess.Popen(
            [OURS, "demo", "reorder", "--wait", "--objects", "2", "--seed", "7004", "--speed", "2", "--detector", "truth", "--json"],
            env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            # The client waits for the name server and the demo itself, but not for the file that tells where the former is.
            while not os.path.exists(os.path.join(home, "yarp.conf")) and demo.poll() is None:
                time.sleep(0.1)
            client = subprocess.run([sys.executable, CLIENT], env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False)
            check("the client with stock's bindings commands both objects", client.returncode == 0 and client.stdout.count(" into slot ") == 2 and "a , into" not in client.stdout,
                  client.stdout + client.stderr)
            said, log = demo.communicate(timeout=PATIENCE)
            result = json.loads(said) if said.strip() else {}
            check("both stand in the slots that it commanded", result.get("placed") == 2 and result.get("objects") == 2, said + log[-2000:])
        finally:
            demo.kill()
    leave()


if __name__ == "__main__":
    main()
