"""YAML <-> frozen dataclasses, with units, sources, ranges and messages that name file, line and
key.

A schema is a dataclass whose fields are made by `quantity` (numbers with unit and source) or
`choice` (words from a list). It has no behaviour. `load_yaml` reads a file into it, `check`
verifies an instance that was made in Python, `dump_yaml` writes it back; `to_plain` and
`from_plain` do so with nested dicts, as saved results hold them.

Drake's yaml_load_typed and yaml_dump_typed do not take such classes: they want annotations that are
no strings, no tuples, a default for every field and nothing frozen, and know no ranges. The call
that does is `load_yaml(path, schema)`, for a scenario `load_scenario(path)`, or `from_plain(schema,
yaml_load_file(path))` where Drake has read the file. What `dump_yaml` writes, Drake's
yaml_load_data and yaml_load_file read.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import types
import typing
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import yaml

from vsf_drake.base.errors import UNPRINTABLE, InputError, require
from vsf_drake.base.yaml_file import dump, number, read_yaml, scalar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

_OTHER_UNITS = {
    "mm": {"metres": 1e3, "centimetres": 10.0, "inches": 25.4, "micrometres": 1e-3},
    "m": {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254},
    "deg": {"radians": 180.0 / math.pi},
    "rad": {"degrees": math.pi / 180.0},
    "kg": {"pounds": 0.45359237, "grams": 1e-3},
    "g": {"kilograms": 1e3, "pounds": 453.59237},
    "s": {"milliseconds": 1e-3},
    "N": {"kilonewtons": 1e3, "kilograms-force": 9.80665, "pounds-force": 4.4482216},
    "N/m": {"N/mm": 1e3},
    "N/mm": {"N/m": 1e-3},
}
"""What else people give where a unit is asked for, and how much of that unit it is."""


SELDOM = "Seldom needed"
"""Heading of --help for options that the usual case does without."""
SEED = "Seed of everything random."  # the help of every option for one
_SHOWN = 40  # letters of a wrong value in messages
_KINDS = {float: "number", int: "whole number", bool: "true or false", str: "text"}
_RIGHT = {
    float: "Write it in decimals, such as 70, 0.5 or 1e5",
    int: "Write it in decimals, such as 70",
    bool: "Write true or false",
}


def quantity(
    default: Any = dataclasses.MISSING,
    *,
    unit: str,
    source: str,
    low: float = -math.inf,
    high: float = math.inf,
    count: int | None = None,
    **told: str,
) -> Any:
    """A field that holds a number (or a tuple of numbers, `count` if that is given) with its unit,
    source and closed range; `told` as of `option`."""
    known = {"unit": unit, "source": source, "low": low, "high": high, "count": count}
    return dataclasses.field(default=default, metadata={**known, **told})


UNSAID = "unsaid"
"""In the metadata of a field: its default is not written, as in files of before there was one."""


def choice(
    default: Any = dataclasses.MISSING, *, options: tuple[str, ...], source: str, **told: str
) -> Any:
    """A field that holds one word out of `options`; `told` as of `option`."""
    return dataclasses.field(
        default=default, metadata={"options": options, "source": source, **told}
    )


def option(default: Any, help: str, **told: str) -> Any:
    """A field that is an option of a command, and no number with a unit and no word of a list.

    A field of any kind is an option where it has a `help`. What else may be told of it: `flag`, the
    option's name where it is not the field's; `metavar`, what its value looks like, with a comma
    where several stand in one text; `shown`, the words of --help for a default that is None;
    `panel`, the heading below the other options under which it stands there.
    """
    return dataclasses.field(default=default, metadata={"help": help, **told})


def same_as(schema: type, name: str, **told: str) -> Any:
    """A field like that of another schema, its default too, to which `told` is added."""
    [own] = [field for field in dataclasses.fields(schema) if field.name == name]
    return dataclasses.field(default=own.default, metadata={**own.metadata, **told})


def load_yaml(path: str | Path, schema: type[T], *, right: str | None = None) -> T:
    """Reads `path` into `schema`; `right` is what to do if there is no such file.

    InputError, with file, line and key: a key is unknown, doubled or missing; a value has the wrong
    type or range.
    """
    node = read_yaml(path, right=right)
    if node is None:
        raise InputError("is empty", file=path, right=f"Its keys are: {_names(schema)}")
    return _Reader(path).dataclass(node, schema, "")


def load_plain(path: str | Path, *, right: str | None = None) -> Any:
    """What a YAML file holds, as nested dicts, lists and scalars; `right` is what to do if there is
    no such file."""
    node = read_yaml(path, right=right)
    return None if node is None else _Reader(path).value(node, Any, "")


def dump_yaml(instance: Any) -> str:
    """`instance` as YAML text that `load_yaml` reads back to an equal object."""
    return dump(to_plain(instance))


def to_plain(instance: Any) -> Any:
    """`instance` as nested dicts, lists and scalars; fields that are None are left out, and those
    that are `UNSAID` at their default."""
    if dataclasses.is_dataclass(instance) and not isinstance(instance, type):
        pairs = ((f, getattr(instance, f.name)) for f in dataclasses.fields(instance))
        return {
            f.name: to_plain(value)
            for f, value in pairs
            if value is not None and not (f.metadata.get(UNSAID) and value == f.default)
        }
    if isinstance(instance, (list, tuple)):
        return [to_plain(value) for value in instance]
    if isinstance(instance, dict):
        return {str(key): to_plain(value) for key, value in instance.items()}
    if isinstance(instance, Path):
        return str(instance)
    return instance.item() if hasattr(instance, "item") else instance


def from_plain(
    schema: type[T], values: Any, *, where: str = "", file: str | Path | None = None
) -> T:
    """The `schema` that `to_plain` turned into `values`, read as strictly as a file.

    `where` and `file` are what messages call `values`, and what they come from.
    """
    try:
        node = yaml.representer.SafeRepresenter().represent_data(values)
    except (yaml.representer.RepresenterError, ValueError) as error:
        # ValueError: of integers beyond reason
        raise InputError(
            f"holds what is not a plain value ({error.args[-1]!r})", file=file, where=where
        ) from None
    return _Reader(file).dataclass(node, schema, where and f"{where}.")


def check(instance: T, *, file: str | Path | None = None, where: str = "") -> T:
    """Returns `instance` after checking every value in it: numbers finite and in range, words
    known, texts printable.

    `where` is what stands in messages before a field's name, such as "foot.".
    """
    for field in dataclasses.fields(instance):
        check_field(field, getattr(instance, field.name), f"{where}{field.name}", file=file)
    return instance


def check_field(
    field: dataclasses.Field[Any], value: Any, place: str, *, file: str | Path | None = None
) -> None:
    """Raises InputError for a value that the field cannot have, which messages call `place`."""
    value = value.tolist() if hasattr(value, "tolist") else value  # of numpy
    kind = {"float": float, "int": int, "bool": bool}.get(str(field.type))
    if kind and not (type(value) is kind or (kind is float and type(value) is int)):
        raise InputError(
            f"{value!r} is not a {_KINDS[kind]}",
            file=file,
            where=place,
            right=f"Its unit is {field.metadata['unit']}" if "unit" in field.metadata else None,
        )
    if field.metadata.get("count") and value is not None:
        require(
            len(value) == field.metadata["count"],
            f"has {len(value)} numbers",
            place,
            f"It must have {field.metadata['count']}",
            file=file,
        )
    for inner, item in _items(value, place):
        if dataclasses.is_dataclass(item) and not isinstance(item, type):
            check(item, file=file, where=f"{inner}.")
        else:
            _check_scalar(item, field.metadata, inner, file)


def unit_hint(value: float, unit: str, low: float, high: float) -> str:
    """ ". Is it in metres?" where `value`, out of a range in `unit`, would be in it if it were in
    metres; else ""."""
    meant = [
        other
        for other, factor in _OTHER_UNITS.get(unit, {}).items()
        if value and low <= factor * value <= high
    ]
    return f". Is it in {' or '.join(meant)}?" if meant else ""


def _names(schema: type) -> str:
    return ", ".join(field.name for field in dataclasses.fields(schema))


def _items(value: Any, where: str) -> Iterable[tuple[str, Any]]:
    """What a value holds and where each stands; itself, if it holds nothing."""
    if isinstance(value, dict):
        return ((f"{where}.{key}", item) for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return ((f"{where}[{i}]", item) for i, item in enumerate(value))
    return [(where, value)]


def _check_scalar(value: Any, metadata: Any, where: str, file: Any) -> None:
    options = metadata.get("options")
    if options and value is not None and value not in options:
        raise InputError(
            f"{value!r} is not known",
            file=file,
            where=where,
            right=f"Known are: {', '.join(options)}",
        )
    if isinstance(value, str) and UNPRINTABLE.search(value):
        raise InputError(f"{value!r} has unprintable characters", file=file, where=where)
    if isinstance(value, str) and "unit" in metadata:
        raise InputError(
            f"{value!r} is not a number",
            file=file,
            where=where,
            right=f"Its unit is {metadata['unit']}",
        )
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return
    low, high, unit = (metadata.get(key) for key in ("low", "high", "unit"))
    unit = "" if unit in ("1", None) else f" {unit}"
    if not math.isfinite(value):
        raise InputError(f"{value} is not a finite number", file=file, where=where)
    if low is not None and not low <= value <= high:
        reach = f"between {low:g} and {high:g}"
        if math.isinf(high) or math.isinf(low):
            reach = f"at least {low:g}" if math.isinf(high) else f"at most {high:g}"
        raise InputError(
            f"{value:g}{unit} is outside its physical range",
            file=file,
            where=where,
            right=f"It must be {reach}{unit}{unit_hint(value, unit.strip(), low, high)}",
        )


class _Reader:
    """Turns YAML nodes into dataclasses; keeps the file so that every message can name it."""

    def __init__(self, file: str | Path | None) -> None:
        self.file = file

    @staticmethod
    def place(node: yaml.Node, key: str) -> str:
        return ", ".join(
            part for part in (node.start_mark and f"line {node.start_mark.line + 1}", key) if part
        )

    def fail(self, node: yaml.Node, key: str, what: str, right: str | None = None) -> InputError:
        return InputError(what, file=self.file, where=self.place(node, key) or None, right=right)

    def pairs(
        self, node: yaml.MappingNode, path: str
    ) -> Iterator[tuple[str, yaml.Node, yaml.Node]]:
        """Name, key and value of each entry."""
        seen = set()
        for key, value in node.value:
            if key.value in seen:
                raise self.fail(key, f"{path}{key.value}", "the key stands twice")
            seen.add(key.value)
            yield str(key.value), key, value

    def dataclass(self, node: yaml.Node, schema: type[T], path: str) -> T:
        if not isinstance(node, yaml.MappingNode):
            raise self.fail(
                node,
                path.rstrip("."),
                "must be a mapping of keys to values",
                f"Its keys are: {_names(schema)}",
            )
        fields = {field.name: field for field in dataclasses.fields(schema)}
        hints = typing.get_type_hints(schema)
        values: dict[str, Any] = {}
        for key, key_node, value_node in self.pairs(node, path):
            if key not in fields:
                near = difflib.get_close_matches(key, fields, n=1)
                right = f"Did you mean {near[0]}?" if near else f"Known keys are: {_names(schema)}"
                raise self.fail(key_node, path + key, "unknown key", right)
            values[key] = self.value(value_node, hints[key], path + key)
            parts = [
                part
                for where, held in _items(values[key], path + key)
                for part in (_items(held, where) if isinstance(held, tuple) else [(where, held)])
            ]
            for where, item in parts:
                if not dataclasses.is_dataclass(item):
                    _check_scalar(
                        item, fields[key].metadata, self.place(value_node, where), self.file
                    )
        for name, field in fields.items():
            missing = (
                field.default is dataclasses.MISSING
                and field.default_factory is dataclasses.MISSING
            )
            if missing and name not in values:
                unit = field.metadata.get("unit")
                raise self.fail(
                    node, path + name, "the key is missing", f"Its unit is {unit}" if unit else None
                )
        return schema(**values)

    def value(self, node: yaml.Node, hint: Any, key: str) -> Any:
        origin = typing.get_origin(hint)
        args = typing.get_args(hint)
        if origin in (types.UnionType, typing.Union):
            wanted = [a for a in args if a is not type(None)]
            if isinstance(node, yaml.MappingNode):
                wanted = [
                    a for a in wanted if dataclasses.is_dataclass(a) or typing.get_origin(a) is dict
                ] or wanted
            else:
                wanted = [a for a in wanted if not dataclasses.is_dataclass(a)] or wanted
            return (
                None if node.tag == "tag:yaml.org,2002:null" else self.value(node, wanted[0], key)
            )
        if dataclasses.is_dataclass(hint):
            return self.dataclass(node, hint, f"{key}.")  # type: ignore[arg-type]
        if origin is tuple:
            alone = isinstance(node, yaml.ScalarNode) and args[0] is str  # a list of one text
            if not alone and not isinstance(node, yaml.SequenceNode):
                raise self.fail(node, key, "must be a list")
            return tuple(
                self.value(item, args[0], key if alone else f"{key}[{i}]")
                for i, item in enumerate([node] if alone else node.value)
            )
        if origin is dict or (hint is Any and isinstance(node, yaml.MappingNode)):
            if not isinstance(node, yaml.MappingNode):
                raise self.fail(node, key, "must be a mapping of names to values")
            return {
                name: self.value(item, args[1] if args else Any, f"{key}.{name}")
                for name, _, item in self.pairs(node, f"{key}.")
            }
        if hint is Any and isinstance(node, yaml.SequenceNode):
            return [self.value(item, Any, f"{key}[{i}]") for i, item in enumerate(node.value)]
        return self.scalar(node, hint, key)

    def scalar(self, node: yaml.Node, hint: Any, key: str) -> Any:
        if not isinstance(node, yaml.ScalarNode):
            raise self.fail(node, key, f"must be a single {_KINDS.get(hint, hint)}")
        try:
            value = scalar(node)
        except ValueError:
            raise self.fail(
                node,
                key,
                f"{node.value[:_SHOWN]!r} has the tag {node.tag}, which is not plain YAML "
                "or not what it is",
            ) from None
        if hint is Any:
            if value != value:  # noqa: PLR0124 (only what is not a number is not itself)
                raise self.fail(node, key, f"{node.value!r} is not a number")
            return value
        if hint is str and value is not None:
            return node.value
        if hint in (int, float) and isinstance(value, str):  # a number in quotes
            value = number(value)
        if type(value) is hint or (hint is float and type(value) is int):
            return hint(value)
        raise self.fail(
            node, key, f"{node.value[:_SHOWN]!r} is not a {_KINDS[hint]}", _RIGHT.get(hint)
        )
