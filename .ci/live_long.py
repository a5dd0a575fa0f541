#!/usr/bin/env python3
"""live_long.py DYNIDENT CHROMIUM PYTHON SCRATCH [--minutes 10]: the live page for ten minutes beside a UR10 in MuJoCo, with 500 samples per second.

The memory of the page and of the command must not grow by more than 50 MB after the first minute. Meanwhile a second client reads, requests without the token
and from another origin get nothing, a browser is killed, and the run continues. At the end the stop button stops the robot.

PYTHON has mujoco and numpy.
"""

import argparse
import pathlib
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

import live
import pages

ROOT = pathlib.Path(__file__).resolve().parent.parent
RATE_HZ = 500.0
LARGEST_GROWTH_BYTES = 50e6
# The first minute fills buffers of fixed size.
WARM_UP_S = 60.0


def study(folder, python):
    """The UR10 example without convergence, and a robot that keeps to the clock."""
    text = (ROOT / "examples/iterate_ur10_mujoco.toml").read_text()
    replaced = [
        # A fit of all runs needs memory for all of them.
        ("max_runs = 5", "max_runs = 1000\npool = false"),
        ("tracking_tolerance = 1e-2", "tracking_tolerance = 1e-2, parameter_sigmas = 1e-9"),
        ('file = "../robots/ur10.urdf"', f'file = "{ROOT}/robots/ur10.urdf"'),
        (
            '"python3", "examples/robots/mujoco_client.py", "robots/ur10.urdf"',
            f'"{python}", "{ROOT}/examples/robots/mujoco_client.py", "{ROOT}/robots/ur10.urdf", "--real-time", "--torque-noise", "0.2"',
        ),
    ]
    for old, new in replaced:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "study.toml"
    path.write_text(text)
    return path


def resident(process):
    """Memory of the command in bytes."""
    for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return 1024.0 * float(line.split()[1])
    raise RuntimeError("no VmRSS")


def heap(browser):
    browser.call("HeapProfiler.collectGarbage")
    return browser.call("Runtime.getHeapUsage")["usedSize"]


def refused(url):
    """Errors of requests that must not be answered."""
    address = url.rstrip("/").rsplit("/", 1)[0] + "/"
    wrong = []
    for request, status in [
        (urllib.request.Request(address), 404),
        (urllib.request.Request(address + "0" * 32 + "/"), 404),
        (urllib.request.Request(url, headers={"Origin": "http://example.org"}), 403),
        (urllib.request.Request(url, headers={"Host": "example.org"}), 403),
    ]:
        try:
            urllib.request.urlopen(request, timeout=5).read()
            wrong.append(f"{request.full_url} with {request.headers} is answered")
        except urllib.error.HTTPError as error:
            if error.code != status:
                wrong.append(f"{request.full_url} with {request.headers}: status {error.code}, expected {status}")
    return wrong


def watched(browser, process, url, options, folder):
    """Watches the page until the time is over; returns the errors."""
    wrong = []
    live.opened(browser, url)
    if not live.until(browser, 'document.querySelectorAll("#plots svg").length === 12', 60.0):
        return ["the samples are not drawn"]
    start, first, last_print = time.monotonic(), None, 0.0
    killed = False
    while time.monotonic() - start < 60.0 * options.minutes:
        time.sleep(5.0)
        after = time.monotonic() - start
        if process.poll() is not None:
            return wrong + [f"the command ended after {after:.0f} s with status {process.returncode}"]
        now = (heap(browser), resident(process))
        if first is None and after >= WARM_UP_S:
            first = now
            wrong += refused(url)
            if len(urllib.request.urlopen(url, timeout=5).read()) < 1000:
                wrong.append("a second client gets no page")
        if not killed and after >= 2 * WARM_UP_S:
            other = pages.Browser(options.chromium, folder / "other")
            live.opened(other, url)
            other.process.kill()
            browser.call("Page.reload")
            killed = True
        if after - last_print >= 60.0:
            last_print = after
            print(f"live page: {after:.0f} s, page {now[0] / 1e6:.1f} MB, command {now[1] / 1e6:.1f} MB", flush=True)
    for name, then, end in zip(("page", "command"), first, now):
        print(f"live page: memory of the {name} grew by {(end - then) / 1e6:.1f} MB")
        if end - then > LARGEST_GROWTH_BYTES:
            wrong.append(f"the memory of the {name} grew by {end - then} bytes")
    return wrong


def main():
    parser = argparse.ArgumentParser()
    for name in ("dynident", "chromium", "python", "scratch"):
        parser.add_argument(name)
    parser.add_argument("--minutes", type=float, default=10.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True, dir=options.scratch) as temporary:
        folder = pathlib.Path(temporary).resolve()
        browser = pages.Browser(options.chromium, folder / "profile")
        command = [options.dynident, "iterate", study(folder, options.python), "--out", folder / "out", "--allow-command", "--live"]
        with open(folder / "errors", "w") as errors, subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors
        ) as process:
            try:
                while "live page: " not in (text := (folder / "errors").read_text()):
                    if process.poll() is not None:
                        raise SystemExit(text)
                    time.sleep(0.1)
                url = text.split("live page: ")[1].split()[0]
                wrong = watched(browser, process, url, options, folder)
                wrong += [f"console: {message}" for message in browser.console()]
                if not wrong:
                    live.until(browser, "!document.getElementById('stop').disabled", 60.0)
                    browser.value("document.getElementById('stop').click()")
                    process.wait(60)
                    if process.returncode != 130:
                        wrong.append(f"exit status {process.returncode} after the stop button")
            finally:
                process.kill()
        browser.close()
    for finding in wrong:
        print(f"live page: {finding}")
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()
