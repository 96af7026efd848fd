"""Makes an example of each page, of SYNTHETIC recordings by quick forms, for the site: the folders
of docs/_static/examples, which git does not keep.

python docs/make_example_pages.py
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from vsf_drake.base.files import resource

EXAMPLES = Path(__file__).resolve().parent / "_static" / "examples"
COMMANDS = {
    "validate": "--quick",
    "session": "monday --prosthetic-side right --sex male --synthetic",
    "fit": (
        "laboratory/low_1.yaml laboratory/high_1.yaml --hold-out laboratory/medium_1.yaml "
        "--bench bench.yaml --quick"
    ),
    "tune": (
        "laboratory/low_1.yaml laboratory/high_1.yaml --contact laboratory/contact.yaml "
        "--cost joint_load --quick"
    ),
    "map": "--mass 80 --slope 0",
}
"""By the command whose page it is, its arguments but `--out`."""
WALKS = {"low_1": "66mm_1", "medium_1": "108mm_1", "high_1": "151mm_1", "static": "static"}
"""Names by which a session is told the settings."""
PROGRAM = "from vsf_drake.cli import main; main()"


def main() -> None:
    """Makes all of them anew."""
    with tempfile.TemporaryDirectory() as folder:
        lab = shutil.copytree(resource("data/reference_subject"), Path(folder) / "lab")
        (lab / "monday").mkdir()
        for name, new in WALKS.items():
            shutil.copy(lab / "c3d" / f"{name}.c3d", lab / "monday" / f"{new}.c3d")
        for name, words in COMMANDS.items():
            command = [sys.executable, "-c", PROGRAM, name, *words.split(), "--out", f"{name}_page"]
            subprocess.run(command, cwd=lab, check=True)
            keep(lab / f"{name}_page", EXAMPLES / name)


def keep(made: Path, target: Path) -> None:
    """Puts the pages of a folder of results in the place of `target`: they lead to each other, and
    hold all else.
    """
    shutil.rmtree(target, ignore_errors=True)
    for page in made.rglob("*.html"):
        place = target / page.relative_to(made)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(page, place)
    print(target)


if __name__ == "__main__":
    main()
