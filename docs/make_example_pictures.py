"""Runs the examples in studies/examples and keeps their pictures in docs/pictures, in 256 colours.

python docs/make_example_pictures.py              all of them, some minutes
python docs/make_example_pictures.py leg_drop     one
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
from pathlib import Path

from PIL import Image

from vsf_drake.base.files import replaced

DOCS = Path(__file__).resolve().parent
EXAMPLES = (
    "biped",
    "leg_drop",
    "robot_arm_emulator",
    "standing_lqr",
    "friction_monte_carlo",
    "walking_over_grounds",
    "fulcrum_in_swing",
    "contact_alternatives",
    "stepped_leg",
    "planned_stance",
    "fulcrum_by_gradient",
)


def main(names: list[str]) -> None:
    """Makes the pictures of the examples `names`."""
    sys.path.insert(0, str(DOCS.parent / "studies" / "examples"))
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            importlib.import_module(name).main(Path(folder), False)
            keep(Path(folder) / f"{name}.png", DOCS / "pictures" / f"example_{name}.png")


def keep(source: Path, target: Path) -> None:
    """Writes the picture `source` as `target`, with a palette of 256 colours."""
    with Image.open(source) as picture, replaced(target, "wb") as stream:
        picture.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(
            stream, format="PNG", optimize=True
        )
    print(target)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", default=EXAMPLES, metavar="EXAMPLE", help=", ".join(EXAMPLES)
    )
    main(list(parser.parse_args().names))
