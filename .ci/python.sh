#!/usr/bin/env bash
# python.sh SCRATCH [--long]: installs the Python package as in README into a clean environment with `python3` and checks tests, types, stubs and the pages of the book. With --long also the
# notebooks, the comparison with other tools, and the tests with the oldest (3.10 or newer, NumPy 1.26) and the newest installed Python. Other versions are searched on the path
# and under PYENV_ROOT.
set -euo pipefail
cd "$(dirname "$0")/.."
scratch=$1
# Uses the build settings of the main job, so that only the extension module is compiled and linked here. Released packages use the profile of pyproject.toml, which needs twice
# eight minutes of processor time for linking (docs/decisions/0012-builds-and-packages.md).
# Released wheels have no symbols either.
export MATURIN_PEP517_ARGS="--profile release --strip"
# Measured 17.0 MB with the robot in three dimensions and the readers of ROS 1, ULog and CBOR; identification from commands, figures and the live
# page add 3 % to the command; 18.5 MB with the writer of LeRobot data sets (Parquet) and exports of servos; 19.1 MB with the readers of
# the tables of `[thresholds]`. Released wheels have link-time optimisation and are smaller.
most_bytes=19200000

# interpreters: the installed Python versions as `minor path`, oldest first.
interpreters() {
    local path minor
    for path in $(compgen -c python3 | sort -u | grep -E '^python3(\.[0-9]+)?$' || true) "${PYENV_ROOT:-$HOME/.pyenv}"/versions/*/bin/python3; do
        minor=$("$path" -c 'import sys; print(sys.version_info[1] if sys.version_info[0] == 3 else 0)' 2>/dev/null) || continue
        if [ "$minor" -ge 10 ] && "$path" -c 'import ensurepip, venv' 2>/dev/null; then
            printf '%s %s\n' "$minor" "$(command -v "$path")"
        fi
    done | sort -n -k1,1 -u
}

# environment NAME PYTHON PACKAGE OTHERS..: a clean environment with the package (`.` as in README, or a wheel) and other packages.
environment() {
    local name=$1 python=$2 package=$3
    shift 3
    "$python" -m venv "$scratch/$name"
    # shellcheck disable=SC2068
    "$scratch/$name/bin/pip" install --quiet --disable-pip-version-check $@
    "$scratch/$name/bin/pip" install --disable-pip-version-check --no-deps "$package" >"$scratch/last" 2>&1 || { cat "$scratch/last"; exit 1; }
}

start=$SECONDS
environment python python3 . -r python/tests/requirements.txt
printf '%4s s  pip install .\n' "$((SECONDS - start))"
bytes=$(sed -n 's/.*filename=dynident.* size=\([0-9]*\) .*/\1/p' "$scratch/last")
printf '        wheel of %s bytes\n' "$bytes"
[ "$bytes" -lt "$most_bytes" ]
here=$PWD
program=$scratch/python/bin
"$program/dynident" --version
long=()
[ "${2:-}" != --long ] || long=(env DYNIDENT_LONG=1)
"${long[@]}" "$program/python" -m pytest -q -p no:cacheprovider python/tests
(cd "$scratch" && "$program/mypy" --config-file "$here/pyproject.toml" -p dynident)
(cd "$scratch" && "$program/stubtest" --mypy-config-file "$here/pyproject.toml" --allowlist "$here/python/tests/allowed.txt" dynident)
"$program/python" .ci/python_pages.py docs/src/python.md docs/src/python-functions.md docs/src/fleets.md docs/src/online.md
"$program/python" benchmarks/fleet.py --quick
[ "${2:-}" = --long ] || exit 0

"$program/python" .ci/notebooks.py
# One wheel for all Python versions; pip would link a new one for each.
"$program/pip" wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$scratch/wheel" .
# Short comparison with FIGAROH and mujoco.sysid.
environment rivals python3 "$scratch"/wheel/dynident-*.whl -r benchmarks/rivals/requirements.txt
start=$SECONDS
"$scratch/rivals/bin/python" -W ignore benchmarks/rivals --quick --out "$scratch/rivals_compared" >"$scratch/last" 2>&1 || { cat "$scratch/last"; exit 1; }
printf '%4s s  benchmarks/rivals --quick\n' "$((SECONDS - start))"

while read -r minor path; do
    case $minor in
        "$(interpreters | head -n 1 | cut -d ' ' -f 1)") numpy='numpy==1.26.4' ;;
        "$(interpreters | tail -n 1 | cut -d ' ' -f 1)") numpy='numpy' ;;
        *) continue ;;
    esac
    [ "$minor" -le 12 ] || numpy=numpy
    environment "python3.$minor" "$path" "$scratch"/wheel/dynident-*.whl pytest==9.2.0 "$numpy"
    printf '        %s: ' "$("$scratch/python3.$minor/bin/python" -c 'import sys, numpy; print("Python", sys.version.split()[0], "NumPy", numpy.__version__)')"
    "$scratch/python3.$minor/bin/python" -m pytest -q -p no:cacheprovider python/tests
done < <(interpreters)
