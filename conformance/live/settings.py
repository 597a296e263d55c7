"""Configuration files and command lines: what stock's Property makes of them, and what ours does.

    with_stock python settings.py OUR_EXAMPLE

Written by hand and at random. Needs no name server. Prints the texts that differ and ends with 1 if any does.
Checked with stock 3.5.0.
"""

import os
import random
import re
import shlex
import subprocess
import sys
import tempfile

import yarp

FILES = {
    "plain.ini": "a 1\nb = 2\nc\nd 1 (2 3) 4.5 \"x y\" [vo] {1 2}\ne true\nf inf nan null\n",
    "groups.ini": "[g]\na 1\nb = 2\n[]\nc 3\n[h]\n[g]\nd 4\n[k l]\nx 1\n[k m]\ny (1 (2 3))\n[a b c]\nz 1\n[ s ]\nw 1\n",
    "odd.ini": " [g]\na 1\n[g\nb 1\n[]x\nc 1\n[g]]\nd 1\n=\nk = = 2\n1 2\n(1 2) 3\n[] 3\n",
    "remarks.ini": "# a 1\na 1 // x\nb 2 # x\nc a#b\nd \"a//b\"\n//\ne 1/2 /3\n#\n  # x\nf (1 # 2\n3)\ng \"#\" # \"\n",
    "lines.ini": "a (1\n2)\nb \"x\ny\"\nc 1\\\n2\nd \\\\ \\x \\\"\ne 1\r\nf {1\n2}\n",
    "open.ini": "[g]\na 1\nb (1\nc 2\n[h]\n",
    "quote.ini": "[g]\na 1 # don't \"\nb 2\n\"\nc 3\n",
    "variables.ini": "a 5\nb $a ${a}0 $(a)\nc $HOSTING_X/y $NONE \\$a\nd (1 2)\ne $d ${__YARP__} $CONFIG_PATH\n[g]\nx 7\ny $x $a\n[$a]\nz 1\n$a 3\n",
    "include.ini": "a 1\n[include part.ini]\nb $p\n[include grp part.ini]\nstray 1\n[grp]\nmore 1\n[include l other sub/o.ini]\n[include none.ini]\n[include grp2 none.ini]\n[include l other2 \"sub\"]\nend 1\n",
    "part.ini": "p 1\nq \"inf\" \"a b\" \"5\" 0.1\n[in]\nz 3\n",
    "again.ini": "[grp]\nx 1\np 0\nlone\n[other]\n[include grp part.ini]\n[include grp sub/o.ini]\n",
    "bad.ini": "a 1\n[g]\nb 1\n[include a b c d]\nc 1\n",
    "merge.ini": "g 5\n[g]\na 1\n[l g]\n[l]\nb 1\n[l h]\n",
    "sub/o.ini": "o 1\n[include near.ini]\n[include part.ini]\n",
    "sub/near.ini": "n 1\n",
}
WORDS = [
    "--name /a --flag --n 1 -2 3.5",
    "lead --a 1 -- b --c",
    "--a::b 1 --a::c 2 --d 3",
    "--a::b::c 1 --a::b::d 2 --a 4",
    "--a 1 --a::b 2 --a::b 3",
    '--l "(1 2)" --m "a b" --n "(1 (2 3)) 4"',
    "--a:: 1 --::b 2",
    "--5 x --true y",
    "--p c:\\x\\y",
    '--a "(b 1)" --a::b 2',
    '--a::b "(1 2)" --a::b::c 3',
]
HEADS = ["[g]", "[h]", "[l g]", "[]", "[ g]", "[g", "[g]x", "[include part.ini]", "[include g part.ini]", "[include l g sub/o.ini]", "[a b c]"]
PIECES = ["a", "b", "g", " ", " ", "(", ")", '"', "\\", "$a", "${a}", "$(g)", "//", "#", "=", "1", "2.5", "{", "}", "inf", ",", "\t", "\r", "[b]"]


def explained(text, got):
    """Where ours differs on purpose, as `bottle_text.py` says: words of more than four characters, floats in blobs."""
    return re.search(r"\[[^ ()]{5,}", got) or re.search(r"\[b\][^\s,]", text) or re.search(r"\{[^}]*inf", text)


def random_text(rng):
    """Lines of heads and of anything; heads only at the start, since stock cuts words in brackets, and we do not."""
    lines = []
    for _ in range(rng.randrange(1, 9)):
        if rng.random() < 0.3:
            lines.append(rng.choice(HEADS))
        else:
            lines.append("".join(rng.choices(PIECES, k=rng.randrange(1, 8))))
    return rng.choice(["\n", "\n", "\r\n"]).join(lines)


def main():
    ours = subprocess.Popen([sys.argv[1]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8",
                            errors="surrogateescape", env={**os.environ, "HOSTING_X": "there"})
    os.environ["HOSTING_X"] = "there"
    yarp.Network.setLocalMode(True)

    def ask(line):
        ours.stdin.write(line + "\n")
        ours.stdin.flush()
        return ours.stdout.readline().rstrip("\n")

    differ, count = 0, 0

    def check(name, text, expected, got):
        nonlocal differ, count
        count += 1
        if got != expected and not explained(text, got):
            differ += 1
            print(f"FAIL {name}\n     text     {text!r}\n     stock    {expected!r}\n     ours     {got!r}")

    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(f"{folder}/sub")
        for name, text in FILES.items():
            with open(f"{folder}/{name}", "w", newline="") as file:
                file.write(text)
        rng = random.Random(3)
        texts = dict(FILES)
        for n in range(3000):
            text = random_text(rng)
            texts[f"random{n}.ini"] = text
            with open(f"{folder}/random{n}.ini", "w", newline="") as file:
                file.write(text)
        for name, text in [*texts.items(), ("sub", "(a directory)")]:
            stock = yarp.Property()
            stock.fromConfigFile(f"{folder}/{name}")
            check(name, text, stock.toString(), ask(f"file {folder}/{name}"))
    for words in WORDS:
        stock = yarp.Property()
        stock.fromArguments("x " + words)
        check("words", words, stock.toString(), ask("words " + "\x1f".join(shlex.split(words.replace("\\", "\\\\")))))
    ours.stdin.close()
    ours.wait()
    print(f"settings: {count - differ} of {count} alike")
    return 1 if differ else 0


sys.exit(main())
