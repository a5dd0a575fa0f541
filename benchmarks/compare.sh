#!/bin/sh
# compare.sh [--rivals-only] VENV OUT [ROUNDS]
# Dynident beside Pinocchio (C++ three ways, Python) and MuJoCo on this machine, one core, alternating: every round runs each
# rival once with Dynident between them, so that a slow minute hits all. Writes JSON lines into OUT and the table to OUT/table.md
# and standard output. ROUNDS defaults to 5 (about 2 minutes each). CORE picks the core (default: the last one).
set -eu
rivals_only=
[ "${1:-}" = --rivals-only ] && { rivals_only=1; shift; }
[ $# -ge 2 ] || { sed -n '2,5s/^# //p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$2"
venv=$(cd "$1" && pwd) out=$(cd "$2" && pwd) rounds=${3:-5}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
python=$venv/bin/python
pin=
if command -v taskset > /dev/null; then pin="taskset -c ${CORE:-$(($(nproc) - 1))}"; fi

sh "$here/build_rivals.sh" "$venv" "$out"
cd "$here/.."
[ -n "$rivals_only" ] || cargo build --release -q -p dynident-benchmark
# Lines of an earlier comparison would mix two states of the program.
rm -f "$out"/*.jsonl

own() { [ -n "$rivals_only" ] || $pin cargo run --release -q -p dynident-benchmark >> "$out/dynident.jsonl"; }
round=1
while [ "$round" -le "$rounds" ]; do
  echo "round $round of $rounds" >&2
  for build in native wheel base; do
    $pin "$out/bench_$build" "$out" "$build" >> "$out/pinocchio_$build.jsonl"
    own
  done
  $pin "$out/bench_mujoco" robots/ur10.urdf robots/panda_arm7.urdf robots/iiwa14.urdf >> "$out/mujoco.jsonl"
  $pin "$python" "$here/bench_python.py" >> "$out/python.jsonl"
  own
  round=$((round + 1))
done
"$python" "$here/table.py" "$out" | tee "$out/table.md"
