"""Sends the typed messages both ways between stock YARP and ours, and compares.

For each content: both write it, and the bytes are compared; each reads what the other wrote, and
what it tells of it is compared with the content. Prints `ok` or `FAIL` per type and ends with 1 on
any difference.

    cargo build -p yarp-wire --example typed
    g++ -std=c++17 -include cstdint conformance/live/typed_peer.cpp -o typed_peer \\
        -I"$stock_package/include" -L"$stock_package/lib" -lYARP_os -lYARP_sig -lYARP_init
    python3 conformance/live/typed.py target/debug/examples/typed ./typed_peer [3.5.0|4.0 [SEED]]

What 4.0 alone has is compared with a peer of 4.0: vectors of other numbers than `double` and `int`,
which 3.5.0 does not write, and places in sounds. The mark of images that 4.0 lacks is left out.
"""

import random
import struct
import subprocess
import sys

# Bytes that a pixel takes in stock's memory, of the codes that it can keep.
PIXELS = {
    "mono": 1, "mo16": 2, "rgb": 3, "rgba": 4, "bgra": 4, "int": 4, "hsv": 3, "bgr": 3, "sign": 1, "rgbi": 12,
    "dec": 4, "rgb.": 12, "grbg": 1, "gr16": 2, "bggr": 1, "bg16": 2, "gbrg": 1, "gb16": 2, "rggb": 1, "rg16": 2,
    "yuva": 1, "yuvb": 1, "yuvc": 2, "yuvd": 1, -2: 2, -4: 4,
}
# Those that are types of their own.
TYPED = ["mono", "mo16", "rgb", "rgba", "bgra", "int", "hsv", "bgr", "sign", "rgbi", "dec", "rgb."]
COLOURS = ["mono", "rgb", "bgr", "rgba", "bgra"]
SMALL = [0, 1, 2, 3, 4, 5, 7, 8, 9, 16, 17]


def code(word):
    return word if isinstance(word, int) else struct.unpack("<i", word.encode().ljust(4, b"\0"))[0]


def number(rng):
    value = rng.choice([
        rng.uniform(-1, 1) * 10.0 ** rng.randint(-300, 300), float(rng.randint(-1000, 1000)), rng.randint(-99, 99) / 8,
    ])
    # Text of 21 digits comes back as the same number.
    text = f"{value:.17g}"
    return text if "." in text or "e" in text else text + ".0"


def numbers(rng, count):
    return " ".join(number(rng) for _ in range(count))


def integer(rng):
    return rng.randint(-(2 ** rng.choice([3, 15, 31])), 2 ** rng.choice([3, 15, 31]) - 1)


def blob(rng, length):
    return "{" + " ".join(str(rng.randrange(256)) for _ in range(length)) + "}"


def fraction(rng):
    """A number that four bytes hold exactly."""
    return str(struct.unpack("<f", struct.pack("<f", float(number(rng)) % 1e30))[0])


def within(least, most):
    """Numbers of such a kind, with both ends often among them."""
    return lambda rng: " ".join(str(rng.choice([least, most, rng.randint(least, most)])) for _ in range(rng.randint(1, 40)))


def image(rng, words, smallest, marks=2):
    word = rng.choice(words)
    width, height = (max(smallest, rng.choice(SMALL)) for _ in range(2))
    quantum = rng.choice([1, 2, 3, 4, 8, 8, 8, 16, 64])
    marked = rng.randrange(marks)
    return f"{code(word)} {width} {height} {quantum} {marked} {blob(rng, width * height * PIXELS[word])}"


def sound(rng):
    channels, length = rng.randint(1, 4), rng.randint(1, 50)
    samples = " ".join(str(rng.randint(-32768, 32767)) for _ in range(channels * length))
    return f"{rng.choice([0, 8000, 16000, 44100, 192000])} {channels} {samples}"


def sound_with_places(rng):
    """In the order in which 4.0 keeps them."""
    labels = sorted({word(rng).strip('"').replace('\\"', '"') for _ in range(rng.randrange(4))})
    places = [f"({quoted(label)} {rng.choice([0, 7, 2**40])} {rng.randint(-1, 3)})" for label in labels]
    return " ".join([sound(rng), *places])


