#!/bin/sh
# compare.sh [--rivals-only | --own-only] VENV OUT [ROUNDS]
# Dynident beside Pinocchio (C++ three ways, Python) and MuJoCo on this machine, one core, alternating: every round runs each
# rival once with Dynident between them, so that a slow minute hits all. Writes JSON lines into OUT and the table to OUT/table.md
# and standard output. ROUNDS defaults to 5 (about 2 minutes each). CORE picks the core (default: the last one); DYNIDENT_BENCHMARK is
# a program in place of the release build, with its options (`target/debug/dynident-benchmark --only rnea` for a trial).
set -eu
rivals_only= own_only=
case ${1:-} in
  --rivals-only) rivals_only=1; shift ;;
  --own-only) own_only=1; shift ;;
esac
[ $# -ge 2 ] || { sed -n '2,6s/^# //p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$2"
venv=$(cd "$1" && pwd) out=$(cd "$2" && pwd) rounds=${3:-5}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
python=$venv/bin/python
pin=
if command -v taskset > /dev/null; then pin="taskset -c ${CORE:-$(($(nproc) - 1))}"; fi

[ -n "$own_only" ] || sh "$here/build_rivals.sh" "$venv" "$out"
cd "$here/.."
own=${DYNIDENT_BENCHMARK:-cargo run --release -q -p dynident-benchmark --bin dynident-benchmark --}
[ -n "$rivals_only" ] || [ -n "${DYNIDENT_BENCHMARK:-}" ] || cargo build --release -q -p dynident-benchmark --bin dynident-benchmark
# Lines of an earlier comparison would mix two states of the program.
rm -f "$out"/*.jsonl

# Words of $own are a program and its options.
own() { [ -n "$rivals_only" ] || $pin $own >> "$out/dynident.jsonl"; }
round=1
while [ "$round" -le "$rounds" ]; do
  echo "round $round of $rounds" >&2
  if [ -n "$own_only" ]; then
    own
    round=$((round + 1))
    continue
  fi
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
