"""Runs a tutorial: its blocks in order, in one process and one folder, and compares what they print
with the text.

    ```python   is executed, all of them in one namespace
    ```bash     lines of `vsf-drake ...`, executed as the command would be
    ```text     what the block before it printed: words as they stand, numbers to their last written
                digit (one off is equal), `...` for anything
    ```shell    and all others are only shown

Pictures that a page shows lie in `pictures/` beside it under the names, and in the folders, that
its code gives them; `python docs/_ext/tutorial.py PAGE...` runs pages and puts the pictures there.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from vsf_drake.cli import main as command_line

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_PICTURE = re.compile(r"!\[[^\]]*\]\(pictures/([^)]+)\)")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its text, and the line of the page that it begins on."""

    language: str
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    """All fenced blocks with a language, in order."""
    source = page.read_text(encoding="utf-8")
    return [
        Block(found[1], found[2], source.count("\n", 0, found.start()) + 2)
        for found in _BLOCK.finditer(source)
    ]


def pictures(page: Path) -> list[str]:
    """Names of the pictures that the page shows."""
    return _PICTURE.findall(page.read_text(encoding="utf-8"))


def run(page: Path, folder: Path) -> list[str]:
    """Runs `page` in `folder`; what was printed otherwise than the page says, a sentence each.

    Raises:
        AssertionError: a command does not end with 0.
        Exception: whatever a block raises, with the page's line numbers.
    """
    namespace: dict[str, object] = {"__name__": "__main__"}
    printed, wrong = "", []
    with contextlib.chdir(folder):
        for block in blocks(page):
            if block.language == "text":
                if not same(printed, block.text):
                    wrong.append(
                        f"{page.name}:{block.line}: the page says\n{block.text}\nbut printed "
                        f"was\n{printed}"
                    )
                continue
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                if block.language == "python":
                    code = "\n" * (block.line - 1) + block.text  # tracebacks name the page's lines
                    exec(compile(code, str(page), "exec"), namespace)
                elif block.language == "bash":
                    for words in commands(block.text):
                        command(words)
            printed = output.getvalue() if block.language in ("python", "bash") else printed
    return wrong


def commands(text: str) -> list[list[str]]:
    """The words behind `vsf-drake` of each command; a backslash at the end of a line continues
    it."""
    lines = [line for line in text.replace("\\\n", " ").splitlines() if line.strip()]
    found = [shlex.split(line, comments=True) for line in lines]
    assert all(words[0] == "vsf-drake" for words in found), text
    return [words[1:] for words in found]


def command(words: list[str]) -> None:
    """Runs `vsf-drake` with these words.

    Raises:
        AssertionError: it does not end with 0.
    """
    with mock.patch.object(sys, "argv", ["vsf-drake", *words]):
        try:
            command_line()
        except SystemExit as end:
            assert not end.code, f"vsf-drake {' '.join(words)} ended with {end.code}"


def same(printed: str, expected: str) -> bool:
    """Whether `printed` is what a ```text block says."""
    words = r"\s+".join(map(_pattern, expected.split()))
    found = re.fullmatch(rf"\s*{words}\s*", printed, re.DOTALL)
    return bool(found) and all(
        abs(float(text) - float(value)) <= 1.0001 * _last_digit(value)
        for text, value in zip(
            found.groups(), _NUMBER.findall(expected.replace("...", " ")), strict=True
        )
    )


def _pattern(word: str) -> str:
    """A regular expression for one word, with a group for each number."""

    def literal(text: str) -> str:
        return ".*?".join(map(re.escape, text.split("...")))

    pieces, end = [], 0
    for number in _NUMBER.finditer(word):
        pieces += [literal(word[end : number.start()]), r"(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)"]
        end = number.end()
    return "".join([*pieces, literal(word[end:])])


def _last_digit(number: str) -> float:
    """The value of one unit in the last digit that is written."""
    digits, _, power = number.partition("e")
    return 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


def keep_pictures(page: Path, folder: Path) -> None:
    """Copies the pictures that `page` shows from the `folder` it has run in to where it shows
    them."""
    for name in pictures(page):
        kept = page.parent / "pictures" / name
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / name, kept)


def main(pages: list[str]) -> int:
    """Runs the pages, keeps their pictures, and prints what disagrees."""
    os.environ.setdefault("MPLBACKEND", "agg")
    wrong = []
    for page in map(Path, pages):
        with tempfile.TemporaryDirectory() as folder:
            wrong += run(page.resolve(), Path(folder))
            keep_pictures(page.resolve(), Path(folder))
    print("\n\n".join(wrong) or "as the pages say")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
