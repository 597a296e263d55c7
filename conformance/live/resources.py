"""Where files are found: stock's `yarp resource` and ours, asked the same about the same folders.

    python resources.py OUR_YARP WITH_STOCK

Needs no name server. Prints the questions that are answered differently and ends with 1 if any is.
Checked with stock 3.5.0.
"""

import itertools
import os
import re
import subprocess
import sys
import tempfile

# A file says on its line where it is.
FILES = """
here/a.ini here/sub/s.ini here/beside.ini
config/b.ini config/robots/default/r.ini config/robots/wam/r.ini config/contexts/app/c.ini
data/a.ini data/b.ini data/d.ini data/robots/wam/d.ini data/contexts/app/c.ini data/contexts/app/a.ini
sysconf/e.ini sysconf/b.ini sysconf/robots/wam/e.ini
shared1/f.ini shared1/e.ini shared2/f.ini shared2/g.ini shared2/contexts/app/g.ini
package1/h.ini package1/f.ini package2/h.ini package2/i.ini package2/robots/wam/i.ini package2/contexts/app/p.ini
other/o.ini
""".split()
PATHS = "[search one]\npath {0}/package1\n[search two]\npath {0}/package2 {0}/none\n"


def main():
    ours, with_stock = sys.argv[1:]
    differ = count = 0
    with tempfile.TemporaryDirectory() as root:
        for file in FILES:
            os.makedirs(os.path.dirname(f"{root}/{file}"), exist_ok=True)
            with open(f"{root}/{file}", "w") as out:
                out.write(f"at {file}\n")
        os.makedirs(f"{root}/shared2/config/path.d")
        with open(f"{root}/shared2/config/path.d/p.ini", "w") as out:
            out.write(PATHS.format(root))
        places = {
            "YARP_CONFIG_HOME": f"{root}/config",
            "YARP_DATA_HOME": f"{root}/data",
            "YARP_CONFIG_DIRS": f"{root}/sysconf",
            "YARP_DATA_DIRS": f"{root}/shared1:{root}/shared2",
        }
        homes = {"HOME": f"{root}/home", "XDG_CONFIG_HOME": f"{root}/xc", "XDG_DATA_HOME": f"{root}/xd",
                 "XDG_CONFIG_DIRS": f"{root}/x1:{root}/x2", "XDG_DATA_DIRS": f"{root}/x3"}
        for folder in ["xc", "xd", "x1", "x2", "x3", "home/.config", "home/.local/share"]:
            os.makedirs(f"{root}/{folder}/yarp/contexts/app")
            for name in ["x.ini", f"{folder.split('/')[-1]}.ini", "contexts/app/y.ini"]:
                with open(f"{root}/{folder}/yarp/{name}", "w") as out:
                    out.write(f"at {folder}/{name}\n")
        names = ["a.ini", "b.ini", "c.ini", "d.ini", "e.ini", "f.ini", "g.ini", "h.ini", "i.ini", "p.ini", "r.ini",
                 "s.ini", "sub/s.ini", "./a.ini", "none.ini", f"{root}/other/o.ini", "contexts/app/c.ini"]
        questions = []
        for robot, context, name in itertools.product([None, "wam"], [None, "app"], names):
            variables = dict(places, **({"YARP_ROBOT_NAME": robot} if robot else {}))
            questions.append((variables, (["--context", context] if context else []) + ["--find", name]))
        for name in ["a.ini", "sub/s.ini", "c.ini", "none.ini"]:
            questions.append((places, ["--context", "app", "--from", name, "--show", "--at", "mine"]))
        for left_out in [[], ["XDG_CONFIG_HOME", "XDG_DATA_HOME"], ["XDG_CONFIG_DIRS", "XDG_DATA_DIRS"]]:
            variables = {key: value for key, value in homes.items() if key not in left_out}
            for name in ["x.ini", "x1.ini", "x2.ini", "x3.ini", "y.ini", "xd.ini", "share.ini"]:
                questions.append((variables, ["--context", "app", "--find", name]))
        plain = {key: value for key, value in os.environ.items() if not re.match("YARP_|XDG_", key)}
        for variables, words in questions:
            said = []
            # `with_stock` sets a variable for its plugins.
            given = ["env", "-u", "YARP_DATA_DIRS", *(f"{key}={value}" for key, value in variables.items())]
            for command in ([*given, ours], [with_stock, *given, "yarp"]):
                ended = subprocess.run(command + ["resource"] + words, env=plain, cwd=f"{root}/here",
                                       capture_output=True, text=True, timeout=60)
                lines = [line for line in ended.stdout.splitlines() if line.endswith('"') or ">>> " in line]
                # Stock may put a slash too many, and what kind of line it is.
                lines = [re.sub(r'^\[\w+\] (\|[\w.]+\| )?', "", line).replace("//", "/") for line in lines]
                said.append((ended.returncode, lines))
            count += 1
            if said[0] != said[1]:
                differ += 1
                print(f"FAIL {words} {variables}\n     ours     {said[0]}\n     stock    {said[1]}")
    print(f"resources: {count - differ} of {count} alike")
    return 1 if differ else 0


sys.exit(main())
