"""Results in other tools: a pandas.DataFrame, an xarray.Dataset, a cell of a notebook, all out of
one definition.

A result says once, in `labelled`, what its arrays are. pandas, xarray and pyarrow are the extra
`tables` and are imported when they are asked for.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import jinja2
import numpy as np

from vsf_drake.base.errors import InputError

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Quantity:
    """One array of a result."""

    name: str
    values: np.ndarray  # as many dimensions as `dims`
    dims: tuple[str, ...]
    unit: str | tuple[str, ...] = ""
    """of all, or of each entry of the last dimension; empty for text"""
    meaning: str = ""
    frame: str = ""  # in which components stand

    def unit_at(self, place: Sequence[int]) -> str:
        """Unit of the entry at a place in all dimensions but the first."""
        return self.unit if isinstance(self.unit, str) else self.unit[place[-1]]


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledArrays:
    """Arrays with what is needed to read them elsewhere."""

    labels: Mapping[str, Quantity | Sequence[str | int]]
    """dimension -> its coordinates; the first is that of the rows"""
    quantities: Sequence[Quantity]
    about: Mapping[str, str | float | bool] = field(default_factory=dict)
    """of all: who, which side, SYNTHETIC"""
    setting: Mapping[str, tuple[str | float, str]] = field(default_factory=dict)
    """value and unit of what sets these arrays apart from others like them: trial, fulcrum, what
    was varied"""

    def to_dataframe(self) -> pandas.DataFrame:
        """One row for each entry of the first dimension: the setting, the coordinate of that
        dimension (time), and columns NAME or NAME_LABEL (grf_W_z), so that tables of several
        results stack; `attrs` holds `units` and `meanings` by column. InputError if the extra
        `tables` is not installed."""
        first = next(iter(self.labels))
        rows = self.labels[first]
        columns: dict[str, Any] = {name: value for name, (value, _) in self.setting.items()}
        units = {name: unit for name, (_, unit) in self.setting.items()}
        meanings = dict.fromkeys(units, "setting")
        leading = [rows] if isinstance(rows, Quantity) else []
        for item in (*leading, *self.quantities):
            labels = [self._label_values(dim) for dim in item.dims[1:]]
            for place in itertools.product(*(range(len(each)) for each in labels)):
                name = "_".join(
                    [item.name, *(str(each[i]) for each, i in zip(labels, place, strict=True))]
                )
                at: Any = (slice(None), *place)
                columns[name] = item.values[at]
                units[name], meanings[name] = item.unit_at(place), item.meaning
        frame: pandas.DataFrame = tables_module("pandas").DataFrame(
            columns, index=range(len(self._label_values(first)))
        )
        frame.attrs = {**self.about, "units": units, "meanings": meanings}
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """Arrays by name, with `units` (one for each entry of the last dimension, with commas,
        where these differ), `long_name` and `frame` as attributes; the setting as coordinates of no
        dimension. InputError if the extra `tables` is not installed."""
        made_by = tables_module("xarray")
        coordinates: dict[str, Any] = {
            dim: (dim, self._label_values(dim), _attributes(of) if isinstance(of, Quantity) else {})
            for dim, of in self.labels.items()
        }
        coordinates |= {
            name: ((), value, {"units": unit} if unit else {})
            for name, (value, unit) in self.setting.items()
        }
        dataset: xarray.Dataset = made_by.Dataset(
            {item.name: (item.dims, item.values, _attributes(item)) for item in self.quantities},
            coordinates,
            # netCDF's
            {
                name: int(value) if isinstance(value, bool) else value
                for name, value in self.about.items()
            },
        )
        return dataset

    def _label_values(self, dim: str) -> np.ndarray:
        of = self.labels[dim]
        return of.values if isinstance(of, Quantity) else np.asarray(of)


@dataclass(frozen=True, kw_only=True)
class Headline:
    """What a notebook shows of a result."""

    kind: str
    name: str
    synthetic: bool
    facts: Sequence[tuple[str, float | str, str]]  # label, value, unit
    failure: str = ""  # why the result cannot be used
    unconverged_steps: int = 0


class Tabular(ABC):
    """A result that other tools can take."""

    @abstractmethod
    def labelled(self) -> LabelledArrays:
        """Its arrays. FitError for a search that failed."""

    @abstractmethod
    def headline(self) -> Headline:
        """Its few top numbers."""

    def to_dataframe(self) -> pandas.DataFrame:
        """As `LabelledArrays.to_dataframe`: columns with units in `attrs`."""
        return self.labelled().to_dataframe()

    def to_xarray(self) -> xarray.Dataset:
        """As `LabelledArrays.to_xarray`: arrays with named dimensions, units in their `attrs`."""
        return self.labelled().to_xarray()

    def __str__(self) -> str:
        return _page("txt").render(vars(self.headline()))

    def _repr_html_(self) -> str:
        return _page("html").render(vars(self.headline()))


def record_arrays(
    rows: Sequence[Mapping[str, Any]],
    columns: Mapping[str, Mapping[str, Any]],
    about: Mapping[str, str | float | bool],
) -> LabelledArrays:
    """Records as arrays over `row`: a column with a `unit` is numbers, NaN for None; one without is
    text."""
    quantities = [
        Quantity(
            name=name,
            dims=("row",),
            unit=about_column.get("unit", ""),
            meaning=about_column.get("meaning", ""),
            values=np.array(
                [row[name] for row in rows], dtype=float if "unit" in about_column else object
            ),
        )
        for name, about_column in columns.items()
    ]
    return LabelledArrays(labels={"row": range(len(rows))}, quantities=quantities, about=about)


def tables_module(name: str) -> Any:
    """pandas, xarray or pyarrow; InputError that names the extra if it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            "is not installed", where=name, right="Install it: pip install 'vsf-drake[tables]'"
        ) from None


def _attributes(item: Quantity) -> dict[str, str]:
    units = item.unit if isinstance(item.unit, str) else ", ".join(item.unit)
    return {
        key: value
        for key, value in (("units", units), ("long_name", item.meaning), ("frame", item.frame))
        if value
    }


@cache
def _page(kind: str) -> jinja2.Template:
    pages = jinja2.Environment(
        loader=jinja2.PackageLoader("vsf_drake", "wording"),
        autoescape=kind == "html",
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    pages.filters["number"] = lambda value: (
        value if isinstance(value, str) else format(value, ".4g")
    )
    return pages.get_template(f"result.{kind}.j2")
