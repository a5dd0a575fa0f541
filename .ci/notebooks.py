"""notebooks.py: executes every notebook of notebooks/ in the folder of the repository. Fails if a cell raises an exception. Writes nothing."""

import sys
import time
from pathlib import Path

import nbclient
import nbformat

root = Path(__file__).resolve().parents[1]
found = sorted((root / "notebooks").glob("*.ipynb"))
assert found, "notebooks/ is empty"
for path in found:
    begin = time.monotonic()
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    stored = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.outputs]
    if stored:
        sys.exit(f"{path.name}: contains outputs, which differ in every run: clear them")
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(root)}}).execute()
    print(f"{path.name}: {time.monotonic() - begin:.0f} s")
