#!/usr/bin/env bash
# forms.sh DYNIDENT SCRATCH VENV: identifies every example with logs in this repository, or in the folder DYNIDENT_DATA, exports the result in every form, compiles the C code, and compares the stated
# errors with those of other programs (benchmarks/forms_referee.py). VENV is a Python environment with golden/requirements.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
dynident=$1
out=$2
venv=$3
data=()
if [ -n "${DYNIDENT_DATA:-}" ]; then
    data=(--data "$DYNIDENT_DATA")
fi
mkdir -p "$out"
for study in ur10_simulated palletizer ur10 panda lbr_med7 lwr4plus_1_to_2 lwr4plus_23_to_1 tx40 tiago; do
    if ! "$dynident" check "examples/$study.toml" "${data[@]}" --quiet >"$out/check" 2>&1 && grep -q 'none of the study' "$out/check"; then
        printf '%s: no logs, skipped\n' "$study"
        continue
    fi
    "$dynident" identify "examples/$study.toml" "${data[@]}" --out "$out/$study" --quiet || [ $? -eq 1 ]
    for form in c cpp rust python matlab casadi jax pinocchio mjcf urdf sdf ros2-yaml json; do
        "$dynident" export "$out/$study" --to "$form" --out "$out/$study.$form" --quiet
    done
    "${CC:-cc}" -std=c99 -Wall -Wextra -Werror -fsyntax-only -x c "$out/$study.c"
    printf '%s: every form written\n' "$study"
done
"$venv/bin/python" benchmarks/forms_referee.py "$dynident" "$out/referee" ${DYNIDENT_DATA:+--data "$DYNIDENT_DATA"}