def quoted(text):
    escaped = text.replace('"', '\\"')
    return f'"{escaped}"'


def stamp(rng):
    return f"{rng.choice([-1, 0, 7, 2**31 - 1, rng.randrange(2**31)])} {number(rng)}"


def word(rng):
    return rng.choice(["alpha", "beta", "g_1", "x", "Z", "left.eye", "a-b", '"two words"', '"quo\\"te"', '""', '"/port:o"'])


def value(rng, depth=0):
    kinds = [word, integer, number, lambda rng: f"[{rng.choice(['ok', 'a', 'abcd'])}]", lambda rng: blob(rng, 3),
             lambda rng: rng.choice(["true", "false", str(2**40), "()"])]
    if depth < 2:
        kinds.append(lambda rng: "(" + " ".join(value(rng, depth + 1) for _ in range(rng.randrange(4))) + ")")
    return str(rng.choice(kinds)(rng))


def property_(rng):
    entries = {}
    for _ in range(rng.randrange(6)):
        name = word(rng)
        key = name.strip('"').replace('\\"', '"')
        values = [value(rng) for _ in range(rng.randrange(4))]
        entries[key.encode()] = "(" + " ".join([name] + values) + ")"
    return " ".join(entries[key] for key in sorted(entries))


GENERATORS = {
    "vector_f64": lambda rng: numbers(rng, rng.randint(1, 40)),
    "vector_i32": lambda rng: " ".join(str(integer(rng)) for _ in range(rng.randint(1, 40))),
    "matrix": lambda rng: (lambda r, c: f"{r} {c} {numbers(rng, r * c)}")(rng.randint(1, 7), rng.randint(1, 7)),
    "image": lambda rng: image(rng, list(PIXELS), 1),
    "sound": sound,
    "stamp": stamp,
    "property": property_,
    "pair": lambda rng: f"{stamp(rng)} {numbers(rng, rng.randint(1, 9))}",
    "grasp": lambda rng: f"{word(rng)} {number(rng)} {integer(rng)}",
    "bottle": lambda rng: " ".join(value(rng) for _ in range(rng.randrange(12))),
}
GENERATORS |= {f"image_{name}": lambda rng, name=name: image(rng, [name], 1) for name in TYPED}
VECTORS_OF_4 = {
    "vector_f32": lambda rng: " ".join(fraction(rng) for _ in range(rng.randint(1, 40))),
    "vector_i16": within(-(2**15), 2**15 - 1),
    "vector_u16": within(0, 2**16 - 1),
    "vector_i8": within(-128, 127),
    "vector_u8": within(0, 255),
}
OF_4 = VECTORS_OF_4 | {
    "image": lambda rng: image(rng, list(PIXELS), 1, 1),
    "sound": sound_with_places,
} | {f"image_{name}": lambda rng, name=name: image(rng, [name], 1, 1) for name in TYPED}
# Contents of no elements: stock writes them and refuses to read them.
EMPTY = {"vector_f64": "", "vector_i32": "", "matrix": "0 0"}


class Peer:
    def __init__(self, name, *command):
        self.name, self.command = name, command

    def ask(self, lines):
        text = "".join(line + "\n" for line in lines)
        run = subprocess.run(self.command, input=text, capture_output=True, text=True, check=True)
        answers = run.stdout.split("\n")[:-1]
        if len(answers) != len(lines):
            raise RuntimeError(f"{self.name} gave {len(answers)} answers to {len(lines)} lines")
        return answers


