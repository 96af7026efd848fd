"""Two pages of reference: every key of every YAML file, from its schema, and every option of every
command."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import re
import textwrap
import tokenize
import typing
from collections.abc import Iterator
from typing import Any

import typer
import typer.main

from vsf_drake.cli import (  # noqa: F401 (each adds its commands)
    certify,
    compare,
    device,
    doctor,
    fit,
    foot,
    predict,
    recordings,
    session,
    stiffness_map,
    study,
    sweep,
    tune,
)
from vsf_drake.cli.app import app
from vsf_drake.cli.guide import GUIDES
from vsf_drake.model.bench_curves import _BenchFile
from vsf_drake.model.contact_file import FittedContact
from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.model.scenario import Scenario
from vsf_drake.motion.manifest import Manifest, StatedSubject
from vsf_drake.motion.markers import maps
from vsf_drake.motion.markers.maps import _MapFile

FILES: dict[str, tuple[type, str]] = {
    "Trial": (
        Manifest,
        "One recorded walk; `import` writes it. Guide: [trials](../guide/trials.md).",
    ),
    "Subject": (Subject, "The person, named by a trial; `import` writes it."),
    "Subject, stated": (
        StatedSubject,
        "What `import --subject` and a trial of markers take, as far as it is known.",
    ),
    "Marker map": (
        _MapFile,
        "Which label is which marker: [a laboratory's files](../guide/laboratory_files.md).",
    ),
    "Model": (
        ModelParameters,
        "Foot, socket and person, as `models/nominal.yaml` has them; a trial names it.",
    ),
    "Bench": (
        _BenchFile,
        "Stiffness as measured on a testing machine, for `fit --bench`: [fit](../guide/fit.md).",
    ),
    "Contact": (FittedContact, "What `fit` found; `--contact` takes it."),
    "Scenario": (Scenario, "A station of Drake systems. Guide: [Drake](../guide/drake.md)."),
    "Ground": (Ground, "Patches that a foot meets; `ground:` of a scenario names it."),
}
_WORDS = {float: "number", int: "whole number", bool: "true or false", str: "text"}


def pages() -> dict[str, str]:
    """Markdown by file name."""
    return {"yaml_files.md": yaml_files(), "command_line.md": command_line()}


def yaml_files() -> str:
    """The keys of each file."""
    text = [
        "# YAML files, every key",
        "",
        "`[]` is a list, `{}` is by names, of variables or coordinates. An unknown key is refused.",
        "",
    ]
    for name, (schema, what) in FILES.items():
        text += [
            f"## {name}",
            "",
            what,
            "",
            "| key | meaning | what it takes | unit | range | default | source |",
            "|---|---|---|---|---|---|---|",
        ]
        text += [
            "| " + " | ".join(_cell(word) for word in row) + " |" for row in _keys(schema, "", ())
        ]
        text.append("")
    return "\n".join(text)


def command_line() -> str:
    """The options of each command."""
    group: Any = typer.main.get_command(app)
    text = [
        "# Commands, every option",
        "",
        "The [guide](../guide/commands.md) says what each is for, and the exit codes.",
        "",
    ]
    for name in sorted(group.commands, key=list(GUIDES).index):
        command = group.commands[name]
        text += [
            f"## vsf-drake {name}",
            "",
            _cell(command.help or ""),
            "",
            "| | | default |",
            "|---|---|---|",
        ]
        for parameter in command.params:
            said = parameter.get_help_record(typer.Context(command))
            taken = (said[0] if said else parameter.human_readable_name).split(" <")[0]
            switch, value = " / " in taken, parameter.default
            default = (
                taken.split(" / ")[0 if value else 1]
                if switch
                else "required"
                if parameter.required
                else ("" if value is None or value is False or callable(value) else str(value))
            )
            text.append(
                f"| `{_cell(taken)}` | {_cell(getattr(parameter, 'help', None) or '')} | "
                f"{_cell(default)} |"
            )
        text.append("")
    return "\n".join(text)


def _keys(schema: type, before: str, above: tuple[type, ...]) -> Iterator[tuple[str, ...]]:
    """A row for each key, those of a schema within it below."""
    kinds, said = typing.get_type_hints(schema), _said(schema)
    for field in dataclasses.fields(schema):
        name, meta = f"{before}{field.name}", field.metadata
        inner, mark, plain = _inside(kinds[field.name])
        low, high = meta.get("low"), meta.get("high")
        takes = " or ".join(meta["options"]) if "options" in meta else plain
        kind, _, of_source = meta.get("source", "").partition(": ")
        measured = of_source if kind in ("measured", "stated") else ""
        meaning = said.get(field.name) or measured or _first_sentence(inner) or "–"
        yield (
            f"`{name}{mark}`",
            meaning,
            takes or "keys",
            meta.get("unit", ""),
            "" if low is None else f"{low:g} to {high:g}",
            _default(field),
            meta.get("source", ""),
        )
        if inner and inner not in above:
            yield from _keys(inner, f"{name}{mark}.", (*above, schema))


def _said(schema: type) -> dict[str, str]:
    """What the sources say of each field of a dataclass and of those it inherits: the comment
    beside it, or the text below it."""
    said: dict[str, str] = {}
    for cls in reversed(schema.__mro__):
        try:
            source = textwrap.dedent(inspect.getsource(cls))
        except (OSError, TypeError):  # object, and what make_dataclass has made
            said |= _roles() if cls.__name__ in maps.ROLES else {}
            continue
        comments = [
            (token.start[0], token.string.lstrip("# "))
            for token in tokenize.generate_tokens(io.StringIO(source).readline)
            if token.type == tokenize.COMMENT
        ]
        body = typing.cast(ast.ClassDef, ast.parse(source).body[0]).body
        for node, following in zip(body, [*body[1:], None], strict=True):
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                beside = [
                    text
                    for line, text in comments
                    if node.lineno <= line <= (node.end_lineno or 0)
                    and not text.startswith(("noqa", "type:"))
                ]
                below = (
                    [following.value.value]
                    if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
                    else []
                )
                said[node.target.id] = " ".join([*beside, *map(str, below)])
    return said


def _roles() -> dict[str, str]:
    """The comments beside the roles of marker maps; clusters have that beside their tuple."""
    text = inspect.getsource(maps)
    beside = dict(re.findall(r'^ {8}"(\w+)",  # (.+)$', text, flags=re.MULTILINE))
    for names in ("SIDED_CLUSTERS", "MIDDLE_CLUSTERS"):
        said = re.findall(rf"^ {{8}}\*{names},  # (.+)$", text, flags=re.MULTILINE)
        beside |= dict.fromkeys(getattr(maps, names), *said)
    return beside


def _first_sentence(schema: type | None) -> str:
    """What the docstring of a schema begins with, "" if there is no schema or it has none of its
    own."""
    text = " ".join(((schema and schema.__doc__) or "").split())
    return (
        ""
        if schema and text.startswith(f"{schema.__name__}(")
        else re.split(r"(?<!\.)\. ", text)[0].rstrip(".")
    )


def _inside(kind: Any) -> tuple[type | None, str, str]:
    """The schema within an annotation, "[]" or "{}" where there are several, and in words what else
    it takes."""
    schema, mark, words = None, "", list[str]()
    if dataclasses.is_dataclass(kind):
        return typing.cast(type, kind), "", ""
    origin = typing.get_origin(kind)
    arguments = [one for one in typing.get_args(kind) if one not in (type(None), Ellipsis)]
    if origin is dict:
        schema, _, word = _inside(arguments[1])
        return schema, "{}", word
    if origin in (tuple, list):
        schema, _, word = _inside(arguments[0])
        return schema, "[]", word
    for one in arguments:
        found, mark_of, word = _inside(one)
        schema, mark, words = schema or found, mark or mark_of, [*words, *filter(None, [word])]
    return (
        schema,
        mark,
        " or ".join(dict.fromkeys(words)) or ("" if arguments else _WORDS.get(kind, "any value")),
    )


def _default(field: dataclasses.Field[Any]) -> str:
    if field.default is dataclasses.MISSING:
        made = None if field.default_factory is dataclasses.MISSING else field.default_factory()
        return (
            "required"
            if made is None
            else "the nominal one"
            if dataclasses.is_dataclass(made)
            else "none"
        )
    value = field.default
    if dataclasses.is_dataclass(value):
        return "the nominal one"
    if value is None or value == ():
        return "none"
    if isinstance(value, tuple):
        return ", ".join(f"{one:g}" if isinstance(one, float | int) else "its own" for one in value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float | int) else str(value)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
