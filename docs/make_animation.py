"""Makes the animation of a walk that the README shows, from the replay page of a walk, in a
headless Chromium.

vsf-drake simulate data/reference_subject/laboratory/medium_1.yaml --out walk
python docs/make_animation.py walk/replay.html
"""

from __future__ import annotations

import argparse
import base64
import io
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

from vsf_drake.base.files import replaced

DOCS = Path(__file__).resolve().parent
# of the page's time bar: one stance of the prosthetic foot and what is around it
FRAMES, FROM, TO = 40, 0.18, 0.74
WIDTH, HEIGHT, DURATION_MS = 760, 640, 80
SEEN = """
  const bar = document.getElementById("time"), frames = [];
  viewer.animate();
  for (let i = 0; i < COUNT; i++) {
    bar.value = (FROM + (TO - FROM) * i / (COUNT - 1)) * bar.max;
    bar.dispatchEvent(new Event("input"));
    viewer.render();
    frames.push(viewer.renderer.domElement.toDataURL("image/png"));
  }
  return frames;
"""


def main(page: Path) -> None:
    """Writes docs/pictures/walk.webp from the replay `page`."""
    sys.path.insert(0, str(DOCS.parent / "tests" / "helpers"))
    from browser import look  # noqa: PLC0415

    act = SEEN.replace("COUNT", str(FRAMES)).replace("FROM", str(FROM)).replace("TO", str(TO))
    with tempfile.TemporaryDirectory() as folder:
        seen = look(page, Path(folder), width=WIDTH, height=HEIGHT, budget_ms=30_000, act=act).acted
    pictures = [
        Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB")
        for url in seen
    ]
    for picture in pictures:
        ImageDraw.Draw(picture).text(
            (8, 6), "SYNTHETIC walk, not recorded", fill="#222222", font_size=16
        )
    with replaced(DOCS / "pictures" / "walk.webp", "wb") as stream:
        pictures[0].save(
            stream,
            format="WEBP",
            save_all=True,
            append_images=pictures[1:],
            duration=DURATION_MS,
            loop=0,
            quality=60,
            method=6,
        )
    print(DOCS / "pictures" / "walk.webp")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("page", type=Path, help="a replay.html")
    main(parser.parse_args().page)
