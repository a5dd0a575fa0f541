"""Measures complete commands: `dynident identify` on the examples and on a long CSV, compared with pandas.read_csv of the same file. Times
are processor time of all threads in ns, without imports and the start of Python.

    bench_commands.py DYNIDENT LOG.csv SCRATCH [--long]

LOG.csv is the recording of the Panda arm written by `dynident-benchmark --limits`; --long also identifies it. Results are per row for
`read_csv` and `identify_csv`, and per command for `identify`. One thread each.
"""
import argparse
import os
import pathlib
import resource
import subprocess
import time

import pandas
from common import ROBOTS, figure, machine

REPEATS = 3
EXAMPLES = ["ur10_simulated"]
STUDY = """[robot]
file = "{robot}"
[format]
time = {{ column = "t" }}
position = {{ columns = "q{{1..7}}" }}
velocity = {{ columns = "dq{{1..7}}" }}
torque = {{ columns = "tau{{1..7}}" }}
[[log]]
file = "{log}"
fraction = [0.0, 0.8]
[[log]]
file = "{log}"
fraction = [0.8, 1.0]
role = "validate"
"""


def command_ns(command):
    """Processor time of a command with all its threads. Status 1 (negative verdict) is accepted, because the work is the same."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{' '.join(map(str, command))}: exit status {done.returncode}\n{done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return 1e9 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("dynident")
    options.add_argument("log", type=pathlib.Path)
    options.add_argument("scratch", type=pathlib.Path)
    options.add_argument("--long", action="store_true")
    chosen = options.parse_args()
    out = chosen.scratch / "result"
    # The table column with Dynident's results at the best SIMD level of this processor.
    level = os.environ.get("DYNIDENT_INSTRUCTIONS") or machine()["simd"]

    def identify(study):
        return command_ns([chosen.dynident, "identify", study, "--out", out, "--quiet", "--threads", "1"])

    for example in EXAMPLES:
        study = ROBOTS.parent / "examples" / f"{example}.toml"
        figure("dynident", level, example, 6, "identify", [identify(study) for _ in range(REPEATS)])
    rows = len(pandas.read_csv(chosen.log))
    ns = []
    for _ in range(REPEATS):
        begin = time.process_time_ns()
        pandas.read_csv(chosen.log)
        ns.append((time.process_time_ns() - begin) / rows)
    figure("pandas", "wheel", "panda_arm7", 7, "read_csv", ns)
    if chosen.long:
        study = chosen.scratch / "log.toml"
        study.write_text(STUDY.format(robot=ROBOTS / "panda_arm7.urdf", log=chosen.log.resolve()))
        figure("dynident", level, "panda_arm7", 7, "identify_csv", [identify(study) / rows for _ in range(REPEATS)])


if __name__ == "__main__":
    main()
