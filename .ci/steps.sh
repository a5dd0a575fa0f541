# Shared functions of .ci/run and .ci/long.

# Property tests use the same cases in every run, so that a failure is caused by a change. Without this variable the cases are random (CONTRIBUTING.md).
export PROPTEST_RNG_SEED=20261121
# Nothing is built twice here, so incremental builds only cost time.
export CARGO_INCREMENTAL=0

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# step NAME SECONDS COMMAND...: runs one check with a time limit and prints its duration.
step() {
    local name=$1 limit=$2 start=$SECONDS status=0
    shift 2
    printf '\n== %s\n' "$name"
    timeout "$limit" "$@" || status=$?
    if [ "$status" -eq 124 ]; then
        printf '== %s: stopped after %s s\n' "$name" "$limit" >&2
        exit 1
    elif [ "$status" -ne 0 ]; then
        printf '== %s: failed with exit status %s\n' "$name" "$status" >&2
        exit 1
    fi
    printf '== %s: passed in %s s\n' "$name" "$((SECONDS - start))"
}

# readme_command PREFIX: returns a command of README, so that the check uses the documented command.
readme_command() {
    local line
    line=$(grep -m 1 "^$1" README.md) || { echo "README.md has no line that begins with: $1" >&2; exit 1; }
    # Remove the comment at the end of the line.
    printf '%s' "${line%%[[:space:]]#*}" | sed 's/[[:space:]]*$//'
}

# test_program PACKAGE NAME: the test program NAME of a package, built by the tests above (all features of the workspace).
test_program() {
    cargo test --workspace --locked --no-run --message-format json | python3 -c '
import json, sys
package, name = sys.argv[1:]
built = [json.loads(line) for line in sys.stdin]
tests = [
    one["executable"] for one in built
    if one.get("executable") and one["profile"]["test"] and one["target"]["name"] == name and f"/{package}/" in one["manifest_path"]
]
assert len(tests) == 1, tests
print(tests[0])' "$1" "$2"
}
export -f test_program

# Unit tests of excitation with four SIMD lanes.
portable_excitation() {
    local program
    program=$(test_program dynident-excitation dynident_excitation)
    cd crates/dynident-excitation
    DYNIDENT_INSTRUCTIONS=portable "$program" --quiet
}
export -f portable_excitation

# mujoco_robot PYTHON: the test with an external robot, which is ignored by default because it needs MuJoCo.
mujoco_robot() {
    local program
    program=$(test_program dynident-iteration it)
    cd crates/dynident-iteration
    DYNIDENT_PYTHON=$1 "$program" --ignored --exact robots::mujoco_is_a_robot
}
export -f mujoco_robot

# A virtual environment; on Debian `venv` needs the separate package python3-venv.
python_environment() {
    if ! python3 -m venv "$1/venv"; then
        [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null || {
            echo "python3 cannot make a virtual environment: install python3-venv" >&2
            return 1
        }
        apt-get update -qq
        apt-get install -y -qq python3-venv
        rm -rf "$1/venv"
        python3 -m venv "$1/venv"
    fi
    "$1/venv/bin/pip" install --quiet --disable-pip-version-check -r golden/requirements.txt
}
export -f python_environment

# Programs for export checks outside the Python environment: a second C compiler, and libsdformat.
readers_of_exports() {
    if command -v clang >/dev/null && command -v pkg-config >/dev/null && pkg-config --list-all | grep -q '^sdformat'; then
        return 0
    fi
    [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null || {
        echo "the export checks need clang, libsdformat-dev and pkg-config: install them" >&2
        return 1
    }
    apt-get update -qq
    apt-get install -y -qq clang libsdformat-dev pkg-config
}
export -f readers_of_exports

# Prints the path of a browser, which is installed if necessary. DYNIDENT_CHROMIUM names another one.
browser() {
    local found=${DYNIDENT_CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
    if [ -z "$found" ]; then
        [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null || {
            echo "no browser found: install chromium, or set DYNIDENT_CHROMIUM" >&2
            return 1
        }
        apt-get update -qq >&2
        apt-get install -y -qq chromium >&2
        found=$(command -v chromium)
    fi
    printf '%s' "$found"
}
export -f browser

# with_browser COMMAND..: repeats a check once if the browser crashed or hung (status 75, see .ci/pages.py).
with_browser() {
    local status=0
    "$@" || status=$?
    if [ "$status" -eq 75 ]; then
        echo 'once more, with a new browser' >&2
        status=0
        "$@" || status=$?
    fi
    return "$status"
}
export -f with_browser

# pages_in_a_browser SCRATCH: checks the generated reports in a browser; see .ci/pages.py.
pages_in_a_browser() {
    local program
    program=$(browser)
    "$1/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --target "$1/page_libraries" -r .ci/requirements.txt
    with_browser python3 .ci/pages.py "$program" "$1/page_libraries" "$1"/commands/{paper,result,iteration,motion}/report.html "$1"/commands/{gallery,view,logs,changes}.html
    with_browser "$1/venv/bin/python" .ci/view.py target/release/dynident "$program" "$1"
    with_browser python3 .ci/plot.py target/release/dynident "$program" "$1/page_libraries" "$1"
    with_browser python3 .ci/screenshots.py "$program" "$1"
    with_browser python3 .ci/live.py target/release/dynident "$program" "$1/page_libraries" "$1"
}
export -f pages_in_a_browser

# mdbook of the version in CONTRIBUTING.md, as target/mdbook/bin/mdbook. Without its server it builds in a third of the time.
mdbook_program() {
    local version
    version=$(sed -n 's/^cargo install mdbook --version \([^ ]*\).*/\1/p' CONTRIBUTING.md)
    cargo install mdbook --version "$version" --locked --no-default-features --features search --root target/mdbook --target-dir target/mdbook/build
}
export -f mdbook_program

# Builds the book and checks its pages; see .ci/book.py.
book_in_a_browser() {
    local program
    program=$(browser)
    target/mdbook/bin/mdbook build docs
    with_browser python3 .ci/book.py "$program" target/book
}
export -f book_in_a_browser
