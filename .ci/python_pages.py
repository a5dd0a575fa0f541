"""python_pages.py PAGE..: runs the Python blocks of each page as one program in the folder of the repository."""

import re
import sys
import time
from pathlib import Path

for page in sys.argv[1:]:
    text = Path(page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert blocks, f"{page} has no Python block"
    begin = time.monotonic()
    # Empty lines keep the line numbers of the page.
    source, line = "", 1
    for match in re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        at = text[: match.start(1)].count("\n") + 1
        source += "\n" * (at - line) + match.group(1)
        line = at + match.group(1).count("\n")
    exec(compile(source, page, "exec"), {"__name__": "__main__"})
    print(f"{page}: {len(blocks)} blocks in {time.monotonic() - begin:.0f} s")
