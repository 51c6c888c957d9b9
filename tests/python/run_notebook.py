"""Runs a notebook of docs/ as a reader would; an error in a cell, or a plot that is not drawn, is a failure.

The file stores outputs, so that it can be read without running it. `FREEPLAY_BLESS=1` stores those of this run.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient


def shape(notebook: Any) -> list[list[list[str]]]:
    """Kinds of the outputs of each code cell. Numbers may differ in the last digit between machines."""
    return [
        [sorted(output.get("data", {"text": ""})) for output in cell.outputs]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


file, plots_wanted = Path(sys.argv[1]), int(sys.argv[2])
notebook = nbformat.read(file, as_version=4)
stored = shape(notebook)
NotebookClient(notebook, timeout=300, resources={"metadata": {"path": file.parent}}).execute()
for cell in notebook.cells:
    cell.metadata.pop("execution", None)
outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
plots = sum("image/png" in output.get("data", {}) for output in outputs)
print(f"{file.name}: {len(notebook.cells)} cells, {plots} plots")
if os.environ.get("FREEPLAY_BLESS") == "1":
    nbformat.write(notebook, file)
    stored = shape(notebook)
if plots != plots_wanted:
    sys.exit(f"{plots} plots were drawn, {plots_wanted} are wanted")
if stored != shape(notebook):
    sys.exit(f"{file.name}: the stored outputs are of another notebook; store them again with FREEPLAY_BLESS=1")
