#!/usr/bin/env python3
"""Checks the vocabulary and the structure of the sources, and prints the counts.

`style.py check` exits with 1 and names each violation; `style.py report` prints the counts that CHANGELOG and the
decision records quote. Rules: docs/glossary.md, CONTRIBUTING.md.
"""

import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# File names in documents that stand for one to be chosen.
NAMES_TO_BE_CHOSEN = {"NAME.rs"}
OPENERS = re.compile(r"(What|Whether|How|Who|Where|As)\b")
CONSTANT = re.compile(r"\b(?:const|static) (PATIENCE|LOOK|LOOKS|PAUSE|SILENCE|SOON|LONG|FEW|MUCH|ROOM|AWAKE)\b")
MAX_FUNCTION_LINES = 100
# The highest share of items whose documentation may begin with a question word.
MAX_OPENER_SHARE = 0.02
# Crates whose limits docs/limits.md lists.
LIMITED_SOURCES = ("nameserver/src/", "ports/src/", "yarp-wire/src/")
# Names that have the same role wherever they stand.
SHARED_NAMES = {"mod.rs", "lib.rs", "main.rs"}
# Names of several files below `src/` that are about the same: an error per crate, a command and what it is for, the rows
# of a carrier and its messages.
RELATED_NAMES = SHARED_NAMES | {"error.rs", "camera.rs", "connect.rs", "rpc.rs", "shmem.rs", "time.rs"}


def sources():
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "*.rs"],
        cwd=ROOT, capture_output=True, check=True).stdout.decode()
    return [Path(name) for name in sorted(set(listed.split("\0"))) if name and (ROOT / name).is_file()]


def documented_items(lines):
    """Yields line number and first documentation line of each item: public or not, with fields, variants and options."""
    number = 0
    while number < len(lines):
        if not lines[number].lstrip().startswith("///"):
            number += 1
            continue
        first = number
        while number < len(lines) and lines[number].lstrip().startswith(("///", "#[")):
            number += 1
        # What a macro gets, or a doc comment in the middle of a function, belongs to no item.
        if number < len(lines) and lines[number].strip():
            yield first + 1, lines[first].lstrip()[3:].strip()


def functions(lines):
    """Yields line number, name and length of each function that is formatted as rustfmt does."""
    for number, line in enumerate(lines):
        head = re.match(r"(\s*)(?:pub(?:\([a-z]+\))? )?(?:async |const |unsafe )*fn (\w+)", line)
        if not head:
            continue
        close = head.group(1) + "}"
        for end in range(number, len(lines)):
            if lines[end] == close:
                yield number + 1, head.group(2), end - number + 1
                break
            if lines[end].rstrip().endswith(";") and (end == number or lines[end].startswith(head.group(1) + ")")):
                break


def is_table(lines):
    """Returns whether a function is little more than one `match` that lists values."""
    return sum("=>" in line or line.strip() in (")", "),", "}", "},") for line in lines) > len(lines) / 3


def alternatives(text):
    """Returns what `{a,b}` in a path stands for."""
    group = re.search(r"\{([^{}]*)\}", text)
    if not group:
        return [text]
    return [path for word in group[1].split(",") for path in alternatives(text[: group.start()] + word + text[group.end() :])]


def dead_paths():
    """Yields each path that a document names and that is not there, from the root, a crate, its `src/` or the document."""
    folders = [path for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(".") and path.name != "target"]
    places = [ROOT, *folders, *(path / "src" for path in folders)]
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    every_file = {Path(name).name for name in listed}
    documents = [ROOT / name for name in listed if name.endswith(".md") and not name.endswith("CHANGELOG.md")]
    for document in documents:
        for number, line in enumerate(document.read_text(encoding="utf8").splitlines(), 1):
            for text in re.findall(r"`([^`\s]+/[^`\s]*)`", line):
                is_ours = text.split("/")[0] in {path.name for path in folders} or re.search(r"\.(rs|py|sh|md|toml)$", text)
                if not is_ours or re.search(r'[<>$@:=|~"]|NAME|SERVER', text):
                    continue
                for path in alternatives(text.rstrip(".,;")):
                    if not any(list(place.glob(path)) for place in (*places, document.parent, document.parent / "src") if place.is_dir()):
                        yield f"{document.relative_to(ROOT)}:{number}: {path}"
            for name in re.findall(r"`(\w+\.(?:rs|py|sh))`", line):
                if name not in every_file and name not in NAMES_TO_BE_CHOSEN:
                    yield f"{document.relative_to(ROOT)}:{number}: {name}"


