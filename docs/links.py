"""Preprocessor of mdbook: changes links to files outside of the book, so that they work in the built pages.

Links to files of the repository lead to its web page. Links of the decisions lead to their place in the book. mdbook runs this
script (docs/book.toml); in the repository the links stay relative.
"""

import json
import pathlib
import re
import sys

DOCS = pathlib.Path(__file__).resolve().parent


def anchor(heading):
    """Identifier that mdbook gives to a heading."""
    plain = re.sub(r"[^\w\s-]", "", heading.replace("`", "").lower())
    return re.sub(r"\s", "-", plain.strip())


def decision(file):
    """Anchor of a decision in the page of decisions."""
    first = (DOCS / "decisions" / file).read_text(encoding="utf-8").splitlines()[0]
    return anchor(first.removeprefix("## "))


def converted(text, repository):
    """Text of a page with the links of the built book."""
    text = re.sub(r"\]\((?:\.\./\.\./docs/decisions/)?(\d{4}-[^)#]*\.md)\)", lambda found: f"](decisions.md#{decision(found[1])})", text)
    text = text.replace("](../src/", "](")
    return re.sub(r"\]\(\.\./\.\./([^)]*)\)", lambda found: f"]({repository}/blob/main/{found[1]})", text)


def convert(items, repository):
    for item in items:
        chapter = item.get("Chapter") if isinstance(item, dict) else None
        if chapter:
            chapter["content"] = converted(chapter["content"], repository)
            convert(chapter["sub_items"], repository)


def main():
    # `links.py supports RENDERER`: every renderer is supported.
    if sys.argv[1:2] == ["supports"]:
        return
    context, book = json.load(sys.stdin)
    repository = context["config"]["output"]["html"]["git-repository-url"]
    # mdbook 0.4 names the list of chapters `sections`.
    convert(book["items"] if "items" in book else book["sections"], repository)
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
