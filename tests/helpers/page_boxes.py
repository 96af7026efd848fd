"""What lies over what on a page, by the boxes that a browser gives, at the top and wherever
somebody scrolls to."""

from __future__ import annotations

import html
import json
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path

from browser import COMMAND, chromium

SIZES = ((1300, 900), (1024, 768), (390, 844))
"""Pixels across and down: a desk, a small screen, a telephone."""
_MEASURE = r"""
<script>addEventListener("load", () => setTimeout(() => {
  const parts = [...document.body.querySelectorAll(
    "h1,h2,h3,p,li,summary,figcaption,nav,img,svg,svg text,iframe,canvas,.wide,input,select,button")];
  const called = e => `${e.tagName.toLowerCase()}${e.id && "#" + e.id} ${e.textContent.trim().slice(0, 30)}`;
  const over = new Set();
  const measure = () => {
    const inside = parts.filter(e => e.checkVisibility()).map(e => [e, e.getBoundingClientRect()]).filter(
      ([, a]) => a.width > 0 && a.height > 0 && a.bottom > 0 && a.top < innerHeight);
    inside.forEach(([e, a], i) => inside.slice(i + 1).forEach(([f, b]) => {
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (wide > 1 && high > 1 && !e.contains(f) && !f.contains(e)) over.add(`${called(e)} | ${called(f)}`);
    }));
  };
  let places = 0;
  for (const opened of [false, true]) {
    document.querySelectorAll("details").forEach(fold => { fold.open = opened || fold.open; });
    for (let top = 0; top < document.documentElement.scrollHeight; top += innerHeight / 2) {
      scrollTo(0, top);
      measure();
      places += 1;
    }
  }
  parent.postMessage({of: location.pathname.split("/").at(-1), size: `${innerWidth} x ${innerHeight}`, places,
                      over: [...over]}, "*");
}, 300));</script>
"""  # noqa: E501
_FRAMES = """<!doctype html><meta charset="utf-8"><pre id="seen"></pre><script>
const seen = [];
addEventListener("message", e => {{ if (e.data.over) seen.push(e.data);
                                    document.getElementById("seen").textContent = JSON.stringify(seen); }});
</script>{frames}"""  # noqa: E501


def lying_over(pages: Mapping[str, str], folder: Path) -> dict[tuple[str, str], list[str]]:
    """By page and size, pairs of what lies over each other without one being part of the other.

    Every page (HTML by name) is opened at each of `SIZES`, as it comes and with its folds open, and
    scrolled through in steps of half a screen; `folder` is an empty one to work in.
    """
    for name, page in pages.items():
        # Markup would escape what is put in
        measured = str(page).replace("</body>", _MEASURE + "</body>")
        (folder / f"{name}.html").write_text(measured, encoding="utf-8")
    frames = "".join(
        f'<iframe src="{name}.html" width="{width}" height="{height}" style="border:0"></iframe>'
        for name in pages
        for width, height in SIZES
    )
    (folder / "frames.html").write_text(_FRAMES.format(frames=frames), encoding="utf-8")
    command = [
        chromium(),
        *COMMAND,
        f"--user-data-dir={folder / 'profile'}",
        "--virtual-time-budget=8000",
        "--dump-dom",
        f"file://{folder / 'frames.html'}",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    seen = json.loads(
        html.unescape(re.search(r'<pre id="seen">(.*?)</pre>', ended.stdout, re.DOTALL)[1])
    )
    assert len(seen) == len(pages) * len(SIZES) and all(of["places"] > 1 for of in seen), (
        "each was looked at"
    )
    return {(of["of"].removesuffix(".html"), of["size"]): of["over"] for of in seen}
