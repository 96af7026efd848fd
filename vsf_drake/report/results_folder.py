"""One writer and one reader for every folder of results: who may write them where, what is written,
what comes back."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import UndefinedError

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import (
    plain,
    read_json,
    read_npz,
    sha256,
    write_json,
    write_npz,
    write_text,
)
from vsf_drake.report.page import FIGURES, TABLES, chapter_page
from vsf_drake.simulation.archive import SIDECAR_FILE, check_target, result_folder

PAGE = "report.html"
APPENDIX = "appendix.html"
CHAPTERS = tuple(
    f"{folder}/*{kind}"
    for folder, kinds in ((FIGURES, (".png", ".svg")), (TABLES, (".csv",)))
    for kind in kinds
)
"""Patterns of the names of all figures and tables of chapters."""


@dataclass(frozen=True, kw_only=True)
class ResultsFolder:
    """The results of one command on disk.

    `show` is of a page of chapters: what `page.chapter_page` is to be given, of table and arrays;
    `folder` is where other files stand.
    """

    kind: str  # by which the folder's record and messages have them
    command: str  # that writes them
    table: str = ""  # the JSON file that says what they are
    known: Callable[[Mapping[str, Any]], bool] = lambda table: True
    """whether a table is one of these"""
    damaged_too: bool = True  # whether a table that cannot be read counts as one of these
    arrays: str = ""
    """an NPZ file whose SHA-256 the table has; in it "__" stands for the "/" of an array's name"""
    names: tuple[str, ...] = ()  # of what else is written, where it is known beforehand
    stale: tuple[str, ...] = ()  # patterns of what goes from a folder without a record
    sidecar: str = SIDECAR_FILE  # a YAML file that says the kind, instead of a table
    unfinished: Callable[[Path], bool] = lambda out: False
    """whether a folder without a table is of an interrupted run"""
    # raises ValueError for a table that cannot be used, InputError for one in the file that it is
    # given
    valid: Callable[[Mapping[str, Any], Path], object] = lambda table, path: None
    show: Callable[..., Mapping[str, Any]] | None = None
    layered: bool = False  # whether the page tells its story, and its chapters stand in an appendix

    @property
    def layers(self) -> tuple[str, ...]:
        """Files of the page, the first being what is opened."""
        return (PAGE, APPENDIX) if self.layered else (PAGE,)

    def check(self, out: str | Path) -> Path:
        """`out`, if such results can go there: a new or empty folder, or that of earlier ones,
        finished or not."""
        out = Path(out)
        names = [
            *filter(None, (self.table, self.arrays)),
            *self.names,
            *((*self.layers, f"{FIGURES}/*", f"{TABLES}/*") if self.show else ()),
        ]
        check_target(
            out,
            self.kind,
            lambda out: self._holds(out) or self.unfinished(out),
            names=names,
            sidecar=self.sidecar,
        )
        if out.is_dir() and not os.access(out, os.W_OK | os.X_OK):
            raise InputError(
                f"cannot be written ({os.strerror(errno.EACCES)})",
                file=out,
                right="Choose another folder",
            )
        return out

    def write(
        self,
        out: str | Path,
        table: Mapping[str, Any],
        arrays: Mapping[str, np.ndarray] | None = None,
        *,
        more: Callable[[Path, dict[str, Any]], object] = lambda folder, table: None,
    ) -> dict[str, Any]:
        """Writes everything to `out`, all of it or nothing; what an earlier run left there goes.

        `more` writes what is not table, arrays or chapters into the folder that it is given, and
        may add to the table. Returns what the JSON file holds. ValueError for a table that cannot
        be used.
        """
        self.valid(table, Path(out) / self.table)
        written: dict[str, Any] = plain(dict(table))
        stale = (*self.stale, *(CHAPTERS if self.show else ()))
        with result_folder(out, self.kind, stale=stale) as folder:
            if self.arrays:
                if arrays is not None:
                    write_npz(
                        folder / self.arrays,
                        {name.replace("/", "__", 1): a for name, a in arrays.items()},
                    )
                written["arrays_sha256"] = None if arrays is None else sha256(folder / self.arrays)
            more(folder, written)
            if self.show:
                self._write_page(folder, folder, written, arrays or {}, lenient=False)
            write_json(folder / self.table, written, sort=not self.show)
        return written

    def write_unfinished(
        self,
        out: str | Path,
        table: Mapping[str, Any],
        arrays: Mapping[str, np.ndarray],
        *,
        more: Callable[[Path, dict[str, Any]], object],
    ) -> Path:
        """Writes the page of what there is so far, which says so; its table, by which it could be
        read as results, is not there. `more` as for `write`. What an earlier run left goes. Returns
        the page's path."""
        shown = dict(table)
        with result_folder(
            out, self.kind, stale=(*self.stale, *CHAPTERS, self.table, self.arrays)
        ) as folder:
            more(folder, shown)
            self._write_page(folder, folder, shown, arrays, lenient=False)
        return Path(out) / PAGE

    def read(self, folder: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Table and arrays that `write` left; they must belong together."""
        path = Path(folder) / self.table
        right = f"Name the folder that `vsf-drake {self.command} --out` wrote"
        again = f"Run `vsf-drake {self.command}` again"
        if not path.exists() and self.unfinished(Path(folder)):
            raise InputError(
                "holds an unfinished run", file=folder, right=f"{again}: it goes on from there"
            )
        table = read_json(path, right=right, damaged=again)
        if not self.known(table):
            raise InputError(f"is not the table of a {self.kind}", file=path, right=right)
        try:
            self.valid(table, path)
        except ValueError as error:
            raise InputError(f"cannot be used: {error}", file=path, right=again) from None
        if not self.arrays or ("arrays_sha256" in table and table["arrays_sha256"] is None):
            return table, {}
        arrays = Path(folder) / self.arrays
        if sha256(arrays) != table.get("arrays_sha256"):
            raise InputError(
                f"is not the file that {self.table} describes (its SHA-256 differs)",
                file=arrays,
                right=again,
            )
        return table, {
            name.replace("__", "/", 1): a for name, a in read_npz(arrays, right=again).items()
        }

    def remake(self, folder: str | Path, *, svg: bool = False) -> list[str]:
        """Makes page, tables and figures (`svg`: as SVG too) again of what is saved; returns what
        could not be shown, in sentences."""
        out = Path(folder)
        table, arrays = self.read(out)
        with result_folder(out, self.kind, add=True) as temporary:
            try:
                files, missing = self._write_page(
                    temporary, out, table, arrays, lenient=True, svg=svg
                )
            except (LookupError, TypeError, ValueError, AttributeError, UndefinedError) as error:
                raise InputError(
                    f"is damaged ({type(error).__name__}: {error})",
                    file=out / self.table,
                    right=f"Run `vsf-drake {self.command}` again",
                ) from None
        try:
            for path in (path for pattern in CHAPTERS for path in out.glob(pattern)):
                if path.relative_to(out) not in files:
                    path.unlink()
        except OSError as error:
            raise InputError(f"cannot be written ({error.strerror})", file=out) from None
        return missing

    def _holds(self, out: Path) -> bool:
        """Whether such a table stands in `out`."""
        path = out / self.table
        if not self.table or not path.is_file():
            return False
        try:
            return self.known(read_json(path))
        except InputError:
            return self.damaged_too

    def _write_page(
        self,
        folder: Path,
        out: Path,
        table: Mapping[str, Any],
        arrays: Mapping[str, np.ndarray],
        *,
        lenient: bool,
        svg: bool = False,
    ) -> tuple[set[Path], list[str]]:
        """Page, figures and tables into `folder`; paths of these in it, and what is missing in
        sentences."""
        assert self.show is not None
        pages, shown = chapter_page(
            **self.show(table, arrays, folder=out, lenient=lenient),
            folder=folder,
            lenient=lenient,
            svg=svg,
            layers=self.layers,
        )
        for file, page in zip(self.layers, pages, strict=True):
            write_text(folder / file, page)
        return (
            set().union(*(chapter.files for chapter in shown)),
            [
                f"{chapter.title}: {sentence}" if chapter.title else sentence
                for chapter in shown
                for sentence in chapter.missing
            ],
        )
