"""Makes the pictures in docs/pictures (SVG) and the table of coordinates in docs/frames.md again
from the model.

python docs/make_pictures.py                  those of the documentation
python docs/make_pictures.py --out FOLDER     pictures alone, as PNG and SVG, into an existing
                                              folder
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vsf_drake.base.files import replaced

DOCS = Path(__file__).resolve().parent


def main(out: Path | None = None) -> None:
    """Writes the pictures to `out`, or those of the documentation and its table."""
    sys.path.insert(0, str(DOCS / "_ext"))
    from frames.pictures import with_table, write_pictures  # noqa: PLC0415

    for path in write_pictures(out or DOCS / "pictures"):
        if out is None and path.suffix == ".png":
            path.unlink()  # the page shows the SVG
        else:
            print(path)
    if out is None:
        page = DOCS / "frames.md"
        text = with_table(page.read_text(encoding="utf-8"))
        with replaced(page) as stream:
            stream.write(text)
        print(page)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path)
    main(parser.parse_args().out)
