#!/usr/bin/env bash
# archive.sh FOLDER TARGET OUT: packs the program in FOLDER (built with `--profile dist`) as OUT/dynident-VERSION-TARGET.tar.gz (.zip for Windows), with completions,
# manual pages, licences and the built book (`mdbook build docs`). Before packing it checks the size of the program and identifies the robot of README.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$1
target=$2
mkdir -p "$3"
out=$(cd "$3" && pwd)
# Documented size limit with all formats, megabytes.
most_bytes=20000000

program=dynident
case $target in *windows*) program=dynident.exe ;; esac
binary=$folder/$program
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

bytes=$(wc -c <"$binary" | tr -d ' ')
printf '%s: %s bytes\n' "$target" "$bytes"
if [ "$bytes" -ge "$most_bytes" ]; then
    printf 'the program has %s bytes, more than %s\n' "$bytes" "$most_bytes" >&2
    exit 1
fi
"$binary" identify examples/ur10_simulated.toml --out "$scratch/result" --quiet >"$scratch/told" || { cat "$scratch/told"; exit 1; }
"$binary" log golden/formats/two_clocks.mcap --quiet >"$scratch/told" || { cat "$scratch/told"; exit 1; }

version=$("$binary" --version | tr -d '\r')
name=dynident-${version#dynident }-$target
packed=$scratch/$name
mkdir -p "$packed/completions" "$packed/man/man1"
[ -f target/book/index.html ] || { echo 'target/book is missing: run mdbook build docs' >&2; exit 1; }
cp -R target/book "$packed/book"
# The archive does not contain the files that README links to.
sed -E "s#\]\(([^):]*)\)#](https://github.com/dynident/dynident/blob/v${version#dynident }/\1)#g" README.md >"$packed/README.md"
cp "$binary" CHANGELOG.md CITATION.cff LICENSE-MIT LICENSE-APACHE "$packed"
"$binary" completions bash >"$packed/completions/dynident.bash"
"$binary" completions zsh >"$packed/completions/_dynident"
"$binary" completions fish >"$packed/completions/dynident.fish"
"$binary" completions powershell >"$packed/completions/_dynident.ps1"
"$binary" completions elvish >"$packed/completions/dynident.elv"
"$binary" man "$packed/man/man1"

cd "$scratch"
case $target in
    *windows*) 7z a -bso0 "$out/$name.zip" "$name" && ls -l "$out/$name.zip" ;;
    *) tar -czf "$out/$name.tar.gz" "$name" && ls -l "$out/$name.tar.gz" ;;
esac
