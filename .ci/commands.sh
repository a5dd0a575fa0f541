#!/usr/bin/env bash
# commands.sh SCRATCH VENV: runs the commands of README and the book once, in short form, with the release build of the command and the test builds of the measurement programs
# (a release build of each would take minutes). Outputs go to SCRATCH; VENV is a Python environment with golden/requirements.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$1
venv=$2
dynident=target/release/dynident
examples=target/debug/examples

# run STATUS COMMAND...: prints the command and its duration; prints its output only if the exit status differs from STATUS.
run() {
    local wanted=$1 status=0 start=$SECONDS
    shift
    "$@" >"$out/last" 2>&1 || status=$?
    printf '%4s s  %s\n' "$((SECONDS - start))" "$*"
    if [ "$status" -ne "$wanted" ]; then
        cat "$out/last"
        printf 'exit status %s, expected %s\n' "$status" "$wanted" >&2
        exit 1
    fi
}

# README and the first pages: the user's robot.
run 0 "$dynident" docs
run 0 "$dynident" docs troubleshooting
run 0 "$dynident" docs --search lag
run 0 "$dynident" docs study-toml
run 0 "$dynident" completions bash
run 0 "$dynident" man "$out/man"
run 0 "$dynident" inspect robots/ur10.urdf
run 0 "$dynident" check examples/ur10_simulated.toml
run 0 "$dynident" log examples/ur10_simulated/train.csv
run 0 "$dynident" log golden/formats/two_clocks.mcap --json
run 0 "$dynident" log golden/formats/bag
run 0 "$dynident" new --robot robots/ur10.urdf --log examples/ur10_simulated/train.csv examples/ur10_simulated/test.csv --out "$out/new.toml"
run 0 "$dynident" check "$out/new.toml"
run 0 "$dynident" identify "$out/new.toml" --out "$out/new"
run 0 "$dynident" export "$out/new" --to c --out "$out/arm.h"
run 0 "${CC:-cc}" -std=c99 -Wall -Wextra -Werror -fsyntax-only -x c "$out/arm.h"
run 0 "$venv/bin/python" .ci/first_minutes.py "$dynident" "$out/first_minutes"
# An exporter error negates all first moments: it is reported, and corrected in a copy.
sed -E 's/(i[xyz][xyz]=")([1-9]|0\.0*[1-9])/\1-\2/g' robots/iiwa14.urdf >"$out/slip.urdf"
run 1 "$dynident" inspect "$out/slip.urdf" --json
run 0 "$dynident" inspect "$out/slip.urdf" --fix "$out/mended.urdf"
run 0 cmp "$out/mended.urdf" robots/iiwa14.urdf
run 0 "$dynident" identify examples/ur10_simulated.toml --out "$out/result"
run 0 "$dynident" validate "$out/result/result.json" --study examples/ur10_simulated.toml
run 0 "$dynident" view robots/ur10.urdf --out "$out/view.html"
run 0 "$dynident" view examples/ur10_simulated.toml --out "$out/logs.html"
run 0 "$dynident" plot "$out/result" --figure parameters --out "$out/parameters.svg" --out "$out/parameters.csv" --out "$out/parameters.tex" --out "$out/parameters.md"
run 0 "$dynident" plot "$out/result" --figure friction --width-mm 180 --out "$out/friction.svg"
run 0 "$dynident" plot "$out/result" --figure residuals --study examples/ur10_simulated.toml --out "$out/residuals.svg"
run 0 "$dynident" compare "$out/result"
run 0 "$dynident" compare "$out/result" "$out/new" --out "$out/changes.html" --robot robots/ur10.urdf
# Factors of logs, in two files and in one file, give the same model.
run 2 "$dynident" reduce examples/ur10_simulated.toml --out "$out/train.factors"
run 0 "$dynident" reduce examples/ur10_simulated.toml --like "$out/result/result.json" --out "$out/train.factors"
run 0 "$dynident" reduce examples/ur10_simulated.toml --like "$out/result/result.json" --log test --arm left --recorded-at 2026-01-05 --out "$out/test.factors"
run 0 "$dynident" merge "$out/test.factors" "$out/train.factors" --out "$out/both.factors"
run 0 "$dynident" identify --factors "$out/both.factors" --out "$out/of_factors"
for form in c cpp rust python matlab casadi jax pinocchio mjcf urdf sdf ros2-yaml json simulator simulator-table; do
    run 0 "$dynident" export "$out/result/result.json" --study examples/ur10_simulated.toml --to "$form" --out "$out/exported.$form"
done
run 0 "$venv/bin/python" .ci/export.py "$dynident" "$out/result/result.json" examples/ur10_simulated.toml "$out/export" "$examples/description"
run 0 "$venv/bin/python" .ci/simulator.py "$dynident" "$out/result/result.json" examples/ur10_simulated.toml examples/ur10_simulated "$out/simulator"
# Replay of the test recording in MuJoCo, before and after identification.
run 0 "$venv/bin/python" examples/replay_in_mujoco.py robots/ur10.urdf "$out/exported.mjcf" examples/ur10_simulated/test.csv \
    --position 'q{1..6}_rad' --torque 'tau{1..6}_Nm' --require-better
