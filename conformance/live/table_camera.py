"""The cameras of a simulated table, as stock's `yarpview` looks at them: a buffered port, to which a camera is connected.

    with_stock python table_camera.py OUR_YARP

Starts a name server of ours. Prints `ok` or `FAIL` per check; ends with 1 if any failed.
"""

import os
import subprocess
import sys
import tempfile
import time

from checks import check, leave, same

OURS = sys.argv[1]
# Seconds that a step may take.
PATIENCE = 20


def eventually(found):
    deadline = time.time() + PATIENCE
    while time.time() < deadline:
        if found():
            return True
        time.sleep(0.1)
    return False


def look(yarp, camera, carrier, size):
    port = yarp.BufferedPortImageRgb()
    name = f"/view{camera}/{carrier}"
    check(f"a viewer of {camera} opens", port.open(name))
    check(f"and is connected by {carrier}", eventually(lambda: yarp.Network.connect(camera, name, carrier)))
    seen = []

    def comes():
        image = port.read(False)
        if image is not None:
            seen.append((image.width(), image.height(), {image.pixel(x, image.height() // 2).g for x in range(0, image.width(), 7)}))
        return len(seen) >= 3

    check("images come and go on coming", eventually(comes))
    width, height, values = seen[-1] if seen else (0, 0, set())
    same("they have the size of the sensor", (width, height), size)
    check("and show something", len(values) > 4, f"{len(values)} values in a row")
    port.close()


def main():
    with tempfile.TemporaryDirectory(prefix="table-camera-") as home:
        # A port of its own, since other suites run beside this one.
        own = {"YARP_CONFIG_HOME": home, "YARP_DATA_HOME": home, "YARP_PORT_RANGE": str(20000 + os.getpid() % 10000)}
        os.environ.update(own)
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        port = str(30000 + os.getpid() % 10000)
        server = subprocess.Popen([OURS, "server", "--write", "--port", port], **quiet)
        table = None
        try:
            check("a name server starts", eventually(lambda: os.path.exists(os.path.join(home, "yarp.conf"))))
            table = subprocess.Popen([OURS, "table", "--objects", "4", "--seed", "3"], **quiet)
            import yarp  # It reads the environment.
            yarp.Network.init()
            there = eventually(lambda: yarp.Network.exists("/camera") and yarp.Network.exists("/depth"))
            if not check("a table serves its cameras", there):
                return
            for carrier in ("tcp", "mjpeg"):
                look(yarp, "/camera", carrier, (1288, 964))
            look(yarp, "/depth", "tcp", (640, 480))
        finally:
            for process in filter(None, (table, server)):
                process.terminate()
                check("a server of ours ends when it is told", process.wait(PATIENCE) == 0, process.returncode)


main()
leave()
