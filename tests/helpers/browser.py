"""Opens a page in headless Chromium and tells what a person would meet: messages, requests,
overflow, broken images."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

_MEASURE = r"""
<script>addEventListener("load", () => setTimeout(() => {
  const page = document.documentElement, limit = page.clientWidth + 1;
  const scrolls = e => { for (let p = e; p; p = p.parentElement) if (p.classList.contains("wide")) return true; };
  const out = [...document.body.querySelectorAll("*")].filter(
    e => e.getBoundingClientRect().right > limit && !scrolls(e)).map(e => e.tagName + " " + e.textContent.slice(0, 40));
  const images = [...document.images], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const acted = (() => {ACT})();
  let words = 0;
  while (texts.nextNode())
    if (texts.currentNode.parentElement.checkVisibility())
      words += texts.currentNode.data.split(/\s+/).filter(Boolean).length;
  parent.postMessage({width: page.clientWidth, scroll: page.scrollWidth, out: out.slice(0, 5), images: images.length,
    broken: images.filter(i => !i.naturalWidth).length,
    unnamed: images.filter(i => i.alt.trim().length < 20).length, words, high: page.scrollHeight, acted,
    tables: [...document.querySelectorAll("table")].filter(e => e.checkVisibility()).length}, "*");
}, 300));</script>
"""  # noqa: E501
_FRAME = """<!doctype html><meta charset="utf-8"><style>body{{margin:0}}iframe{{border:0}}</style>
<pre id="seen"></pre><script>addEventListener("message", e => {{
document.getElementById("seen").textContent = JSON.stringify(e.data);}});</script>
<iframe src="page.html" width="{width}" height="{height}"></iframe>"""

COMMAND = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--disable-default-apps",
    "--disable-extensions",
    "--hide-scrollbars",
)
"""How the browser is started, whatever it is to show."""


@dataclass(frozen=True)
class Seen:
    """What the browser saw of a page `width` pixels wide.

    Attributes:
        width, scroll: of the page and of its content. out: elements beyond the right edge, outside
            of what scrolls.
        images, broken, unnamed: how many, how many do not show, how many have no alternative text
            worth the name.
        words, tables: that are not folded away. high: the page's height (px). acted: what the
            script returned.
        console: messages. requests: addresses that are no files and no data.
    """

    width: int
    scroll: int
    out: list[str]
    images: int
    broken: int
    unnamed: int
    words: int
    tables: int
    high: int
    acted: object
    console: list[str]
    requests: list[str]


def chromium() -> str | None:
    """The browser's command; None where there is none."""
    return next(
        (
            found
            for name in ("chromium", "chromium-browser", "google-chrome")
            if (found := shutil.which(name))
        ),
        None,
    )


def look(
    page: Path,
    folder: Path,
    *,
    width: int,
    height: int = 900,
    budget_ms: int = 8000,
    act: str = "return null;",
) -> Seen:
    """Opens `page` in a frame `width` pixels wide for `budget_ms` of its time and does there what
    the script `act` does before words and tables are counted; `folder` is an empty one to work
    in."""
    text = page.read_text(encoding="utf-8")
    measure = _MEASURE.replace("ACT", act)
    (folder / "page.html").write_text(
        text.replace("</body>", measure + "</body>"), encoding="utf-8"
    )
    (folder / "frame.html").write_text(_FRAME.format(width=width, height=height), encoding="utf-8")
    log = folder / "net.json"
    command = [
        chromium(),
        *COMMAND,
        "--enable-logging=stderr",
        f"--user-data-dir={folder / 'profile'}",
        f"--log-net-log={log}",
        f"--virtual-time-budget={budget_ms}",
        f"--window-size={max(width, 500)},{height + 40}",
        f"file://{folder / 'frame.html'}",
    ]
    ended = subprocess.run(
        [*command, "--dump-dom"], capture_output=True, text=True, timeout=120, check=True
    )
    seen = json.loads(
        html.unescape(re.search(r'<pre id="seen">(.*?)</pre>', ended.stdout, re.DOTALL)[1])
    )
    console = [line for line in ended.stderr.splitlines() if "CONSOLE" in line]
    return Seen(**seen, console=console, requests=_requests(log))


def _requests(log: Path) -> list[str]:
    """Addresses that the page asked for, beside files, data and what the browser asks for
    itself."""
    text = log.read_text(encoding="utf-8", errors="replace")
    addresses = set(re.findall(r'"url":"((?:https?|wss?|ftp):[^"]*)"', text))
    own = re.compile(r"https?://[^/]*(google|gstatic|googleapis|chromium)[^/]*/")
    return sorted(url for url in addresses if not own.match(url))
