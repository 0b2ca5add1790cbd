"""Uses the page as a visitor does, in headless Chromium: try.py PAGE.html NATIVE_PROGRAM PICTURE.png

Speaks to chromedriver by the WebDriver protocol. Fails when the page does not do what it says.
"""

import base64
import functools
import http.server
import json
import pathlib
import struct
import subprocess
import sys
import threading
import time
import urllib.request

import operators

# A machine that is busy may be slow: what is waited for has this long.
PATIENCE_S = 60
OPTIONS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--window-size=1400,1500", "--lang=en",
]


class Browser:
    def __init__(self):
        self.process = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        port = None
        for line in self.process.stdout:
            if "started successfully on port" in line:
                port = line.rsplit(" ", 1)[1].strip().rstrip(".")
                break
        if port is None:
            raise SystemExit("playground: chromedriver does not start")
        self.url = f"http://127.0.0.1:{port}/session"
        capabilities = {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": {"args": OPTIONS}, "goog:loggingPrefs": {"browser": "ALL"}}}
        self.url += "/" + self.call("POST", "", {"capabilities": capabilities})["sessionId"]

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return json.load(answer)["value"]

    def run(self, script):
        return self.call("POST", "/execute/sync", {"script": script, "args": []})

    def text(self, selector):
        return self.run(f"return document.querySelector({json.dumps(selector)}).textContent")

    def click(self, selector):
        element = self.call("POST", "/element", {"using": "css selector", "value": selector})
        self.call("POST", f"/element/{next(iter(element.values()))}/click", {})

    def keys(self, *actions):
        keys = [{"type": kind, "value": value} for kind, value in actions]
        self.call("POST", "/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": keys}]})

    def pointer(self, *actions):
        """Moves go to a place in px from the middle of an element, or of the last one; buttons are the first."""
        mouse = [{"button": 0, "duration": 50, **action} for action in actions]
        self.call("POST", "/actions", {"actions": [{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": mouse}]})

    def over(self, selector, x=0):
        element = self.call("POST", "/element", {"using": "css selector", "value": selector})
        return {"type": "pointerMove", "origin": element, "x": x, "y": 0}

    def choose(self, selector, value):
        self.run(f"window.before = robot; const choice = document.querySelector({json.dumps(selector)}); choice.value = {json.dumps(value)}; choice.dispatchEvent(new Event('change'))")
        self.until(f"a new robot, {value}", lambda: self.run("return robot !== window.before"))

    def until(self, what, holds):
        end = time.monotonic() + PATIENCE_S
        while not holds():
            if time.monotonic() > end:
                raise SystemExit(f"playground: {what} was not seen; status: {self.text('#status')}; log:\n{self.text('#log')}")
            time.sleep(0.1)
        print(f"seen: {what}")

    def quit(self):
        self.call("DELETE", "")
        self.process.terminate()


WHERE = "const p = samples.at(-1); return p ? [p.x, p.y, p.armed, p.heading] : [0, 0, false, 0]"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def main(page, native, picture):
    page = pathlib.Path(page).resolve()
    expected = subprocess.run([native], capture_output=True, text=True, check=True).stdout.split()[0]
    files = functools.partial(Quiet, directory=page.parent)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), files) as host:
        threading.Thread(target=host.serve_forever, daemon=True).start()
        browser = Browser()
        try:
            # A host of files and nothing else; then without any.
            visit(browser, f"http://127.0.0.1:{host.server_port}/{page.name}")
            tour(browser, expected)
            browser.keys(("keyUp", "w"))
            quiet(browser)
            visit(browser, page.as_uri())
            browse(browser, native, expected, picture)
            quiet(browser)
        finally:
            browser.quit()
            host.shutdown()


def visit(browser, url):
    """Opens the page, arms the robot and drives it ahead."""
    print(f"at {url}")
    browser.call("POST", "/url", {"url": url})
    browser.until("a robot that waits", lambda: browser.text("#status").startswith("not armed"))
    browser.until("feedback of four motors", lambda: all(f"motor {n}:" in browser.text("#frames") for n in range(1, 5)))
    arm(browser)
    browser.keys(("keyDown", "w"))
    browser.until("half a metre ahead", lambda: browser.run(WHERE)[0] > 0.5)


def tour(browser, expected):
    """The frames of the tour are those of a native run, bit for bit."""
    browser.click("#tour")
    browser.until("the hash of the tour", lambda: browser.text("#result") != "")
    if expected not in browser.text("#result"):
        raise SystemExit(f"playground: the frames of the tour differ: {expected} natively, here: {browser.text('#result')}")
    print(f"seen: the same frames as natively, {expected}")


def quiet(browser):
    errors = [entry["message"] for entry in browser.call("POST", "/se/log", {"type": "browser"}) if entry["level"] == "SEVERE"]
    if errors:
        raise SystemExit("playground: the browser reports\n" + "\n".join(errors))


def browse(browser, native, expected, picture):
    where = lambda: browser.run(WHERE)
    browser.keys(("keyDown", "q"))
    browser.until("a turn to the left", lambda: where()[3] > 0.3)

    browser.click("[data-trouble=plug]")
    browser.until("a robot that is relaxed without its plug", lambda: browser.text("#status").startswith("relaxed"))
    browser.click("[data-trouble=plug]")
    browser.until("a log that says so", lambda: "not driven" in browser.text("#log") or "began" in browser.text("#log"))
    browser.until("feedback again", lambda: browser.run("return samples.at(-1).wheels.every((wheel) => Number.isFinite(wheel.measured))"))
    if not browser.text("#status").startswith("relaxed"):
        raise SystemExit("playground: the robot drives again without a gesture")
    browser.click("#switch")
    browser.until("a switch that is off", lambda: browser.text("#status").startswith("not armed"))
    browser.until("a pause", lambda: browser.run("return samples.length > 30 && samples.slice(-30).every((one) => !one.on)"))
    browser.click("#switch")
    browser.until("a robot that is armed again", lambda: browser.text("#status").startswith("armed"))
    before = where()
    browser.until("and drives", lambda: abs(where()[0] - before[0]) + abs(where()[1] - before[1]) > 0.2)
    screenshot(browser, picture)
    browser.keys(("keyUp", "w"), ("keyUp", "q"))

    browser.click("[data-trouble=second-master]")
    browser.until("a second master in the log", lambda: "second master" in browser.text("#log"))
    browser.click("[data-trouble=second-master]")

    hands(browser)
    watchdogs(browser)
    browser.choose("#layout", "omni")
    browser.until("three omni wheels", lambda: browser.run("return samples.length > 5 && samples.at(-1).wheels.length === 3"))

    tour(browser, expected)
    replay(browser, native)
    pace(browser, expected)
    languages(browser)


def screenshot(browser, picture):
    data = base64.b64decode(browser.call("GET", "/screenshot"))
    width, height = struct.unpack(">II", data[16:24])
    colours = browser.run("const c = $('world'); return new Set(new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size")
    if not data.startswith(b"\x89PNG") or width < 1000 or height < 1000 or colours < 4:
        raise SystemExit(f"playground: the picture has {width} x {height} points, and the robot is drawn in {colours} colours")
    pathlib.Path(picture).write_bytes(data)
    print(f"seen: {picture}, {width} x {height} points")


def pace(browser, expected):
    """At least ten times real time, by a count that each machine repeats."""
    count, frames = operators.of_the_tour(base64.b64decode(browser.run("return WASM")))
    if frames != expected:
        raise SystemExit(f"playground: another engine sends other frames: {frames}, not {expected}")
    if count > operators.MOST:
        raise SystemExit(f"playground: a second of the tour has {count} operators, {operators.MOST} are allowed")
    print(f"seen: {count} operators a second of the robot, of {operators.MOST}")
    browser.until("how fast this browser is", lambda: browser.run("return Boolean(document.body.dataset.pace)"))
    print(f"pace: {browser.run('return document.body.dataset.pace')} times real time in this browser")


# Units and symbols, and the name of the other language.
UNITS = ["language", "speed", "current", "kp", "ki"]
WORDS = """
const parts = "script, style, output, #code, #log, #frames, #hash, #result";
const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), words = new Set();
while (texts.nextNode()) if (!texts.currentNode.parentElement.closest(parts)) for (const word of texts.currentNode.data.match(PATTERN) ?? []) words.add(word);
return [...words].sort();
"""
NAMES = """
const flat = (texts, at) => Object.entries(texts).flatMap(([name, text]) => typeof text === "object" ? flat(text, at + name + ".") : [[at + name, typeof text === "function" ? text("1") : text]]);
return flat(TEXTS[LANGUAGE], "");
"""


def languages(browser):
    """Each text has a translation, and no text of the page stays in the other language."""
    english, chinese = (dict(browser.run(NAMES.replace("LANGUAGE", json.dumps(one)))) for one in ("en", "zh"))
    has_han = lambda text: any("\u4e00" <= sign <= "\u9fff" for sign in text)
    wrong = english.keys() ^ chinese.keys()
    wrong |= {name for name, text in chinese.items() if not has_han(text) and name not in UNITS}
    wrong |= {name for name, text in english.items() if has_han(text) and name not in UNITS}
    if wrong:
        raise SystemExit(f"playground: not in both languages: {', '.join(sorted(wrong))}")
    for language, pattern, allowed in (("zh", "/[A-Za-z]{4,}/g", ["English", "drivetrain"]), ("en", "/[\\u4e00-\\u9fff]+/g", ["中文"])):
        browser.click("#language")
        browser.until(f"a page in {language}", lambda: browser.run("return document.documentElement.lang") == language)
        browser.until("a status in it", lambda: has_han(browser.text("#status")) == (language == "zh"))
        words = browser.run(WORDS.replace("PATTERN", pattern))
        if words != allowed:
            raise SystemExit(f"playground: the page in {language} has the words {words}, {allowed} are its own")
    print(f"seen: {len(chinese)} texts in two languages")


def hands(browser):
    """A slider is drawn, and a button is held, by a pointer."""
    down, up = {"type": "pointerDown"}, {"type": "pointerUp"}
    width = browser.run("return document.querySelector('#knob-speed').clientWidth")
    browser.pointer(browser.over("#knob-speed"), down, browser.over("#knob-speed", -width // 2 + 12), up)
    slow = float(browser.run("return document.querySelector('#knob-speed').value"))
    if not 0.1 <= slow <= 0.4:
        raise SystemExit(f"playground: the slider was drawn to its left end, and says {slow} m/s")
    browser.choose("#layout", "differential")
    arm(browser)
    target = lambda: browser.run("return samples.length ? samples.at(-1).wheels[0].target * 0.076 : 0")
    browser.pointer(browser.over("[data-drive='ahead:1']"), down)
    browser.until(f"a robot that a pointer drives at {slow} m/s", lambda: abs(target() - slow) < 0.02)
    browser.pointer(up)
    browser.until("a robot that stops when the pointer lets go", lambda: target() == 0)
    browser.pointer(browser.over("#knob-speed"), down, up)
    browser.choose("#layout", "mecanum")


def arm(browser):
    browser.until("feedback", lambda: browser.run("return samples.length > 5"))
    browser.click("#switch")
    browser.until("an armed robot", lambda: browser.text("#status").startswith("armed"))


def watchdogs(browser):
    """A plug is pulled while the robot drives, and the keys are let go: only motors with a watchdog let the robot stop."""
    moved = "const [a, b] = [samples.at(-51), samples.at(-1)]; return a ? Math.hypot(b.x - a.x, b.y - a.y) / (b.time - a.time) : -1"
    for choice in ("program", "both"):
        browser.choose("#watchdogs", choice)
        arm(browser)
        browser.keys(("keyDown", "w"))
        browser.until("a robot that drives", lambda: browser.run(moved) > 0.8)
        browser.click("[data-trouble=plug]")
        browser.until("a robot that is relaxed", lambda: browser.text("#status").startswith("relaxed"))
        browser.keys(("keyUp", "w"))
        pulled = browser.run("return samples.at(-1).time")
        browser.until("5 s without a plug", lambda: browser.run("return samples.at(-1).time") > pulled + 5)
        speed = browser.run(moved)
        if (speed < 0.02) != (choice == "both"):
            raise SystemExit(f"playground: watchdogs: {choice}, and the robot drives at {speed} m/s")
        print(f"seen: watchdogs: {choice}: {speed:.2f} m/s 5 s after the plug was pulled")
        browser.click("[data-trouble=plug]")
    browser.choose("#watchdogs", "program")


def replay(browser, native):
    """A script of what was done by hand, run natively, has the hash that the page shows."""
    script, shown = browser.run("return [robot.script(), robot.hash()]")
    run = subprocess.run([native, "/dev/stdin"], input=script, capture_output=True, text=True)
    if not run.stdout.startswith(shown):
        raise SystemExit(f"playground: the script of the page gives {run.stdout}{run.stderr} natively, {shown} here:\n{script}")
    print(f"seen: the script of the page gives {shown} natively too")


if __name__ == "__main__":
    main(*sys.argv[1:])
