"""YAML <-> frozen dataclasses, with units, sources, ranges and messages that name file, line and key.

A schema is a dataclass whose fields are made by `quantity` (numbers with unit and source)
or `choice` (words from a list). It has no behaviour. `load_yaml` reads a file into it,
`check` verifies an instance that was made in Python, `dump_yaml` writes it back; `to_plain` and
`from_plain` do so with nested dicts, as saved results hold them.

Drake's yaml_load_typed and yaml_dump_typed do not take such classes: they want annotations that are no strings, no
tuples, a default for every field and nothing frozen, and know no ranges. The call that does is
`load_yaml(path, schema)`, for a scenario `load_scenario(path)`, or `from_plain(schema, yaml_load_file(path))` where
Drake has read the file. What `dump_yaml` writes, Drake's yaml_load_data and yaml_load_file read.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import types
import typing
from pathlib import Path
from typing import Any, TypeVar

import yaml

from vsf_drake.errors import UNPRINTABLE, InputError
from vsf_drake.yaml_file import dump, number, read_yaml, scalar

T = TypeVar("T")

_OTHER_UNITS = {"mm": {"metres": 1e3, "centimetres": 10.0},
                "m": {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254},
                "deg": {"radians": 180.0 / math.pi}, "rad": {"degrees": math.pi / 180.0},
                "kg": {"pounds": 0.45359237, "grams": 1e-3}, "s": {"milliseconds": 1e-3},
                "N/m": {"N/mm": 1e3}, "N/mm": {"N/m": 1e-3}}
"""What else people give where a unit is asked for, and how much of that unit it is."""


def quantity(
    default: Any = dataclasses.MISSING,
    *,
    unit: str,
    source: str,
    low: float = -math.inf,
    high: float = math.inf,
) -> Any:
    """A field that holds a number (or a tuple of numbers) with its unit, source and closed range."""
    metadata = {"unit": unit, "source": source, "low": low, "high": high}
    return dataclasses.field(default=default, metadata=metadata)


def choice(default: Any = dataclasses.MISSING, *, options: tuple[str, ...], source: str) -> Any:
    """A field that holds one word out of `options`."""
    return dataclasses.field(default=default, metadata={"options": options, "source": source})


def load_yaml(path: str | Path, schema: type[T], *, right: str | None = None) -> T:
    """Reads `path` into `schema`; `right` is what to do if there is no such file.

    Raises:
        InputError: see `vsf_drake.yaml_file.read_yaml`; a key is unknown, doubled or missing; a value has the wrong
            type, is not finite or is out of range.
    """
    path = Path(path)
    node = read_yaml(path, right=right)
    if node is None:
        raise InputError("is empty", file=path, right=f"Its keys are: {_names(schema)}")
    return _Reader(path).dataclass(node, schema, "")


def load_plain(path: str | Path, *, right: str | None = None) -> Any:
    """What a YAML file holds, as nested dicts, lists and scalars; `right` is what to do if there is no such file.

    Raises:
        InputError: see `vsf_drake.yaml_file.read_yaml`; a key is doubled, or a value has a tag.
    """
    node = read_yaml(path, right=right)
    return None if node is None else _Reader(path).value(node, Any, "")


def check(instance: T, *, file: str | Path | None = None) -> T:
    """Returns `instance` after checking every number in it against its field's range.

    Raises:
        InputError: a number is not finite or out of range, a word is not one of its options, or a text is unprintable.
    """
    _check_dataclass(instance, "", file)
    return instance


def dump_yaml(instance: Any) -> str:
    """`instance` as YAML text that `load_yaml` reads back to an equal object."""
    return dump(to_plain(instance))


def to_plain(instance: Any) -> Any:
    """`instance` as nested dicts, lists and scalars; fields that are None are left out."""
    if dataclasses.is_dataclass(instance) and not isinstance(instance, type):
        pairs = ((f.name, getattr(instance, f.name)) for f in dataclasses.fields(instance))
        return {name: to_plain(value) for name, value in pairs if value is not None}
    if isinstance(instance, (list, tuple)):
        return [to_plain(value) for value in instance]
    if isinstance(instance, dict):
        return {str(key): to_plain(value) for key, value in instance.items()}
    if isinstance(instance, Path):
        return str(instance)
    return instance.item() if hasattr(instance, "item") else instance


def from_plain(schema: type[T], values: Any, *, where: str = "", file: str | Path | None = None) -> T:
    """The `schema` that `to_plain` turned into `values`, an equal object; read as strictly as a file.

    Args:
        values: nested dicts, lists and scalars.
        where, file: what messages call `values`, and what they come from.

    Raises:
        InputError: a key is unknown or missing; a value has the wrong type, is not finite or is out of range.
    """
    try:
        node = yaml.representer.SafeRepresenter().represent_data(values)
    except (yaml.representer.RepresenterError, ValueError) as error:  # ValueError: of integers beyond reason
        raise InputError(f"holds what is not a plain value ({error.args[-1]!r})", file=file, where=where) from None
    return _Reader(file).dataclass(node, schema, where and f"{where}.")


def _names(schema: type) -> str:
    return ", ".join(field.name for field in dataclasses.fields(schema))


def _check_dataclass(instance: Any, path: str, file: Any) -> None:
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        value = value.tolist() if hasattr(value, "tolist") else value  # of numpy
        where = f"{path}{field.name}"
        _check_number(value, field, where, file)
        if dataclasses.is_dataclass(value):
            _check_dataclass(value, f"{where}.", file)
        elif isinstance(value, (list, tuple)):
            for i, item in enumerate(value):
                if dataclasses.is_dataclass(item):
                    _check_dataclass(item, f"{where}[{i}].", file)
                else:
                    _check_scalar(item, field.metadata, f"{where}[{i}]", file)
        elif isinstance(value, dict):
            for key, item in value.items():
                _check_scalar(item, field.metadata, f"{where}.{key}", file)
        else:
            _check_scalar(value, field.metadata, where, file)


def _check_number(value: Any, field: dataclasses.Field, where: str, file: Any) -> None:
    """Raises InputError for anything else than one number, whole number or truth value in a field of one."""
    kind = {"float": float, "int": int, "bool": bool}.get(str(field.type))
    if kind and not (type(value) is kind or (kind is float and type(value) is int)):
        raise InputError(f"{value!r} is not a {_KINDS[kind]}", file=file, where=where,
                         right=f"Its unit is {field.metadata['unit']}" if "unit" in field.metadata else None)


def _check_scalar(value: Any, metadata: Any, where: str, file: Any) -> None:
    options = metadata.get("options")
    if options and value is not None and value not in options:
        raise InputError(
            f"{value!r} is not known", file=file, where=where, right=f"Known are: {', '.join(options)}"
        )
    if isinstance(value, str) and UNPRINTABLE.search(value):
        raise InputError(f"{value!r} has unprintable characters", file=file, where=where)
    if isinstance(value, str) and "unit" in metadata:
        raise InputError(f"{value!r} is not a number", file=file, where=where, right=f"Its unit is {metadata['unit']}")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return
    low, high, unit = (metadata.get(key) for key in ("low", "high", "unit"))
    unit = "" if unit in ("1", None) else f" {unit}"
    if not math.isfinite(value):
        raise InputError(f"{value} is not a finite number", file=file, where=where)
    if low is not None and not low <= value <= high:
        raise InputError(
            f"{value:g}{unit} is outside its physical range",
            file=file,
            where=where,
            right=f"It must be {_range(low, high)}{unit}{unit_hint(value, unit.strip(), low, high)}",
        )


def unit_hint(value: float, unit: str, low: float, high: float) -> str:
    """". Is it in metres?" where `value`, out of a range in `unit`, would be in it if it were in metres; else ""."""
    meant = [other for other, factor in _OTHER_UNITS.get(unit, {}).items() if value and low <= factor * value <= high]
    return f". Is it in {' or '.join(meant)}?" if meant else ""


def _range(low: float, high: float) -> str:
    if math.isinf(high):
        return f"at least {low:g}"
    return f"at most {high:g}" if math.isinf(low) else f"between {low:g} and {high:g}"


class _Reader:
    """Turns YAML nodes into dataclasses; keeps the file so that every message can name it."""

    def __init__(self, file: str | Path | None) -> None:
        self.file = file

    @staticmethod
    def place(node: yaml.Node, key: str) -> str:
        return ", ".join(part for part in (node.start_mark and f"line {node.start_mark.line + 1}", key) if part)

    def fail(self, node: yaml.Node, key: str, what: str, right: str | None = None) -> InputError:
        return InputError(what, file=self.file, where=self.place(node, key) or None, right=right)

    def dataclass(self, node: yaml.Node, schema: type[T], path: str) -> T:
        if not isinstance(node, yaml.MappingNode):
            raise self.fail(node, path.rstrip("."), "must be a mapping of keys to values",
                            f"Its keys are: {_names(schema)}")
        fields = {field.name: field for field in dataclasses.fields(schema)}  # type: ignore[arg-type]
        hints = typing.get_type_hints(schema)
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            if key not in fields:
                near = difflib.get_close_matches(key, fields, n=1)
                right = f"Did you mean {near[0]}?" if near else f"Known keys are: {_names(schema)}"
                raise self.fail(key_node, path + key, "unknown key", right)
            if key in values:
                raise self.fail(key_node, path + key, "the key stands twice")
            value = self.value(value_node, hints[key], path + key)
            self._range_check(value_node, value, fields[key], path + key)
            values[key] = value
        for name, field in fields.items():
            missing = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
            if missing and name not in values:
                unit = field.metadata.get("unit")
                raise self.fail(node, path + name, "the key is missing", f"Its unit is {unit}" if unit else None)
        return schema(**values)

    def _range_check(self, node: yaml.Node, value: Any, field: Any, key: str) -> None:
        items = {f"{key}.{name}": item for name, item in value.items()} if isinstance(value, dict) else {key: value}
        for where, item in items.items():
            for one in item if isinstance(item, tuple) else (item,):
                if not dataclasses.is_dataclass(one):
                    _check_scalar(one, field.metadata, self.place(node, where), self.file)

    def value(self, node: yaml.Node, hint: Any, key: str) -> Any:
        origin, args = typing.get_origin(hint), typing.get_args(hint)
        if origin in (types.UnionType, typing.Union):
            if node.tag == "tag:yaml.org,2002:null":
                return None
            wanted = [a for a in args if a is not type(None)]
            if isinstance(node, yaml.MappingNode):
                wanted = [a for a in wanted if dataclasses.is_dataclass(a) or typing.get_origin(a) is dict] or wanted
            else:
                wanted = [a for a in wanted if not dataclasses.is_dataclass(a)] or wanted
            return self.value(node, wanted[0], key)
        if dataclasses.is_dataclass(hint):
            return self.dataclass(node, hint, f"{key}.")  # type: ignore[arg-type]
        if origin is tuple:
            alone = isinstance(node, yaml.ScalarNode) and args[0] is str  # a list of one text
            if not alone and not isinstance(node, yaml.SequenceNode):
                raise self.fail(node, key, "must be a list")
            return tuple(self.value(item, args[0], key if alone else f"{key}[{i}]")
                         for i, item in enumerate([node] if alone else node.value))
        if origin is dict:
            if not isinstance(node, yaml.MappingNode):
                raise self.fail(node, key, "must be a mapping of names to values")
            return self._mapping(node, args[1], key)
        return self._plain(node, key) if hint is Any else self._scalar(node, hint, key)

    def _mapping(self, node: yaml.MappingNode, hint: Any, key: str) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name_node, value_node in node.value:
            name, where = str(name_node.value), f"{key}.{name_node.value}"
            if name in found:
                raise self.fail(name_node, where, "the key stands twice")
            found[name] = self.value(value_node, hint, where)
        return found

    def _plain(self, node: yaml.Node, key: str) -> Any:
        """Whatever plain value stands there."""
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, Any, key)
        if isinstance(node, yaml.SequenceNode):
            return [self._plain(item, f"{key}[{i}]") for i, item in enumerate(node.value)]
        value = self._construct(node, key)  # type: ignore[arg-type]
        if value != value:  # noqa: PLR0124 (only what is not a number is not itself)
            raise self.fail(node, key, f"{node.value!r} is not a number")
        return value

    def _scalar(self, node: yaml.Node, hint: type, key: str) -> Any:
        if not isinstance(node, yaml.ScalarNode):
            raise self.fail(node, key, f"must be a single {_KINDS.get(hint, hint)}")
        value = self._construct(node, key)
        if hint is str and value is not None:
            return node.value
        if hint in (int, float) and isinstance(value, str):  # a number in quotes
            value = number(value)
        if type(value) is hint or (hint is float and type(value) is int):
            return hint(value)  # type: ignore[arg-type]
        kind, right = _KINDS[hint], _RIGHT.get(hint)
        raise self.fail(node, key, f"{node.value[:_SHOWN]!r} is not a {kind}", right)

    def _construct(self, node: yaml.ScalarNode, key: str) -> Any:
        try:
            return scalar(node)
        except ValueError:
            raise self.fail(node, key, f"{node.value[:_SHOWN]!r} has the tag {node.tag}, which is not plain YAML "
                                       "or not what it is") from None


_SHOWN = 40
"""Letters of a wrong value in messages."""
_KINDS = {float: "number", int: "whole number", bool: "true or false", str: "text"}
_RIGHT = {float: "Write it in decimals, such as 70, 0.5 or 1e5", int: "Write it in decimals, such as 70",
          bool: "Write true or false"}
