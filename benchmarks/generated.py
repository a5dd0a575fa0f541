#!/usr/bin/env python3
"""Compares Dynident's algorithms with C code generated for one robot from the same numbers.

    generated.py DYNIDENT_BENCHMARK DESCRIPTION SCRATCH [ROBOT.urdf ..] [--rounds 5]

DYNIDENT_BENCHMARK is the program dynident-benchmark. DESCRIPTION is the example program of dynident-export, which writes a robot as C: inertial parameters are constants, products with zero and one
are omitted and equal values are computed once, as in CppADCodeGen. Both must be release builds. The C code is compiled with gcc and clang, if installed, with -O3 -march=native, with and without
-ffast-math. Each round runs Dynident and each compiled program once. Prints a table with the processor time per call in ns, the minimum of all rounds, at 64 alternating random states.
"""
import argparse
import json
import pathlib
import re
import shutil
import subprocess

ROBOTS = ["ur10", "panda_arm7", "iiwa14"]
ROOT = pathlib.Path(__file__).resolve().parent.parent
QUANTITIES = {"rnea": ("inverse_dynamics", "q, dq, ddq"), "crba": ("mass_matrix", "q"), "aba": ("forward_dynamics", "q, dq, ddq")}
FLAGS = {"O3": ["-O3", "-march=native"], "fast": ["-O3", "-march=native", "-ffast-math"]}

# Alternate the states; with a single state the compiler could keep its sines.
PROGRAM = """
#include "{header}"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#define N {dof}
#define STATES 64
static double q[STATES][N], dq[STATES][N], ddq[STATES][N], out[N * N];
static double now(void) {{ struct timespec t; clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); return 1e9 * t.tv_sec + t.tv_nsec; }}
int main(void) {{
  double sum = 0;
  srand(1);
  for (int s = 0; s < STATES; s++) for (int j = 0; j < N; j++) {{
    q[s][j] = 2.0 * rand() / RAND_MAX - 1.0; dq[s][j] = 2.0 * rand() / RAND_MAX - 1.0; ddq[s][j] = 2.0 * rand() / RAND_MAX - 1.0;
  }}
{parts}
  fprintf(stderr, "%g", sum);
  return 0;
}}
"""
PART = """  {{ double least = 1e300;
    for (int r = 0; r < 21; r++) {{
      double start = now();
      for (int k = 0; k < 300; k++) for (int s = 0; s < STATES; s++) {{ {prefix}_{function}({arguments}, out); sum += out[0]; }}
      double took = (now() - start) / (300.0 * STATES);
      if (took < least) least = took;
    }}
    printf("{quantity} %.2f\\n", least); }}"""


def compiled(description, robot, scratch, prefix_of):
    """Compiled programs of the robot's C code, by name."""
    header = scratch / f"{robot.stem}.h"
    header.write_text(subprocess.run([description, robot, "c"], check=True, capture_output=True, text=True).stdout)
    prefix, dof = prefix_of(header.read_text())
    parts = []
    for quantity, (function, names) in QUANTITIES.items():
        arguments = ", ".join(f"{name}[s]" for name in names.split(", "))
        parts.append(PART.format(prefix=prefix, function=function, arguments=arguments, quantity=quantity))
    source = scratch / f"{robot.stem}.c"
    source.write_text(PROGRAM.format(header=header.name, dof=dof, parts="\n".join(parts)))
    programs = {}
    for compiler in filter(shutil.which, ["gcc", "clang"]):
        for name, flags in FLAGS.items():
            program = scratch / f"{robot.stem}_{compiler}_{name}"
            subprocess.run([compiler, *flags, source, "-o", program, "-lm"], check=True)
            programs[f"{compiler} {name}"] = program
    return programs


def prefix_and_dof(header):
    function = re.search(r"(\w+)_inverse_dynamics\(const double (?:\*\w+|\w+\[(\d+)\])", header)
    joints = function.group(2) or re.search(r"_DOF\s+(\d+)", header).group(1)
    return function.group(1), int(joints)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("benchmark")
    options.add_argument("description")
    options.add_argument("scratch", type=pathlib.Path)
    options.add_argument("robots", nargs="*", type=pathlib.Path)
    options.add_argument("--rounds", type=int, default=5)
    chosen = options.parse_args()
    chosen.scratch.mkdir(parents=True, exist_ok=True)
    robots = chosen.robots or [ROOT / f"robots/{name}.urdf" for name in ROBOTS]
    programs = {robot.stem: compiled(chosen.description, robot, chosen.scratch, prefix_and_dof) for robot in robots}
    least = {}

    def take(robot, quantity, column, nanoseconds):
        key = (robot, quantity, column)
        least[key] = min(least.get(key, nanoseconds), nanoseconds)

    for _ in range(chosen.rounds):
        command = [chosen.benchmark, *(word for quantity in QUANTITIES for word in ("--only", quantity))]
        for line in subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout.splitlines():
            found = json.loads(line)
            if found.get("algo") in QUANTITIES and found.get("robot") in programs:
                take(found["robot"], found["algo"], "Dynident", found["min"])
        for robot, own in programs.items():
            for name, program in own.items():
                for line in subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines():
                    quantity, nanoseconds = line.split()
                    take(robot, quantity, name, float(nanoseconds))
    columns = ["Dynident", *dict.fromkeys(name for own in programs.values() for name in own)]
    print("| robot | quantity |", " | ".join(columns), "| best C / Dynident |")
    print("| --- | --- |", " | ".join("---:" for _ in columns), "| ---: |")
    for robot in programs:
        for quantity in QUANTITIES:
            values = [least[robot, quantity, column] for column in columns]
            print(f"| {robot} | {quantity} |", " | ".join(f"{value:.0f}" for value in values), f"| {min(values[1:]) / values[0]:.2f} |")


if __name__ == "__main__":
    main()
