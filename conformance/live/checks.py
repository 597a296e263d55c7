"""What suites check, a line for each, and how they end."""

import os

made = 0
failed = 0


def noted(good):
    global made, failed
    made += 1
    failed += not good


def check(what, good, found=""):
    """Whether it is so. Prints one line, with what was found."""
    noted(good)
    seen = f": {shortened(str(found), 100 if good else 800)}" if found != "" else ""
    print(f"{'ok  ' if good else 'FAIL'} {what}{seen}", flush=True)
    return good


def same(what, got, expected):
    """Whether two are the same. Prints one line, and both if they are not."""
    noted(got == expected)
    if got == expected:
        print(f"ok   {what}", flush=True)
    else:
        print(f"FAIL {what}\n     got      {shortened(repr(got))}\n     expected {shortened(repr(expected))}", flush=True)
    return got == expected


def shortened(text, most=800):
    return text if len(text) <= most else f"{text[:most]}... ({len(text)} characters)"


def verdict():
    """The exit code: nothing failed, and there was something."""
    print(f"{failed} of {made} checks failed" if failed or not made else f"all {made} checks passed", flush=True)
    return 1 if failed or not made else 0


def leave():
    """Ends with the verdict, at once: threads of stock's bindings may still wait for what will not come."""
    os._exit(verdict())
