"""Runs the notebook of docs/ as a reader would; an error in a cell, or a plot that is not drawn, is a failure."""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

file = Path(sys.argv[1])
notebook = nbformat.read(file, as_version=4)
NotebookClient(notebook, timeout=300, resources={"metadata": {"path": file.parent}}).execute()
outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
plots = sum("image/png" in output.get("data", {}) for output in outputs)
print(f"{file.name}: {len(notebook.cells)} cells, {plots} plots")
for output in outputs:
    print(output.get("text", ""), end="")
sys.exit(0 if plots == 2 else f"{plots} plots were drawn, 2 are wanted")