def undocumented_limits():
    """Yields each `MAX_...` of a crate that reads from the network that no line of docs/limits.md names with its file."""
    lines = (ROOT / "docs/limits.md").read_text(encoding="utf8").splitlines()
    for path in sources():
        if not str(path).startswith(LIMITED_SOURCES) or path.name.endswith("tests.rs"):
            continue
        for number, line in enumerate((ROOT / path).read_text(encoding="utf8").split("\n"), 1):
            if line.startswith("mod tests"):
                break
            found = re.match(r"\s*(?:pub(?:\([a-z]+\))? )?const (MAX_\w+):", line)
            # `mod.rs` alone names no file.
            file = "/".join(path.parts[-2:]) if path.name == "mod.rs" else path.name
            named = re.compile(rf"[`/]{re.escape(file)}`")
            if found and not any(f"`{found[1]}`" in row and named.search(row) for row in lines):
                yield f"{path}:{number}: add a row with `{found[1]}`, `{file}` to docs/limits.md"


def forgotten_tests():
    """Yields each file of a crate's `tests/` that no test program contains, if the crate lists its test programs."""
    for manifest in sorted(ROOT.glob("*/Cargo.toml")) + sorted(ROOT.glob("*/*/Cargo.toml")):
        text = manifest.read_text(encoding="utf8")
        if "autotests = false" not in text:
            continue
        listed = set(re.findall(r'\[\[test\]\]\nname = "(\w+)"', text))
        listed |= set(re.findall(r"^mod (\w+);", (manifest.parent / "tests/main.rs").read_text(encoding="utf8"), re.M))
        for path in sorted((manifest.parent / "tests").glob("*.rs")):
            if path.stem not in listed | {"main"}:
                yield f"{path.relative_to(ROOT)}: add `mod {path.stem};` to tests/main.rs: the test is not compiled"


def unrelated_names(paths):
    """Yields each name of several files below the `src/` of crates that `RELATED_NAMES` lacks, with the files."""
    names = defaultdict(list)
    for path in paths:
        parts = path.parts
        if "src" in parts and not {"fuzz", "tests", "examples", "bin"} & set(parts):
            names[path.name].append(str(path))
    for name, places in sorted(names.items()):
        if len(places) > 1 and name not in RELATED_NAMES:
            yield name, places


def measure():
    found = defaultdict(list)
    counts = defaultdict(int)
    names = defaultdict(list)
    for path in sources():
        text = (ROOT / path).read_text(encoding="utf8")
        lines = text.split("\n")
        counts["files"] += 1
        counts["lines"] += len(lines)
        names[path.name].append(path)
        tests = "/tests/" in f"/{path}" or path.name.endswith("tests.rs")
        for number, line in enumerate(lines, 1):
            banned = CONSTANT.search(line)
            if banned:
                found["constant"].append(f"{path}:{number}: {banned.group(1)}: name what it bounds (docs/glossary.md)")
            if line.startswith("//!") and (number == 1) and OPENERS.match(line[3:].strip()):
                found["opener"].append(f"{path}:{number}: begin with a noun or a verb: {line.strip()}")
        if not tests:
            for number, sentence in documented_items(lines):
                counts["items"] += 1
                if OPENERS.match(sentence):
                    found["opener"].append(f"{path}:{number}: begin with a verb: {sentence}")
        for number, name, length in functions(lines):
            if length > MAX_FUNCTION_LINES and not tests and not is_table(lines[number - 1 : number - 1 + length]):
                found["length"].append(f"{path}:{number}: {name} has {length} lines, at most {MAX_FUNCTION_LINES}")
    for name, paths in names.items():
        if len(paths) > 1 and name not in SHARED_NAMES:
            counts["shared names"] += 1
            found["name"].append(f"{name}: {', '.join(map(str, paths))}")
    return found, counts


def report(found, counts):
    openers = len(found["opener"])
    print(f"source files                                    {counts['files']}")
    print(f"lines                                           {counts['lines']}")
    print(f"documented items                                {counts['items']}")
    print(f"... that begin with What/Whether/How/Who/Where/As {openers} ({100 * openers / max(1, counts['items']):.1f} %)")
    print(f"constants that do not say what they bound       {len(found['constant'])}")
    print(f"functions over {MAX_FUNCTION_LINES} lines                        {len(found['length'])}")
    print(f"file names that occur more than once            {counts['shared names']}")


def check(found, counts):
    share = len(found["opener"]) / max(1, counts["items"])
    wrong = found["constant"] + found["length"]
    if share > MAX_OPENER_SHARE:
        wrong += found["opener"]
    wrong += [f"{place} is not there" for place in dead_paths()]
    wrong += forgotten_tests()
    wrong += undocumented_limits()
    wrong += [f"{', '.join(places)}: two files are called {name}; rename one" for name, places in unrelated_names(sources())]
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


def main():
    if len(sys.argv) != 2 or sys.argv[1] not in ("check", "report", "names"):
        print(__doc__, file=sys.stderr)
        return 2
    found, counts = measure()
    if sys.argv[1] == "report":
        report(found, counts)
        return 0
    if sys.argv[1] == "names":
        print("\n".join(found["name"]))
        return 0
    return check(found, counts)


if __name__ == "__main__":
    sys.exit(main())
