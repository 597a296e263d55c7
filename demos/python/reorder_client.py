#!/usr/bin/env python3
"""Commands the slots of `yarp demo reorder --wait` through stock YARP's Python bindings: the objects in reverse order.

    yarp demo reorder --wait --objects 4 &
    python3 demos/python/reorder_client.py

Needs the module `yarp` of stock YARP. The demo starts a name server where the configuration says, unless one answers there. The demo ends when all objects are in their slots.
"""

import sys
import time

import yarp

ORDERS = "/reorder/rpc:i"
CLIENT = "/reorder_client/rpc:o"
# Seconds to wait for the demo's port.
PATIENCE = 30


def call(port, *words):
    """Sends words and numbers; returns the reply, or ends with the reason of a refusal."""
    request, reply = yarp.Bottle(), yarp.Bottle()
    for word in words:
        if isinstance(word, int):
            request.addInt32(word)
        else:
            request.addString(word)
    if not port.write(request, reply):
        raise SystemExit(f"{ORDERS} did not answer {request.toString()}")
    if reply.get(0).asString() == "fail":
        raise SystemExit(f"{request.toString()}: {reply.get(1).asString()}")
    return reply


def main():
    yarp.Network.init()
    port = yarp.RpcClient()
    if not port.open(CLIENT):
        raise SystemExit(f"cannot open {CLIENT}; is a name server running?")
    deadline = time.monotonic() + PATIENCE
    while not yarp.Network.connect(CLIENT, ORDERS):
        if time.monotonic() > deadline:
            raise SystemExit(f"no {ORDERS} after {PATIENCE} s; start `yarp demo reorder --wait`")
        time.sleep(0.5)
    objects = []
    while not objects and time.monotonic() < deadline:
        # Lists are parts of the reply: what is needed of them is copied while it is there.
        reply = call(port, "list")
        items = [reply.get(index).asList() for index in range(1, reply.size())]
        objects = [(item.get(0).asInt32(), item.get(1).asString()) for item in items]
        time.sleep(0.2)
    for slot, (number, label) in enumerate(reversed(objects)):
        print(f"object {number}, a {label}, into slot {slot}")
        call(port, "put", number, slot)
    call(port, "quit")
    port.close()
    yarp.Network.fini()


if __name__ == "__main__":
    sys.exit(main())
