#!/bin/sh
# compare.sh [--rivals-only | --own-only] VENV OUT [ROUNDS]
# Compares Dynident with Pinocchio (three C++ builds, Python) and MuJoCo on this machine, on one core. Each round alternates between
# Dynident and the rivals, so that disturbances affect all programs, and measures the limits of the machine. Writes JSON lines
# into OUT and the tables to OUT/table.md and standard output. ROUNDS defaults to 5 (about 3 minutes each). CORE selects the core
# (default: the last one), CSV_ROWS the length of the recording (default: 100,000), PINOCCHIO its builds (default:
# native wheel base). DYNIDENT_BENCHMARK and DYNIDENT replace the release builds and may include options
# (for a trial: `target/debug/dynident-benchmark --only rnea`).
set -eu
rivals_only= own_only=
case ${1:-} in
  --rivals-only) rivals_only=1; shift ;;
  --own-only) own_only=1; shift ;;
esac
[ $# -ge 2 ] || { sed -n '2,8s/^# //p' "$0" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$2"
venv=$(cd "$1" && pwd) out=$(cd "$2" && pwd) rounds=${3:-5}
# An incremental build does not inline SIMD instructions: regressor batches took 2.4 times as long.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 CARGO_INCREMENTAL=0
python=$venv/bin/python
pin=
if command -v taskset > /dev/null; then pin="taskset -c ${CORE:-$(($(nproc) - 1))}"; fi

[ -n "$own_only" ] || sh "$here/build_rivals.sh" "$venv" "$out"
cd "$here/.."
own=${DYNIDENT_BENCHMARK:-cargo run --release -q -p dynident-benchmark --bin dynident-benchmark --}
[ -n "$rivals_only" ] || [ -n "${DYNIDENT_BENCHMARK:-}" ] ||
  cargo build --release -q -p dynident-benchmark --bin dynident-benchmark
[ -n "$rivals_only$own_only" ] || [ -n "${DYNIDENT:-}" ] || cargo build --release -q -p dynident-cli
dynident=${DYNIDENT:-${CARGO_TARGET_DIR:-target}/release/dynident}
log=$out/panda_arm7.csv
# Remove results of earlier versions of the program.
rm -f "$out"/*.jsonl

# $own contains a program and its options.
own() { [ -n "$rivals_only" ] || $pin $own "$@" >> "$out/dynident.jsonl"; }
# Measure the limits of the machine in every round.
limits() { own --limits --csv "$log" ${CSV_ROWS:+--csv-rows "$CSV_ROWS"}; }
round=1
while [ "$round" -le "$rounds" ]; do
  echo "round $round of $rounds" >&2
  limits
  if [ -n "$own_only" ]; then
    round=$((round + 1))
    continue
  fi
  for build in ${PINOCCHIO:-native wheel base}; do
    $pin "$out/bench_$build" "$out" "$build" >> "$out/pinocchio_$build.jsonl"
    own
  done
  $pin "$out/bench_mujoco" robots/ur10.urdf robots/panda_arm7.urdf robots/iiwa14.urdf >> "$out/mujoco.jsonl"
  $pin "$python" "$here/bench_python.py" >> "$out/python.jsonl"
  if [ -z "$rivals_only" ]; then
    long=
    [ "$round" -gt 1 ] || long=--long
    $pin "$python" "$here/bench_commands.py" "$dynident" "$log" "$out" $long >> "$out/commands.jsonl"
  fi
  round=$((round + 1))
done
"$python" "$here/table.py" "$out" | tee "$out/table.md"
if [ -z "$own_only$rivals_only" ]; then
  # The physically consistent fit on random problems, compared with Clarabel's conic solver.
  cargo bench -q -p dynident-estimation --bench physical -- --problems 1000 1058 > "$out/problems.txt"
  { echo; echo '```text'; $pin "$python" "$here/bench_lmi.py" "$out/problems.txt" --scaled; echo '```'; } | tee -a "$out/table.md"
fi
