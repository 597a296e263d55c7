"""Descriptions of robots: what stock makes of each file, and what ours does.

    with_stock python3 robot_files.py OUR_YARP READER FOLDER...

READER is `robot_reader.cpp`. All files `*.xml` below the folders that have an element `robot` are read by both: name, build and
prefix, devices with their types and resolved parameters, and actions of those that stock reads have to be the same. Prints the
numbers, and a line for each difference; ends with 1 if there is any. Checked with stock 4.0.0; 3.5.0 knows no `${portprefix}`
and fewer tags.
"""

import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

TIMEOUT = 60.0
# Of each file so many differences are printed.
PRINTED = 3


def robot_files(folders):
    for folder in folders:
        for place, _, names in sorted(os.walk(folder)):
            for name in sorted(names):
                path = os.path.join(place, name)
                if name.endswith(".xml") and os.path.isfile(path):
                    with open(path, "rb") as file:
                        if re.search(rb"<robot[\s>]", file.read()):
                            yield path


def of_stock(reader, files):
    """What stock makes of the files. It ends itself at some that it does not read."""
    found = {}
    while rest := [file for file in files if file not in found]:
        told = subprocess.run([reader], input="".join(f"{file}\n" for file in rest), capture_output=True, text=True, errors="replace")
        lines = re.findall("^ROBOT (.*)$", told.stdout, re.MULTILINE)
        found.update(zip(rest, map(json.loads, lines)))
        if len(lines) < len(rest):
            found[rest[len(lines)]] = {"ok": False}
    return found


def of_ours(yarp, file):
    told = subprocess.run([yarp, "robotinterface", "--config", file, "--dryrun", "--json"],
                          capture_output=True, text=True, errors="replace", timeout=TIMEOUT)
    if told.returncode != 0:
        lines = [line for line in told.stderr.splitlines() + told.stdout.splitlines() if line]
        return {"ok": False, "why": lines[-1] if lines else f"exit code {told.returncode}"}
    return json.loads(told.stdout) | {"ok": True}


def differences(stock, ours):
    if not stock["ok"]:
        return []
    if not ours["ok"]:
        return [f"ours does not read it: {ours['why']}"]
    found = [f"{key}: {ours[key]!r}, of stock {stock[key]!r}" for key in ("name", "build", "portprefix") if stock[key] != ours[key]]
    theirs, here = ([f"{device['name']} ({device['type']})" for device in robot["devices"]] for robot in (stock, ours))
    if theirs != here:
        return [*found, f"devices: {here}, of stock {theirs}"]
    for expected, got in zip(stock["devices"], ours["devices"]):
        name = expected["name"]
        expected_params = {key: values for key, *values in expected["params"]}
        # Stock adds these when it opens the device.
        got_params = {"device": [expected["type"]], "id": [name]} | got["params"]
        expected_params = {"device": [expected["type"]], "id": [name]} | expected_params
        for key in sorted(expected_params.keys() | got_params.keys()):
            if got_params.get(key) != expected_params.get(key):
                found.append(f"{name}: {key}: {got_params.get(key)}, of stock {expected_params.get(key)}")
        expected_actions = expected["actions"]
        got_actions = [[action["phase"], action["level"], action["type"], action["params"]] for action in got["actions"]]
        if got_actions != expected_actions:
            found.append(f"{name}: actions {got_actions}, of stock {expected_actions}")
    return found


def main():
    yarp, reader, *folders = sys.argv[1:]
    files = list(robot_files(map(os.path.abspath, folders)))
    stock = of_stock(reader, files)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        ours = dict(zip(files, pool.map(lambda file: of_ours(yarp, file), files)))
    differ = 0
    for file in files:
        found = differences(stock[file], ours[file])
        differ += bool(found)
        for line in found[:PRINTED]:
            print(f"differ {file}: {line[:1000]}")
    read = [file for file in files if stock[file]["ok"]]
    devices = sum(len(stock[file]["devices"]) for file in read)
    more = sum(ours[file]["ok"] and not stock[file]["ok"] for file in files)
    print(f"{len(files)} files, of which stock reads {len(read)} with {devices} devices; {differ} differ; ours reads {more} others")
    return 1 if differ or not read else 0


sys.exit(main())
