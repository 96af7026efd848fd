"""Options of a command that are fields of a class: name, default, range and help stand there, and
nowhere else."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

import typer

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import user_path
from vsf_drake.base.schema import check_field, option

T = TypeVar("T")
Fields = dict[str, "dataclasses.Field[Any]"]
Asked = dict[str, Any]
"""What was given on the command line, by field; what was left out is not in it."""
PLACE = "Fulcrum position in mm from the keel's posterior end, or the forefoot's stiffness (16N/mm)"
PLACES = "MM|N/mm"
_KEYWORD = inspect.Parameter.KEYWORD_ONLY


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlaceOptions:
    """Where the fulcrum is to stand."""

    fulcrum: str | None = option(
        None,
        f"{PLACE}. Default: 108 mm; a passive foot has none.",
        flag="--fulcrum-mm",
        metavar=PLACES,
    )


def from_fields(command: Callable[..., None]) -> Callable[..., None]:
    """The command with options made of the fields of classes, those that have a help.

    They stand where the command has a parameter that is a dataclass, which is handed over with what
    was given; or one that is `Annotated[Asked, SCHEMA, ...]`, which is what was given alone.
    """
    parameters = [inspect.Parameter("context", _KEYWORD, annotation=typer.Context)]
    groups: dict[str, tuple[Any, Fields]] = {}
    for own in inspect.signature(command, eval_str=True).parameters.values():
        schemas = getattr(own.annotation, "__metadata__", (own.annotation,))
        if not all(map(dataclasses.is_dataclass, schemas)):
            parameters.append(own.replace(kind=_KEYWORD))
            continue
        fields = fields_of(*schemas)
        groups[own.name] = getattr(own.annotation, "__origin__", own.annotation), fields
        hints = {name: hint for each in schemas for name, hint in get_type_hints(each).items()}
        parameters += [_parameter(field, hints[name]) for name, field in fields.items()]

    def called(context: typer.Context, **values: Any) -> None:
        for name, (kind, fields) in groups.items():
            taken = {key: values.pop(key) for key in fields}
            given = {
                key: _read(fields[key], value)
                for key, value in taken.items()
                if getattr(context.get_parameter_source(key), "name", "") != "DEFAULT"
            }
            values[name] = given if kind == Asked else made(kind, given)
        command(**values)

    called.__name__ = command.__name__
    called.__doc__ = command.__doc__
    called.__annotations__ = {}
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return called


def fields_of(*schemas: Any) -> Fields:
    """The fields that are options of a command, by name."""
    return {
        field.name: field
        for schema in schemas
        for field in dataclasses.fields(schema)
        if "help" in field.metadata
    }


def flags(field: dataclasses.Field[Any]) -> list[str]:
    """The option's names, such as --time-limit; the first is that of messages."""
    return str(field.metadata.get("flag", f"--{field.name.replace('_', '-')}")).split()


def made(schema: type[T], given: Asked) -> T:
    """The class with what was given; a mistake is named by its option."""
    with named_as_options(schema):
        return schema(**given)


@contextmanager
def named_as_options(*schemas: type, **others: str) -> Iterator[None]:
    """Mistakes in fields are named as the command line names them; `others` are names that are no
    fields'."""
    names = {name: flags(field)[0] for name, field in fields_of(*schemas).items()} | others
    try:
        yield
    except InputError as error:
        name, _, part = str(error.where or "").partition("[")[0].partition(".")
        if error.file is not None or name not in names:
            raise
        where = f"{names[name]} {part}".rstrip()
        raise InputError(error.what, where=where, right=error.right) from None


def _parameter(field: dataclasses.Field[Any], hint: Any) -> inspect.Parameter:
    """As Typer takes it: a whole number with its range, names with commas or numbers by name as one
    text, several values as an option that may be repeated, what is on as one that may be off."""
    told = field.metadata
    kind = next(iter(get_args(hint))) if type(None) in get_args(hint) else hint
    items = get_args(kind)
    default = None if field.default is dataclasses.MISSING or ... in items else field.default
    if "," in told.get("metavar", ""):
        kind = str
    elif ... in items:
        kind = list[items[0]]  # type: ignore[valid-type]
    reach = {"min": told.get("low", -math.inf), "max": told.get("high", math.inf)}
    names = flags(field)
    if field.default is True:
        names = [f"{names[0]}/--no-{names[0].removeprefix('--')}"]
    option = typer.Option(
        *names,
        parser=user_path if Path in (kind, *items) else None,
        help=told["help"],
        metavar=told.get("metavar"),
        rich_help_panel=told.get("panel"),
        show_default=told.get("shown", kind is not bool or field.default),
        **{end: at for end, at in reach.items() if kind is int and math.isfinite(at)},
    )
    kind = kind if default is not None else kind | None
    return inspect.Parameter(
        field.name, _KEYWORD, default=default, annotation=Annotated[kind, option]
    )


def _read(field: dataclasses.Field[Any], value: Any) -> Any:
    """What was given for a field, checked: names and values as tuples, numbers by name as a
    dict."""
    metavar = field.metadata.get("metavar", "")
    [where, *_] = flags(field)
    if "," in metavar:
        value = [part.strip() for part in value.split(",") if part.strip()]
        require(value, "names nothing", where)
    if "," in metavar and "=" in metavar:
        return _numbers(value, where)
    for item in value if isinstance(value, (list, tuple)) else [value]:
        check_field(field, item, where)
    return tuple(value) if isinstance(value, list) else value


def _numbers(parts: list[str], where: str) -> dict[str, float]:
    """`joint_load=1`, `push_off=0.5` as numbers by name."""
    numbers: dict[str, float] = {}
    for part in parts:
        name, equals, number = (piece.strip() for piece in part.partition("="))
        require(
            equals,
            f"{part!r} is no weight",
            where,
            "Write COST=NUMBER, separated by commas: joint_load=1,push_off=0.5",
        )
        require(name not in numbers, f"{name} has two weights", where, "Give every cost one")
        numbers[name] = number_of(number, f"{where} {name}")
    return numbers


def number_of(text: str, where: str, right: str | None = None) -> float:
    """The number that somebody wrote, or InputError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    require(math.isfinite(value), f"{text.strip()!r} is not a finite number", where, right)
    return value
