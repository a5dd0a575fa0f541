#!/usr/bin/env python3
"""live.py DYNIDENT CHROMIUM LIBRARIES SCRATCH: checks the live page of `iterate` in a browser.

A robot program streams 500 samples per second. The page must draw them, survive a reload, write nothing to the console, ask for no other address, pass axe-core
(light and dark, wide and narrow), stop the robot with the keyboard within two sample periods plus 50 ms, show the end, and report a lost connection.

LIBRARIES is that of pages.py.
"""

import math
import pathlib
import subprocess
import sys
import tempfile
import time

import pages

ROOT = pathlib.Path(__file__).resolve().parent.parent
RATE_HZ = 500.0
# Two sample periods, and time for the browser and the operating system.
LONGEST_STOP_S = 2.0 / RATE_HZ + 0.05
# Growth of the memory of the page during the checks.
LARGEST_GROWTH_BYTES = 50e6

ROBOT = """
import json, sys, threading, time
folder = sys.argv[1]
stopped = threading.Event()
requests = []
def read():
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "stop":
            open(folder + "/stopped", "w").write(repr(time.monotonic()))
            stopped.set()
        elif message["type"] == "run":
            requests.append(message)
        elif message["type"] == "bye":
            stopped.set()
            requests.append(None)
def send(message):
    print(json.dumps(message), flush=True)
threading.Thread(target=read, daemon=True).start()
send({"type": "hello", "protocol": "dynident-robot/1", "name": "stream", "joints": ["joint1", "joint2"], "modes": ["run"]})
while True:
    while not requests:
        time.sleep(0.001)
    request = requests.pop(0)
    if request is None:
        break
    rows = [line.split(",") for line in open(request["trajectory"])][1:]
    begin = time.monotonic()
    for k, row in enumerate(rows):
        if stopped.is_set():
            break
        time.sleep(max(0.0, begin + k / request["rate_hz"] - time.monotonic()))
        q = [float(x) for x in row[1:3]]
        send({"type": "sample", "t_s": float(row[0]), "q": [q[0] + 1e-4, q[1]], "tau": [3.0 * q[0], q[1]]})
    send({"type": "end", "status": "stopped" if stopped.is_set() else "done", "reason": "as requested"})
"""

DRAWN = """document.querySelectorAll("#plots svg").length === 4 &&
  [...document.querySelectorAll("#plots .measured")].every((path) => path.getAttribute("d").split("L").length > 10)"""
LENGTH = """document.querySelector("#plots .measured").getAttribute("d").length"""
FOCUSED = "document.activeElement?.id"


def study(folder):
    """A planar arm that moves for a minute."""
    (folder / "robot.py").write_text(ROBOT)
    rows = ["t_s,q1,q2,dq1,dq2,ddq1,ddq2"]
    for k in range(6001):
        t, w = k * 0.01, 2 * math.pi * 0.1
        one = [0.5 * (1 - math.cos(w * t)), 0.5 * w * math.sin(w * t), 0.5 * w * w * math.cos(w * t)]
        rows.append(f"{t:.2f}," + ",".join(f"{a!r},{-a!r}" for a in one))
    (folder / "motion.csv").write_text("\n".join(rows) + "\n")
    (folder / "study.toml").write_text(
        f"""
name = "a planar arm <live>"
[robot]
file = "{ROOT}/robots/planar2r.urdf"
[simulation]
rate_hz = {RATE_HZ}
[controller]
kind = "joint-pd"
kp = [200.0, 60.0]
kd = [10.0, 1.0]
[iteration]
trajectory = "motion.csv"
model_free = {{ kind = "joint-pd", kp = [200.0, 60.0], kd = [10.0, 1.0] }}
robot = {{ kind = "process", command = ["{sys.executable}", "{folder}/robot.py", "{folder}"] }}
"""
    )
    return folder / "study.toml"


def until(browser, script, seconds=30.0):
    """Waits until a condition of the page holds."""
    ends = time.monotonic() + seconds
    while time.monotonic() < ends:
        if browser.value(script):
            return True
        time.sleep(0.05)
    return False


def key(browser, name, code):
    for kind in ("keyDown", "keyUp"):
        text = {"text": "\r"} if name == "Enter" and kind == "keyDown" else {}
        browser.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=code, **text)