def padding(kind, hexadecimal):
    """The bytes with the padding of image rows zeroed, which has no meaning."""
    if not kind.startswith(("image", "convert")):
        return hexadecimal
    data = bytearray.fromhex(hexadecimal)
    # The mark of 3.5.0 stands behind the quantum, and 4.0 has none.
    depth, _, quantum, _, width, height = struct.unpack_from("<iihhii", data, 32)
    row = width * depth * (2 if data[20:24] == b"yuvc" else 1)
    stride = -(-row // quantum) * quantum
    for y in range(height):
        data[60 + y * stride + row : 60 + (y + 1) * stride] = bytes(stride - row)
    return data.hex()


def both_ways(kind, contents, stock, ours):
    writes = [f"{kind} write {content}".rstrip() for content in contents]
    by_stock, by_us = stock.ask(writes), ours.ask(writes)
    stock_reads = stock.ask([f"{kind} read {message}" for message in by_us])
    we_read = ours.ask([f"{kind} read {message}" for message in by_stock])
    # Each tells what it read in its own words, which have to be the same.
    again = ours.ask([f"{kind} read {message}" for message in by_us])
    different = 0
    for content, *rest in zip(contents, by_stock, by_us, stock_reads, we_read, again, strict=True):
        theirs, mine, stock_read, we_did, own = rest
        same_bytes = padding(kind, theirs) == padding(kind, mine)
        same_content = stock_read == we_did == own and not own.startswith("error")
        if not (same_bytes and same_content):
            different += 1
            if different <= 5:
                print(f"  {content[:200]}\n    stock wrote {theirs[:400]}\n    we wrote    {mine[:400]}")
                print(f"    stock read  {stock_read[:200]}\n    we read     {we_did[:200]}")
    return report(f"{kind}, both ways", len(contents), different)


def as_bottles(kind, contents, stock, ours):
    """Vectors that stock has no type for, which are bottles to it."""
    written = ours.ask([f"{kind} write {content}" for content in contents])
    reads = [f"bottle read {message}" for message in written]
    told = zip(contents, stock.ask(reads), ours.ask(reads), strict=True)
    wrong = sum(theirs != own or [float(word) for word in theirs.split()] != shown(kind, content) for content, theirs, own in told)
    return report(f"{kind}, a bottle to stock", len(contents), wrong)


def shown(kind, content):
    """The numbers of a bottle, which knows of no whole ones but signed ones."""
    numbers = [float(word) for word in content.split()]
    if bits := {"vector_u8": 8, "vector_u16": 16}.get(kind):
        numbers = [(number + 2 ** (bits - 1)) % 2**bits - 2 ** (bits - 1) for number in numbers]
    return numbers


def report(name, count, different):
    print(f"{'FAIL' if different else 'ok'} {name}: {count} messages, {different} different")
    return different


def main():
    example, peer, version, seed = (sys.argv[1:] + ["3.5.0", "1"][len(sys.argv) - 3 :])[:4]
    is_4 = version == "4.0"
    ours, stock = Peer("ours", example, version), Peer("stock", peer)
    rng = random.Random(int(seed))
    generators = GENERATORS | (OF_4 if is_4 else {})
    different = 0
    for kind, generate in generators.items():
        different += both_ways(kind, [generate(rng) for _ in range(300)], stock, ours)

    for kind, generate in ({} if is_4 else VECTORS_OF_4).items():
        different += as_bottles(kind, [generate(rng) for _ in range(300)], stock, ours)

    every = [f"{code(w)} 5 3 8 0 {blob(rng, 15 * size)}" for w, size in PIXELS.items()]
    different += both_ways("image", every, stock, ours)

    marks = 1 if is_4 else 2
    contents = [f"{image(rng, [a], 1, marks)} {code(b)}" for a in COLOURS for b in COLOURS for _ in range(12)]
    lines = [f"convert write {content}" for content in contents]
    pairs = zip(stock.ask(lines), ours.ask(lines), strict=True)
    wrong = sum(padding("convert", theirs) != padding("convert", mine) for theirs, mine in pairs)
    different += report("images converted", len(contents), wrong)

    empty = EMPTY | (dict.fromkeys(VECTORS_OF_4, "") if is_4 else {})
    lines = [f"{kind} write {content}".rstrip() for kind, content in empty.items()]
    written = [stock.ask(lines), ours.ask(lines)]
    reads = [f"{kind} read {message}" for kind, message in zip(empty, written[0], strict=True)]
    refused = all(answer.startswith("error") for peer in (stock, ours) for answer in peer.ask(reads))
    different += report("empty, written alike and refused by both", len(empty), int(written[0] != written[1] or not refused))
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
