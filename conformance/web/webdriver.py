"""A browser driven over WebDriver: as much of the protocol as the tests here need.

Source: https://www.w3.org/TR/webdriver2/; the log of the console is an extension of chromedriver.
Needs Debian's chromium and chromium-driver, and only Python's standard library.
"""

import base64
import json
import re
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

# Seconds that any wait may take.
PATIENCE = 60
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
# Attempts to click an element that is replaced.
STALE_ATTEMPTS = 5


class Browser:
    """Chromium without a window; ends with the `with` block."""

    def __init__(self, width=1440, height=900, dark=False, arguments=(), loads=True):
        self.profile = tempfile.TemporaryDirectory(prefix="browser-")
        self.driver = subprocess.Popen(
            ["chromedriver", "--port=0"],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.session = None
        try:
            self.address = f"http://127.0.0.1:{self._number()}"
            more = [f"--user-data-dir={self.profile.name}", f"--window-size={width},{height}", *arguments]
            if dark:
                more.append("--blink-settings=preferredColorScheme=0")
            options = {"binary": "/usr/bin/chromium", "args": ARGUMENTS + more}
            wanted = {
                "browserName": "chrome",
                "goog:chromeOptions": options,
                "goog:loggingPrefs": {"browser": "ALL"},
                "unhandledPromptBehavior": "ignore",
                # A page that goes on for ever never finishes loading.
                "pageLoadStrategy": "normal" if loads else "none",
            }
            answer = self._ask("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
            self.session = answer["sessionId"]
        except BaseException:
            self._end()
            raise

    def _number(self):
        """The port that the driver says it listens on."""
        for line in self.driver.stdout:
            found = re.search(r"started successfully on port (\d+)", line)
            if found:
                return int(found[1])
        raise RuntimeError("chromedriver did not start")

    def _ask(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self.address + path, data, {"Content-Type": "application/json"}, method=method
        )
        try:
            with urllib.request.urlopen(request, timeout=2 * PATIENCE) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            value = json.load(error)["value"]
            raise RuntimeError(f"{method} {path}: {value['error']}: {value['message']}") from None

    def ask(self, method, path, body=None):
        """A command within the session."""
        return self._ask(method, f"/session/{self.session}{path}", body)

    def open(self, address):
        """Loads a page."""
        self.ask("POST", "/url", {"url": address})

    def script(self, text, *arguments):
        """Runs a function body in the page and gives what it returns."""
        return self.ask("POST", "/execute/sync", {"script": text, "args": list(arguments)})

    def until(self, what, text, *arguments, timeout=PATIENCE):
        """Waits until a function body returns something true, and gives that."""
        end = time.monotonic() + timeout
        while True:
            found = self.script(text, *arguments)
            if found:
                return found
            if time.monotonic() > end:
                raise AssertionError(f"waited in vain until {what}")
            time.sleep(0.1)

    def later(self, text, *arguments):
        """Runs the body of an async function in the page and gives what it returns."""
        script = f"const done = arguments[arguments.length - 1]; (async (...arguments) => {{ {text} }})(...arguments).then(done, (error) => done(String(error)))"
        return self.ask("POST", "/execute/async", {"script": script, "args": list(arguments)})

    def command(self, name, **parameters):
        """A command of the browser's own protocol."""
        return self.ask("POST", "/goog/cdp/execute", {"cmd": name, "params": parameters})

    def find(self, selector):
        """The first element that a CSS selector names."""
        query = {"using": "css selector", "value": selector}
        return self.ask("POST", "/element", query)[ELEMENT]

    def click(self, selector):
        """Clicks as a person would: what is covered or out of sight cannot be clicked."""
        # The page may draw its list anew between the two requests.
        for attempts_left in reversed(range(STALE_ATTEMPTS)):
            try:
                self.ask("POST", f"/element/{self.find(selector)}/click", {})
                return
            except RuntimeError as error:
                if "stale element reference" not in str(error) or attempts_left == 0:
                    raise

    def type(self, selector, text):
        """Empties a field and types into it."""
        element = self.find(selector)
        self.ask("POST", f"/element/{element}/clear", {})
        self.ask("POST", f"/element/{element}/value", {"text": text})

    def alert(self):
        """The text of an open alert, or None."""
        try:
            return self.ask("GET", "/alert/text")
        except RuntimeError:
            return None

    def console(self):
        """What the console has said since it was last asked, but for what concerns the browser's own pages."""
        entries = self.ask("POST", "/se/log", {"type": "browser"})
        return [entry for entry in entries if not entry["message"].startswith("chrome://")]

    def screenshot(self, path):
        """Saves what is seen as PNG."""
        with open(path, "wb") as file:
            file.write(base64.b64decode(self.ask("GET", "/screenshot")))

    def _end(self):
        try:
            if self.session:
                self.ask("DELETE", "")
        except (RuntimeError, OSError):
            pass  # It is gone already.
        finally:
            self.driver.terminate()
            self.driver.wait(PATIENCE)
            self.profile.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end()
