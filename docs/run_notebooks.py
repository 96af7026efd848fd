"""Runs the notebooks and keeps what they show in them, with the commit that showed it.

python docs/run_notebooks.py
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import nbformat
from nbclient import NotebookClient

from vsf_drake.base.files import write_text

DOCS = Path(__file__).resolve().parent
LONGEST_S = 600


def run(path: Path, commit: str) -> None:
    """Runs one in its folder and writes it again, without what it said on the way."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=LONGEST_S, coalesce_streams=True).execute(cwd=path.parent)
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = [each for each in cell.outputs if each.get("name") != "stderr"]
    notebook.metadata["shown_by_commit"] = commit
    write_text(path, nbformat.writes(notebook, indent=1) + "\n")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    head = subprocess.run(
        ["git", "rev-parse", "--short=8", "HEAD"],
        cwd=DOCS,
        capture_output=True,
        text=True,
        check=True,
    )
    for path in sorted((DOCS / "notebooks").glob("*.ipynb")):
        run(path, head.stdout.strip())
        print(path)
