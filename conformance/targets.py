#!/usr/bin/env python3
"""Prints the structure targets of the project as a table: an earlier commit beside the working tree.

    targets.py [--base COMMIT]     COMMIT is 4318c36 unless given; `-` leaves it out

Everything is counted from the sources of the two trees by the same code. The size of the binary is that of
target/release/yarp, if it has been built.
"""

import argparse
import functools
import io
import os
import re
import subprocess
import tarfile
import tempfile
from collections import defaultdict
from pathlib import Path

import style

# Crates from the lowest to the highest: each may depend on those before it.
ORDER = [
    "yarp-testing", "yarp-wire", "yarp-ports", "yarp-devices", "yarp-nameserver", "yarp-wrappers", "yarp-hosting",
    "yarp-client-derive", "yarp-client", "yarp-planning", "yarp-table", "yarp-manipulation", "yarp-vision", "yarp-view",
    "yarp-demos", "yarp-cli", "yarp-conformance",
]
# Definitions of which there should be one.
COPIES = {
    "definitions of the port 10000": r"^(?:pub )?(?:\(crate\) )?const DEFAULT_PORT\b",
    "generators of random numbers": r"0x9E37_?79B9_?7F4A_?7C15|6_?364_?136_?223_?846_?793_?005|<< 13;",
    "helpers that poll, without tasks": r"^(?:pub(?:\(crate\))? )?fn (?:until|eventually)\b(?!.*impl Future)",
    "functions for hexadecimal text": r"^\s*(?:pub )?fn (?:to_hex|from_hex|hex)\b",
    "backoffs": r"struct Backoff\b",
    "periodic timers": r"struct PeriodicTimer\b|^fn every\(",
}


def files(root, ending):
    """Returns the files with this ending, without walking through what was built."""
    found = []
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if name not in ("target", ".git"))
        found += [Path(folder) / name for name in sorted(names) if name.endswith(ending)]
    return found


@functools.cache
def rust_files(root):
    return files(root, ".rs")


def copies(root, pattern):
    expression = re.compile(pattern, re.M)
    return sum(bool(expression.search(path.read_text(encoding="utf8"))) for path in rust_files(root))


def imports(crate_source, path, text):
    """Yields the files of the same crate that a file imports from."""
    for match in re.finditer(r"\b(crate|(?:super::)+)(?:::)?((?:\w+::)*\w+)", text):
        start, words = match.groups()
        base = crate_source
        if start != "crate":
            base = path.parent if path.name != "mod.rs" else path.parent.parent
            for _ in range(start.count("super") - 1):
                base = base.parent
        place = base
        for word in words.split("::"):
            file, folder = place / f"{word}.rs", place / word / "mod.rs"
            if file.is_file() and file != path:
                yield file
                place = place / word
            elif folder.is_file() and folder != path:
                place = place / word
            else:
                break


def cycles(root):
    """Returns the number of pairs of files, neither of which contains the other as a module, that import each other."""
    edges = defaultdict(set)
    for path in rust_files(root):
        parts = path.relative_to(root).parts
        if "src" not in parts or "tests" in parts:
            continue
        source = root.joinpath(*parts[: parts.index("src") + 1])
        text = re.split(r"^#\[cfg\(test\)\]", path.read_text(encoding="utf8"), flags=re.M)[0]
        text = re.sub(r"^\s*//.*$", "", text, flags=re.M)
        edges[path].update(imports(source, path, text))
    return sum(1 for one in edges for other in edges[one] if one < other and one in edges[other])


def upward_dependencies(root):
    """Returns the dependencies between crates that do not point to a lower one; those of tests do not count."""
    wrong = []
    for manifest in files(root, "Cargo.toml"):
        if "fuzz" in manifest.parts or "zenoh" in manifest.parts:
            continue
        text = manifest.read_text(encoding="utf8")
        name = re.search(r'^name = "([\w-]+)"', text, re.M)
        normal = re.search(r"^\[dependencies\]\n(.*?)(?=^\[|\Z)", text, re.M | re.S)
        if not name or not normal or name.group(1) not in ORDER:
            continue
        for used in re.findall(r"^(yarp-[\w-]+)", normal.group(1), re.M):
            if used not in ORDER or ORDER.index(used) >= ORDER.index(name.group(1)):
                wrong.append(f"{name.group(1)} -> {used}")
    return len(wrong)


def interface_files(root):
    """Returns the number of source files that name the interface of the brake, which has the fewest methods."""
    named = re.compile(r"\bJointBrake\b|\bjoint_brake\b")
    files = [path for path in rust_files(root) if "tests" not in path.relative_to(root).parts]
    return sum(bool(named.search(path.read_text(encoding="utf8"))) for path in files)


def measure(root):
    style.ROOT = root
    style.sources = lambda: [path.relative_to(root) for path in rust_files(root)]
    found, counts = style.measure()
    rows = {
        "documentation that begins with What/Whether/How/Who/Where/As, %":
            f"{100 * len(found['opener']) / max(1, counts['items']):.1f}",
        "constants that do not say what they bound": len(found["constant"]),
        "functions over 100 lines": len(found["length"]),
        "file names of more than one source file": counts["shared names"],
        "... of files below `src/` that are about something else": len(list(style.unrelated_names(style.sources()))),
        "pairs of files that import each other": cycles(root),
        "dependencies of crates against the order": upward_dependencies(root),
        "files that name one interface": interface_files(root),
    }
    rows.update({name: copies(root, pattern) for name, pattern in COPIES.items()})
    binary = root / "target/release/yarp"
    rows["release binary, MB"] = f"{binary.stat().st_size / 1e6:.1f}" if binary.is_file() else "not built"
    return rows


TARGETS = {
    "documentation that begins with What/Whether/How/Who/Where/As, %": "<= 2",
    "constants that do not say what they bound": "0",
    "functions over 100 lines": "0",
    "dependencies of crates against the order": "0",
    "files that name one interface": "<= 6",
    "definitions of the port 10000": "1",
    "generators of random numbers": "1",
    "helpers that poll, without tasks": "1",
    "functions for hexadecimal text": "1",
    "backoffs": "1",
    "periodic timers": "1",
    "release binary, MB": "<= 20",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="4318c36")
    base = parser.parse_args().base
    here = Path(__file__).resolve().parent.parent
    before = {}
    if base != "-":
        archive = subprocess.run(["git", "archive", base], cwd=here, capture_output=True, check=True).stdout
        with tempfile.TemporaryDirectory() as folder:
            tarfile.open(fileobj=io.BytesIO(archive)).extractall(folder, filter="data")
            before = measure(Path(folder))
    now = measure(here)
    print(f"| count | {base} | now | target |\n| --- | --- | --- | --- |")
    for name, value in now.items():
        print(f"| {name} | {before.get(name, '-')} | {value} | {TARGETS.get(name, '')} |")


if __name__ == "__main__":
    main()
