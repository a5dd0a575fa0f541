#!/usr/bin/env python3
"""Counts phrases that a reader has to decode, in comments, messages and pages; fails above the limits below. CONTRIBUTING.md (Style) has the rules and examples.

    plain_english.py            the check
    plain_english.py --list     every line with a phrase, too
"""
import pathlib
import re
import subprocess
import sys

# Phrases per 1,000 words, and pages' lines with a sentence of more than 35 words.
LIMITS = {"comments": 1.0, "messages": 0.3, "pages": 1.0}
MAX_LONG_SENTENCES, MAX_WORDS = 20, 35
# Not written by us, or quoted: test vectors, generated files.
SKIPPED = ("golden/", "docs/schemas/", "docs/src/data/", "Cargo.lock")

DATA = r"(?:logs?|data|torques?|rows|residuals|files?|motions?|columns?|stud(?:y|ies)|runs?|robot description)"
PHRASES = {
    "a clause in place of a noun": r"(?:^|[.:;,(] )(?:What|Whatever|Whoever|Of what|Of which|That which)\b(?! (?:is|are|does|do|to|happens)\b)[^.?]{3,80}",
    "'none' or 'no ..' as a predicate": r"\b(?:is|are|was|were) (?:none\b(?!:)|no (?:number|body|page|loop|row|column|law|table|reading|motion|mistake|robot)\b)",
    "data that speak": rf"\b{DATA} (?:says?|said|tells?|told|knows?|asks?|asked|hears?|speaks?|wants?)\b",
    "'told', 'asked for', 'looked for'": r"\b(?:is|are|be|been|was|were) (?:told|asked for|looked for)\b|\btold apart\b|\btell (?:them|it|the two) apart\b",
    "an old word": r"\b(?:mend(?:s|ed|ing)?|beside (?:it|them|its|the)|stands? (?:beside|in|at|for|on|there|here)|hangs? on|whence|thereof|therein|to and fro|ere|nought|hold(?:s)? good|a hair)\b",
    "'of its own'": r"\bof (?:its|their|his|one's) own\b",
    "'so many'": r"\bso (?:many|much|few)\b(?! (?:that|as))",
    "'counts as'": r"\b(?:counts?|counted) (?:as|by|for|in|alone|alike)\b",
    "'came of'": r"\b(?:came|comes|come) (?:of|to)\b(?! (?:an? )?(?:end|conclusion))",
    "'that is one'": r"\b(\w+) that (?:is|are) (?:a |an )?(?:one|\1)\b",
    "'left to the logs'": r"\b(?:are the logs'|leaves? of (?:the|each))\b",
}
COMPILED = {name: re.compile(pattern, re.I) for name, pattern in PHRASES.items()}
CODE = re.compile(r"`[^`]*`")


def of_page(text):
    """Prose of a page: no code blocks, code or link targets."""
    is_code = False
    for number, line in enumerate(text.split("\n"), 1):
        if line.lstrip().startswith("```"):
            is_code = not is_code
        elif not is_code and line.strip():
            yield "pages", number, re.sub(r"\]\([^)]*\)", "]", CODE.sub(" ", line))


def of_code(name, text):
    """Comments, and literals of at least 25 characters outside of tests."""
    mark = "//" if name.endswith(".rs") else "#"
    if name.endswith(".rs"):
        text = re.split(r"(?m)^#\[cfg\(test\)\]\nmod ", text)[0]
    is_test = "/tests/" in name or name.endswith("tests.rs")
    for number, line in enumerate(text.split("\n"), 1):
        stripped = line.strip()
        if stripped.startswith(mark):
            yield "comments", number, CODE.sub(" ", stripped.lstrip("/!# "))
        elif not is_test:
            for literal in re.finditer(r'"((?:[^"\\{}]|\\.|\{[^{}"]*\}){25,})"', line):
                yield "messages", number, re.sub(r"\{[^}]*\}", " ", literal[1])


def main():
    root = pathlib.Path(__file__).resolve().parent.parent
    names = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout.split("\n")
    words, hits, long, lines = dict.fromkeys(LIMITS, 0), dict.fromkeys(LIMITS, 0), 0, []
    for name in names:
        if any(part in name for part in SKIPPED) or not name.endswith((".md", ".rs", ".py")) or name == ".ci/plain_english.py":
            continue
        text = (root / name).read_text(encoding="utf-8")
        for kind, number, piece in of_page(text) if name.endswith(".md") else of_code(name, text):
            words[kind] += len(piece.split())
            found = [phrase for phrase, pattern in COMPILED.items() for _ in pattern.finditer(piece)]
            hits[kind] += len(found)
            is_long = kind == "pages" and "|" not in piece and any(len(s.split()) > MAX_WORDS for s in re.split(r"(?<=[.!?]) ", piece))
            long += is_long
            if found or is_long:
                lines.append(f"{name}:{number}: {', '.join(found) or 'a long sentence'}: {piece.strip()[:120]}")
    if "--list" in sys.argv[1:]:
        print("\n".join(lines))
    failed = long > MAX_LONG_SENTENCES
    for kind, limit in LIMITS.items():
        rate = 1000 * hits[kind] / max(words[kind], 1)
        failed |= rate > limit
        print(f"{kind}: {rate:.2f} phrases per 1,000 words, at most {limit}")
    print(f"pages: {long} long sentences, at most {MAX_LONG_SENTENCES}")
    if failed:
        sys.exit("Too many phrases that a reader has to decode: run .ci/plain_english.py --list, and see CONTRIBUTING.md (Style).")


if __name__ == "__main__":
    main()
