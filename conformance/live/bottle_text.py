"""Compares the text form of bottles with stock YARP's.

Feeds texts to stock's Python bindings and to yarp-wire's example `bottle`, compares what each
prints and the bytes each encodes, and prints `ok` or `FAIL` per group. Ends with 1 on any
difference that is not listed in `EXCEPTIONS`.

    cargo build -p yarp-wire --example bottle
    "$STOCK/bin/python" conformance/live/bottle_text.py target/debug/examples/bottle [SEED]

Stock is 3.5.0, or whatever the bindings in that Python are.
"""

import random
import re
import subprocess
import sys

import yarp

# Where we differ on purpose. Each entry: what, and whether it explains a difference, given the
# text and what stock and we made of it (text and bytes).
EXCEPTIONS = [
    (
        "words of more than four characters stay whole in text, as in 4.0; 3.x cuts them",
        lambda text, theirs, ours: theirs[1] == ours[1] and b"[" in text,
    ),
    (
        "lists nested deeper than 200 are refused",
        lambda text, theirs, ours: ours[0].startswith(b"error: lists nested"),
    ),
    (
        "stock adds up the characters of a word with their sign, so that what a word beyond ASCII "
        "becomes depends on the processor; we keep the bytes",
        lambda text, theirs, ours: re.search(rb"\[[^ \t\r\n,]{0,3}[\x80-\xff]", text),
    ),
    (
        "a float beyond 32 bits as a byte of a blob is undefined in C++",
        lambda text, theirs, ours: re.search(rb"\{[^}]*(inf|nan|[0-9.][eE]|\d{10})", text),
    ),
]

HAND_PICKED = r'''
|hello 5|a,b,,c|  x  | ( 1 2 ) |()|(())|[]|{}|""|"a b"|"a\"b"|"a\\"|a\ b|a\|\|\\|"\n\r\0\t\x"
5|+5|-5|--5|+-5|-+5|5-|5+5|0|00|000|-0|+0|007|08|09|010|0x|0X1f|0x1F|-0x10|+0x10|0xg|x1|0x0x1|00x1|000x12
0x1234567|0x12345678|0x123456789|0x1234567890abcdef|0xffffffff|-0xffffffff|0x7fffffff|0x80000000|0x-5|0x+5|0x1-2
2147483647|2147483648|-2147483648|-2147483649|9223372036854775807|9223372036854775808|-9223372036854775808|-9223372036854775809|99999999999999999999|-99999999999999999999999
0777|-0777|0778|0xe5|0x1e5|0x.8|0x1.8|0x1.8p3|0x1p3|0x1.8e3|0x1.|0x.|-0x1.8|0x1.8-2|0x1.ffffff|0x1.fffffffff
1.5|.5|5.|.|..|1..2|1.2.3|-.5|+.5|-.|+.|.e5|1.e5|1e5|1E5|1e|1e+|1e-|1e+5|1e-5|1e5.5|1e5e5|e5|.5e|1-e5|1.5-|1.5+2|-1.5-2
1e308|1e309|-1e309|1e-308|1e-320|1e-400|4.9e-324|2.2250738585072014e-308|1.7976931348623157e308|123456789012345678901234567890.5|0.1|0.2|0.3|3.14|2.718281828459045
1e10|1e15|1e16|1e17|1e20|1e21|1e22|1e-4|1e-5|0.0001|0.00001|100000.0|0.000123456789|9.999999999999999e20|999999999999999999999.9|99999999999999999999.0
inf|-inf|+inf|nan|-nan|+nan|Inf|NaN|INF|infinity|-infinity|nan.0|-nan.0|inf.|1inf|"inf"|"nan"|"null"|null|Null|-0.0|0.0|-0e0
true|false|True|"true"|"false"|[true]|true.|truee|(true)|[1]|[0]|[]|[ok]|[a|[a b]|[a]b|[abcd]|[a,b]|["]|["a b"]|[(]|[(])|[a\]|[a\b]|[\]|[
(1 (2|(1|)|)(|()()|(a)(b)|(a)b|a(b)|a(b c)d|a(|a)|a)b c|((a)|(a))|(a b) c)|( ( ) )|(a,b)|(,)|(\)|(\))|("(")|(")")
{1 2 255}|{256 1 -1}|{|}|{1|{a b}|{1.5 2}|{(1) 2}|{"5"}|{[ok]}|{true}|{0x10}|{1,2}|{{1}}|{1}2|a{1 2}b|{}{}|{4294967297}
"|"a|a"|a"b|a"b c"d|"a"b|"a" "b"|"a""b"|""""|"a\"|\"a b\"|a\"b|"\\"|"\|'a b'|"(a|("a|"a)"
a-b|a.b|a_b|a1|1a|_a|-a|.a|a:b|/a|/a/b:o|a/b|a@b|a#b|a=b|a+b|a*b|a&b|#a|$a|%a|a;b|a:|a.|a-|-|+|*|~|`|!|?|<a>|a'b
é|"é"|日本|[é]|(é)|aé|"aéb"|{é}|5é|é5|[éa]|[日]
'''


def hand_picked():
    lines = HAND_PICKED.strip("\n").split("\n")
    texts = [text for line in lines for text in line.split("|")]
    texts += [" ".join(texts[i : i + 3]) for i in range(len(texts))]
    texts += ["a\tb", "a\rb", "a\nb", "(a\nb)", '"a\nb"', '"a\tb"', "a\\\nb", '"\x01"', "\x01", "a\x7fb"]
    texts += ["(" * n + "a" + ")" * n for n in (1, 5, 50, 150, 198, 199, 200, 201, 1000)]
    texts += ["{" * n + "7" + "}" * n for n in (1, 5, 150, 199, 200)]
    return texts


