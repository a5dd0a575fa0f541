"""notebooks.py [--write]: executes every notebook of notebooks/ in an empty folder with the environment variable DYNIDENT_REPOSITORY, and in notebooks/,
where Jupyter starts it. Fails if a cell raises an exception, or if a notebook has no stored outputs or no picture. With --write the outputs are stored."""

import os
import sys
import tempfile
import time
from pathlib import Path

import nbclient
import nbformat

root = Path(__file__).resolve().parents[1]
found = sorted((root / "notebooks").glob("*.ipynb"))
assert found, "notebooks/ is empty"
PICTURES = {"image/png", "image/svg+xml"}


def outputs(notebook):
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def executed(notebook, folder):
    resources = {"metadata": {"path": str(folder)}}
    return nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()


for number, path in enumerate(found):
    begin = time.monotonic()
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    stored = outputs(notebook)
    # Every other notebook elsewhere, so that each way is used and none is run twice.
    if number % 2 == 0 and "--write" not in sys.argv:
        os.environ["DYNIDENT_REPOSITORY"] = str(root)
        with tempfile.TemporaryDirectory() as folder:
            executed(notebook, folder)
        del os.environ["DYNIDENT_REPOSITORY"]
    else:
        executed(notebook, path.parent)
    if "--write" in sys.argv:
        for cell in notebook.cells:
            # Times of execution differ in every run.
            cell.metadata.pop("execution", None)
        nbformat.write(notebook, path)
        stored = outputs(notebook)
    if not any(PICTURES & set(output.get("data", {})) for output in stored):
        sys.exit(f"{path.name}: no stored picture: run .ci/notebooks.py --write, and commit the result")
    print(f"{path.name}: {time.monotonic() - begin:.0f} s")