def opened(browser, url):
    browser.events = [event for event in browser.events if event.get("method") != "Page.loadEventFired"]
    browser.call("Page.navigate", url=url)
    browser.wait_for("Page.loadEventFired")


def shown(browser, url, axe):
    """Returns the errors of the page while the robot moves."""
    wrong = []
    opened(browser, url)
    if not until(browser, DRAWN):
        return ["the samples are not drawn"]
    before = browser.value(LENGTH)
    if not until(browser, f"{LENGTH} > {before}"):
        wrong.append("no new samples are drawn")
    browser.call("Page.reload")
    time.sleep(0.5)
    if not until(browser, DRAWN) or browser.value(LENGTH) < before:
        wrong.append("the samples are lost after a reload")
    browser.value(axe + ";0")
    heap = browser.call("Runtime.getHeapUsage")["usedSize"]
    for width, scheme in [(1200, "light"), (400, "light"), (1200, "dark"), (400, "dark")]:
        browser.size(width, 900)
        browser.scheme(scheme)
        wrong += [f"axe-core, {width} px, {scheme}: {finding}" for finding in browser.value(pages.AXE)]
        if browser.value("document.documentElement.scrollWidth > innerWidth"):
            wrong.append(f"wider than {width} px")
    time.sleep(5)
    growth = browser.call("Runtime.getHeapUsage")["usedSize"] - heap
    print(f"live page: memory of the page grew by {growth / 1e6:.1f} MB during the checks")
    if growth > LARGEST_GROWTH_BYTES:
        wrong.append(f"the memory of the page grew by {growth} bytes")
    return wrong


def stopped(browser, folder):
    """Stops the robot with the keyboard; returns the errors."""
    for _ in range(10):
        key(browser, "Tab", 9)
        if browser.value(FOCUSED) == "stop":
            break
    else:
        return ["the stop button cannot be reached with the tab key"]
    begin = time.monotonic()
    key(browser, "Enter", 13)
    if not until(browser, "!document.getElementById('stopped').hidden"):
        return ["the page does not confirm the stop"]
    time.sleep(1.0)
    file = folder / "stopped"
    if not file.exists():
        return ["the robot was not stopped"]
    after = float(file.read_text()) - begin
    print(f"live page: the robot got the stop {1e3 * after:.0f} ms after the key")
    wrong = [] if after <= LONGEST_STOP_S else [f"the robot got the stop after {after} s"]
    if not until(browser, "document.getElementById('status').textContent.includes('has ended')"):
        wrong.append(f"the end is not shown: {browser.value('document.getElementById(`status`).textContent')}")
    return wrong


def main():
    dynident, program, libraries, scratch = sys.argv[1:]
    axe = (pathlib.Path(libraries) / "axe_playwright_python" / "axe.min.js").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True, dir=scratch) as temporary:
        folder = pathlib.Path(temporary).resolve()
        browser = pages.Browser(program, folder / "profile")
        browser.call("Network.enable")
        command = [dynident, "iterate", study(folder), "--out", folder / "out", "--allow-command", "--live"]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            try:
                url = next(line for line in process.stderr if "live page: " in line).split("live page: ")[1].strip()
                wrong = shown(browser, url, axe)
                wrong += [f"console: {message}" for message in browser.console()]
                wrong += stopped(browser, folder)
                wrong += [] if process.wait(60) == 130 else [f"exit status {process.returncode}"]
            finally:
                process.kill()
        asked = [event["params"]["request"]["url"] for event in browser.events if event.get("method") == "Network.requestWillBeSent"]
        wrong += [f"network: {address}" for address in asked if not address.startswith((url, "data:", "about:"))]
        # A page that has not seen the end reports a lost connection.
        again = [dynident, "iterate", folder / "study.toml", "--out", folder / "other", "--allow-command", "--live"]
        with subprocess.Popen(again, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            url = next(line for line in process.stderr if "live page: " in line).split("live page: ")[1].strip()
            opened(browser, url)
            drawn = until(browser, DRAWN)
            process.kill()
        if not drawn or not until(browser, "!document.getElementById('lost').hidden"):
            wrong.append("a lost connection is not reported")
        browser.close()
    for finding in wrong:
        print(f"live page: {finding}")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
