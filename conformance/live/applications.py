"""Applications of yarpmanager: programs and connections as stock's console reads them, and as `yarp manager` does.

    python applications.py OUR_YARP STOCK [FILE_OR_FOLDER ...]

STOCK is the folder of stock's installation. Without files those that it ships, and one with what TinyXML accepts and XML does not. The
console puts prefix and environment into one list, and gives programs without a node one of its own; both are taken into account.
Prints `ok` or `FAIL` per file and ends with 1 if any failed. Checked with stock 3.5.0.
"""

import glob
import json
import os
import re
import subprocess
import sys
import tempfile

from checks import same, verdict

TIMEOUT = 30
ODD = """<?xml version="1.0"?><!-- two -- dashes -->
<application><name>an odd ${n}</name><var name="n">one</var><var name="host">$ENV{ODD_HOST}</var>
<module><name>prog</name><parameters>--a "b c"  --r ${n}</parameters><node>${host}</node><prefix>/p</prefix>
<environment>A=1;B=2</environment></module>
<MODULE><name>second</name><node>localhost</node></MODULE>
<module><parameters>none</parameters></module>
<connection id=c1 persist="true"><from external="true">/a:o</from><to>/b:i</to></connection>
<connection><output>/${n}/c:o</output><input>/d:i</input><protocol>fast_tcp</protocol></connection>
<connection><from>/e</from></connection>
<Connection><from>/f</from><to>/g</to><protocol>tcp+send.portmonitor+type.dll+file.depthimage</protocol></Connection>
<bogus/></application>"""


def of_stock(stock, file):
    """Returns name, programs and connections that stock's console lists when it loads a file."""
    # It loads all applications of the folder that it runs in.
    with tempfile.TemporaryDirectory() as empty:
        console = subprocess.run([f"{stock}/bin/yarpmanager-console", "--application", os.path.abspath(file)], input="exit\n",
                                 text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=TIMEOUT, cwd=empty)
    text = re.sub(r"\x1b\[[0-9;]*m", "", console.stdout)
    part = lambda title, end: text.split(f"{title}: \n", 1)[1].split(f"\n{end}", 1)[0].strip()
    modules = re.findall(r"^\(\d+\) (.*?) \[(.*?)\] \[(.*)\] \[(.*)\]$", part("Modules", "\nConnections"), re.M)
    connections = re.findall(r"^\(\d+\) (\S+) - (\S+) \[(.*)\]$", part("Connections", "\nResources"), re.M)
    return part("Application", "\nModules"), modules, connections


def of_ours(yarp, file):
    """Returns the same as `yarp manager` tells it, in the console's form."""
    told = subprocess.run([yarp, "manager", "--dryrun", "--json", file], text=True, capture_output=True, timeout=TIMEOUT,
                          check=True)
    told = json.loads(told.stdout)
    modules = []
    for module in told["modules"]:
        prefix = module["prefix"] and f"YARP_PORT_PREFIX={module['prefix']}"
        environment = ";".join(filter(None, [prefix, module["environment"]]))
        modules.append((module["name"], module["node"], module["parameters"] or "", environment))
    connections = [(found["from"], found["to"], found["carrier"] or "") for found in told["connections"]]
    return told["name"], modules, connections


def main():
    yarp, stock, *places = sys.argv[1:]
    os.environ["ODD_HOST"] = "node1"
    with tempfile.TemporaryDirectory() as folder:
        if not places:
            places = glob.glob(f"{stock}/lib/python3*/site-packages/yarp/share/yarp/applications")
            odd = os.path.join(folder, "odd.xml")
            with open(odd, "w") as file:
                file.write(ODD)
            places.append(odd)
        files = []
        for place in places:
            files += sorted(glob.glob(f"{place}/**/*.xml", recursive=True)) if os.path.isdir(place) else [place]
        for file in files:
            name = os.path.basename(file)
            ours, modules, connections = of_ours(yarp, file)
            theirs = of_stock(stock, file)
            same(f"{name}: name", ours, theirs[0])
            # The console gives a program without a node one.
            same(f"{name}: number of programs", len(modules), len(theirs[1]))
            nodes = [other[1] for other in theirs[1]]
            modules = [(program, nodes[index] if node is None and index < len(nodes) else node, words, environment)
                       for index, (program, node, words, environment) in enumerate(modules)]
            same(f"{name}: programs", modules, theirs[1])
            same(f"{name}: connections", connections, theirs[2])
        if len(sys.argv) == 3:
            same("files of stock that were compared", len(files) > 1, True)
        else:
            same("files were compared", bool(files), True)
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
