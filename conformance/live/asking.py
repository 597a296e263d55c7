"""What suites ask of ports with stock's bindings, and how they wait."""

import time

import yarp

# Seconds that any single step may take.
PATIENCE = 30


def eventually(condition):
    """Whether `condition` is true in time."""
    end = time.monotonic() + PATIENCE
    while not (good := condition()) and time.monotonic() < end:
        time.sleep(0.02)
    return good


def until(what, condition):
    """What `condition` gives once that is true."""
    if not (good := eventually(condition)):
        raise SystemExit(f"FAIL gave up waiting for {what}")
    return good


def ask(port, request):
    """What the administration of a port answers."""
    style = yarp.ContactStyle()
    style.admin, style.timeout, style.quiet = True, PATIENCE, True
    answer = yarp.Bottle()
    if not yarp.Network.write(yarp.Contact(port), yarp.Bottle(request), answer, style):
        raise SystemExit(f"FAIL {port} does not answer {request}")
    return answer.toString()
