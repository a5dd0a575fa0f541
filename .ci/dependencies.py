"""Checks the dependencies of the command in Cargo.lock: permissive licences, public registry only, no newer Rust version required.

Reads `cargo metadata --locked`. Crates with several versions are listed, but are not an error. Exit status 1 with one line for each violation.
"""
import json
import re
import subprocess
import sys

# Permissive licences only: the binary may be linked into anything.
ALLOWED = {"MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "ISC", "Unicode-3.0", "Unlicense", "Zlib", "bzip2-1.0.6"}
REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"


def allowed(expression):
    """Whether an SPDX expression (AND binds tighter than OR; the old form with a slash is OR) can be satisfied with the allowed licences."""
    words = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))

    def alternatives():
        fine = joint()
        while words and words[0] == "OR":
            words.pop(0)
            fine = joint() or fine
        return fine

    def joint():
        fine = single()
        while words and words[0] == "AND":
            words.pop(0)
            fine = single() and fine
        return fine

    def single():
        word = words.pop(0)
        if word == "(":
            fine = alternatives()
            words.pop(0)
            return fine
        if words and words[0] == "WITH":
            word = f"{word} WITH {words[1]}"
            del words[:2]
        return word in ALLOWED

    return alternatives()


def version(text):
    return tuple(int(part) for part in text.split(".")[:2])


def main():
    told = subprocess.run(["cargo", "metadata", "--locked", "--format-version", "1"], check=True, capture_output=True, text=True)
    metadata = json.loads(told.stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    members = [packages[member] for member in metadata["workspace_members"]]
    offences = []
    stated = min(version(member["rust_version"]) for member in members)
    for package in packages.values():
        name = f"{package['name']} {package['version']}"
        licence = package["license"]
        if licence is None or not allowed(licence):
            offences.append(f"{name}: licence {licence}")
        if package["source"] not in (None, REGISTRY):
            offences.append(f"{name}: from {package['source']}")
        if package["rust_version"] and version(package["rust_version"]) > stated:
            offences.append(f"{name}: requires Rust {package['rust_version']}, the workspace states {stated[0]}.{stated[1]}")
    for member in members:
        for dependency in member["dependencies"]:
            if dependency["req"] == "*" and dependency["path"] is None:
                offences.append(f"{member['name']}: any version of {dependency['name']}")
    versions = {}
    for package in packages.values():
        versions.setdefault(package["name"], []).append(package["version"])
    for name, several in sorted(versions.items()):
        if len(several) > 1:
            print(f"{name} in {len(several)} versions: {', '.join(several)}")
    print("\n".join(offences) or f"{len(packages)} crates: all licences, sources and Rust versions are accepted")
    sys.exit(1 if offences else 0)


if __name__ == "__main__":
    main()
