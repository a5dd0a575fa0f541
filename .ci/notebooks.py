"""notebooks.py: executes every notebook of notebooks/ from the folder of the repository; a cell that raises fails it. Nothing is written."""

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
        sys.exit(f"{path.name}: has outputs; clear them, for they would differ with every run")
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(root)}}).execute()
    print(f"{path.name}: {time.monotonic() - begin:.0f} s")