def generated(rng, count):
    """Texts out of pieces that matter to the reader, in any order."""
    pieces = list("()[]{}\"\\ ,.+-0123456789xXeEabfn_/:\t\r\n") + [
        " ", " ", " ", "0x", "1.5", "inf", "nan", "null", "true", "false", "hello", "[ok]", "(a b)", "{1 2}",
        '"a b"', "\\n", "\\0", '\\"', "é", "1e5", "010", "-1",
    ]
    return ["".join(rng.choices(pieces, k=rng.randint(1, 14))) for _ in range(count)]


def numbers(rng, count):
    """Tokens of the letters that numbers are made of."""
    alphabet = "0123456789" * 2 + "..eE+-xXabcdefABF"
    tokens = ["".join(rng.choices(alphabet, k=rng.randint(1, 12))) for _ in range(count)]
    floats = [repr(rng.uniform(-1, 1) * 10.0 ** rng.randint(-320, 308)) for _ in range(count)]
    short = [f"{rng.uniform(-1000, 1000):.{rng.randint(0, 6)}f}" for _ in range(count)]
    integers = [str(rng.randint(-(2 ** rng.randint(1, 70)), 2 ** rng.randint(1, 70))) for _ in range(count)]
    return tokens + floats + short + integers


def raw(rng, count):
    """Bytes that need not be UTF-8; without those that end or change a line."""
    usable = [b for b in range(256) if b not in (0, 10, 13)]
    common = list(b'()[]{}"\\ abc 12.')
    texts = []
    for _ in range(count):
        body = bytes(rng.choice(common if rng.random() < 0.6 else usable) for _ in range(rng.randint(1, 10)))
        texts.append(body)
    return texts + [bytes([b]) for b in usable] + [b"[%c]" % b for b in usable] + [b'"a%c"' % b for b in usable]


def encode(bottle):
    connector = yarp.DummyConnector()
    connector.setTextMode(False)
    bottle.write(connector.getWriter())
    reader = connector.getReader()
    return bytes(reader.expectInt8() & 255 for _ in range(reader.getSize()))


def stock(text):
    """What stock prints and encodes for a text."""
    bottle = yarp.Bottle(text.decode())
    return printed(bottle), encode(bottle)


def printed(bottle):
    """The text of a bottle as bytes; the bindings give text that is not UTF-8 with surrogates."""
    return bottle.toString().encode("utf-8", "surrogateescape")


def stock_raw(text):
    """As `stock`, for bytes: read from a text connection."""
    connector = yarp.DummyConnector()
    connector.setTextMode(True)
    writer = connector.getWriter()
    for byte in text + b"\n":
        writer.appendInt8(byte - 256 if byte > 127 else byte)
    bottle = yarp.Bottle()
    bottle.read(connector.getReader())
    return printed(bottle), encode(bottle)


def ours(example, texts):
    lines = "\n".join(text.hex() for text in texts) + "\n"
    run = subprocess.run([example, "--hex"], input=lines, capture_output=True, text=True, check=True)
    for line in run.stdout.splitlines():
        text, _, binary = line.partition("\t")
        if text.startswith("error"):
            yield text.encode(), b""
        else:
            yield bytes.fromhex(text), bytes.fromhex(binary)


def is_open(text):
    """Whether a text connection would wait for another line."""
    quoted = escaped = False
    round_, curly = 0, 0
    for byte in text:
        if escaped:
            escaped = False
        elif byte == ord("\\"):
            escaped = True
        elif byte == ord('"'):
            quoted = not quoted
        elif not quoted:
            round_ += (byte == ord("(")) - (byte == ord(")"))
            curly += (byte == ord("{")) - (byte == ord("}"))
    return quoted or escaped or round_ != 0 or curly != 0


def compare(name, example, texts, reference):
    texts = list(dict.fromkeys(texts))
    excused = dict.fromkeys((what for what, _ in EXCEPTIONS), 0)
    different = 0
    for text, mine in zip(texts, ours(example, texts), strict=True):
        theirs = reference(text)
        if theirs == mine:
            continue
        reason = next((what for what, explains in EXCEPTIONS if explains(text, theirs, mine)), None)
        if reason:
            excused[reason] += 1
            continue
        different += 1
        if different <= 40:
            print(f"  {text!r}\n    stock {theirs[0]!r} {theirs[1].hex()}\n    ours  {mine[0]!r} {mine[1].hex()}")
    print(f"{'FAIL' if different else 'ok'} {name}: {len(texts)} texts, {different} different")
    for reason, count in excused.items():
        if count:
            print(f"   excused {count}: {reason}")
    return different


def utf8(texts):
    return [text.encode() for text in texts]


def main():
    example = sys.argv[1]
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    rng = random.Random(seed)
    different = compare("hand-picked", example, utf8(hand_picked()), stock)
    different += compare("generated", example, utf8(generated(rng, 20000)), stock)
    different += compare("numbers", example, utf8(numbers(rng, 3000)), stock)
    # A line that ends in a backslash goes on in the next, even if another stands before it.
    lines = [t for t in raw(rng, 4000) if not is_open(t) and not t.endswith(b"\\")]
    different += compare("bytes", example, lines, stock_raw)
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