run 0 "$examples/simulate_ur10" "$out/ur10_simulated"
# Dependent joints: two closed chains, identified, exported and compared with MuJoCo.
run 0 "$dynident" simulate examples/palletizer.toml --out "$out/palletizer_run"
run 0 "$dynident" check examples/palletizer.toml
run 0 "$venv/bin/python" .ci/coupled.py "$dynident" "$out/palletizer"

# The studies of the pages of common robots, on simulated recordings with the columns of the vendors' recorders.
run 0 "$venv/bin/python" docs/recordings.py "$dynident" "$out/recordings"

# A designed motion, its evaluation, and its torques.
run 0 "$dynident" design examples/design_ur10.toml --out "$out/motion" --to ros2
run 0 "$dynident" design examples/design_ur10.toml --check "$out/motion/trajectory.csv" --out "$out/checked"
run 0 "$dynident" design examples/ur10_simulated.toml --check-log train --out "$out/log_checked"
run 0 "$dynident" evaluate robots/ur10.urdf --states "$out/motion/trajectory.csv" --quantity inverse-dynamics --out "$out/torques.csv"
run 0 "$dynident" design examples/design_paper.toml --out "$out/paper_motion"

# One run, the iteration, the paper.
run 0 "$dynident" simulate examples/iterate_ur10.toml --out "$out/run"
run 0 "$dynident" iterate examples/iterate_paper_2r.toml --out "$out/iteration"
run 0 "$dynident" iterate examples/iterate_paper_2r_friction.toml --out "$out/friction"
# An external robot: MuJoCo behind the line protocol, with the Python of the environment. The identified robot is tested on a run of another motion. An iteration
# that is limited to one run ends with status 1.
sed -e "s#\"python3\"#\"$venv/bin/python\"#" -e 's#"\.\./robots#"'"$PWD"'/robots#' examples/iterate_ur10_mujoco.toml >"$out/mujoco.toml"
run 0 "$dynident" iterate "$out/mujoco.toml" --out "$out/outside" --allow-command
sed -e 's/max_runs = 5/max_runs = 1/' -e 's/^seed = 1/seed = 2/' "$out/mujoco.toml" >"$out/mujoco_other.toml"
run 1 "$dynident" iterate "$out/mujoco_other.toml" --out "$out/outside_other" --allow-command
{
    sed -n '/^\[robot\]/,/^offset/p' "$out/mujoco.toml"
    printf '\n[format]\ntime = { column = "t_s" }\nposition = { columns = "q{1..6}" }\ntorque = { columns = "tau{1..6}" }\n'
    printf '\n[[log]]\nfile = "outside_other/runs/run_1/log.csv"\nrole = "validate"\n'
} >"$out/mujoco_test.toml"
run 0 "$dynident" validate "$out/outside/result.json" --study "$out/mujoco_test.toml" --max-validation-error 5
# A robot without faults that differs from its description, and a robot with saturated drives.
run 0 "$venv/bin/python" benchmarks/campaign.py "$dynident" --out "$out/campaign" --only panda --quick
run 0 "$venv/bin/python" benchmarks/loop_faults.py "$dynident" --out "$out/loop_faults" --only ur10 --integrators mujoco --quick
run 0 "$dynident" reproduce --out "$out/paper"

# The programs that produce the tables of the book, with minimum settings.
run 0 "$dynident" benchmark --runs 2 --seed 1 --robots planar2r --noise standard --out "$out/benchmark"
run 0 target/debug/dynident-benchmark --only rnea
run 0 "$examples/designs" --seconds 0.2 --criteria d-optimal --families Fourier examples/design_ur10.toml
run 0 "$examples/iterations" 1 examples/iterate_paper_2r_noise.toml
run 0 "$examples/redesign" 1 examples/iterate_planar_3r.toml
run 0 "$examples/cutoffs" 1 1
run 0 "$examples/friction" 1 1
run 0 "$examples/default_study" --quick --out "$out/default"
run 0 "$examples/basin" 2 601
run 0 "$examples/logistic_against_fourier" 2 0.3
run 0 "$examples/differentiators" 1 12
run 0 "$examples/import_speed" 20000
# All formats give the same numbers, and memory use does not grow with the length of the recording.
run 0 "$venv/bin/python" benchmarks/log_formats.py "$dynident" "$out/log_formats" --rows 80000 --runs 1 --check
run 0 "$examples/gallery" "$out/gallery.html"
run 0 target/debug/dynident-benchmark --limits --only peak_flops,text --csv "$out/panda_arm7.csv" --csv-rows 2000 planar2r
run 0 env DYNIDENT_BENCHMARK='target/debug/dynident-benchmark --only rnea' benchmarks/compare.sh --own-only "$venv" "$out/compare" 1
run 0 "$venv/bin/python" benchmarks/bench_commands.py "$dynident" "$out/panda_arm7.csv" "$out"
run 0 "$venv/bin/python" benchmarks/growth.py "$dynident" target/debug/dynident-benchmark "$out/growth" --logs 1 --joints 2 --only logs identify --out "$out/growth.csv"
run 0 "$venv/bin/python" benchmarks/generated.py target/debug/dynident-benchmark "$examples/description" "$out/generated" robots/ur10.urdf --rounds 1
run 0 python3 docs/summaries.py --check
run 0 python3 docs/claims.py
