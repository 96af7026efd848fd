"""YAML that anybody may have written, read within limits and without YAML 1.1's surprises; and YAML
for anybody.

Numbers are decimal (70, -0.5, 1e5, .inf), truth is true or false. What YAML 1.1 makes numbers,
truth or dates of besides (070, 1:18, 1_000, 0x1F, yes, 2026-11-22) is text here, which no number
can be read from. `dump` quotes what either would take for something else than text.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, ClassVar

import yaml
from yaml.composer import Composer

from vsf_drake.base.errors import UNPRINTABLE, InputError
from vsf_drake.base.files import read_text

MOST_BYTES, MOST_NODES, DEEPEST = 2**20, 50_000, 32
"""Fifty times the largest file that this package writes; more take PyYAML seconds."""
_TAG = "tag:yaml.org,2002:"
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,98})")
_NUMBER = re.compile(
    r"[-+]?(([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|(0|[1-9][0-9]*)[eE][-+]?[0-9]+|\.(inf|Inf|INF))|\.(nan|NaN|NAN)"
)
_TYPES = {"null": type(None), "bool": bool, "int": int, "float": float}
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def read_yaml(path: str | Path, *, right: str | None = None) -> yaml.Node | None:
    """The one document of a file, whose keys are all scalars; None if it is empty.

    InputError, with file and line, beyond MOST_NODES values (aliases counted as what they stand
    for) or DEEPEST, for aliases of what holds aliases and for unprintable characters; `right` is
    what to do if there is no such file.
    """
    text = read_text(path, most=MOST_BYTES, right=right)
    try:
        try:
            return _node(_Loader(text) if _UNLIKE.search(text) else _QuickLoader(text))
        except _Refused:
            raise
        except yaml.YAMLError:  # the other one says better what is wrong, and where
            return _node(_Loader(text))
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        # the latter two: of escapes beyond Unicode
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error).partition("\n")[0]
        raise InputError(
            f"is not valid YAML ({problem})",
            file=path,
            where=f"line {mark.line + 1}" if mark else None,
        ) from None


def _node(loader: Any) -> yaml.Node | None:
    try:
        node: yaml.Node | None = loader.get_single_node()
    finally:
        loader.dispose()
    return node


def number(text: str) -> int | float | None:
    """The number that a text is, in decimals; None for any other text."""
    if _INTEGER.fullmatch(text):
        return int(text)
    return (
        float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
        if _NUMBER.fullmatch(text)
        else None
    )


def scalar(node: yaml.ScalarNode) -> Any:
    """None, bool, int, float or str; ValueError for another tag, or a text that its tag does not
    fit."""
    kind = node.tag.removeprefix(_TAG)
    text = node.value
    if kind == "str":
        return text
    value = number(text) if kind in ("int", "float") else _WORDS.get(text, text)
    if kind == "float" and type(value) is int:
        return float(value)
    if type(value) is not _TYPES.get(kind):
        raise ValueError(text)
    return value


class Dumper(yaml.SafeDumper):
    """Writes plain values so that `read_yaml` gives them back: without aliases, texts quoted that
    look like others."""

    def ignore_aliases(self, data: Any) -> bool:
        """Whatever stands twice is written twice."""
        return True


def dump(values: Any, **layout: Any) -> str:
    """Plain `values` as YAML, keys in their order; `layout` is PyYAML's."""
    text: str = yaml.dump(values, Dumper=Dumper, sort_keys=False, allow_unicode=True, **layout)
    return text


class _Refused(yaml.MarkedYAMLError):
    """A limit is passed."""


class _Composer(Composer):
    """Composes nodes only, and gives up where a limit is passed."""

    parser: ClassVar[Any]
    """Another base, which takes the text apart."""

    def __init__(self, text: str) -> None:
        Composer.__init__(self)
        self.parser.__init__(self, text)
        self._nodes = self._aliases = self._depth = 0
        self._sizes: dict[int, int] = {}
        """Of finished nodes with an anchor and without aliases, by their id."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.parser.peek_event(self)
        if isinstance(event, yaml.AliasEvent):
            node = super().compose_node(parent, index)
            self._refuse(
                event,
                id(node) not in self._sizes,
                "an alias stands for what holds an alias or itself",
            )
            self._nodes += self._sizes[id(node)]
            self._aliases += 1
        else:
            nodes = self._nodes
            aliases = self._aliases
            self._nodes += 1
            self._depth += 1
            self._refuse(event, self._depth > DEEPEST, f"it is nested more than {DEEPEST} deep")
            text = event.value if isinstance(event, yaml.ScalarEvent) else ""
            self._refuse(event, UNPRINTABLE.search(text), "it has unprintable characters")
            node = super().compose_node(parent, index)
            self._depth -= 1
            if event.anchor and aliases == self._aliases:
                self._sizes[id(node)] = self._nodes - nodes
        self._refuse(event, self._nodes > MOST_NODES, f"it has more than {MOST_NODES} values")
        key = isinstance(parent, yaml.MappingNode) and index is None
        self._refuse(event, key and not isinstance(node, yaml.ScalarNode), "a key must be a word")
        return node

    @staticmethod
    def _refuse(event: yaml.Event, wrong: object, what: str) -> None:
        if wrong:
            # a Mark
            raise _Refused(problem=what, problem_mark=event.start_mark)  # type: ignore[arg-type]


class _Loader(_Composer, yaml.SafeLoader):
    # of the instance in the stubs
    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}  # type: ignore[misc]
    parser = yaml.SafeLoader


_InC: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


# read otherwise in C than in Python, which takes no tab between values
_UNLIKE = re.compile("[\t!?\ufeff\x85\u2028\u2029]")


class _QuickLoader(_Composer, _InC):  # type: ignore[misc]
    """Takes the text apart in C, where PyYAML has that, ten times as fast."""

    yaml_implicit_resolvers: ClassVar[dict[str, Any]] = {}
    parser = _InC


for _class in (_Loader, _QuickLoader, Dumper):
    for _kind, _pattern, _first in (
        (
            "null",
            "|".join(re.escape(word) for word, value in _WORDS.items() if value is None),
            ["", *"~nN"],
        ),
        (
            "bool",
            "|".join(word for word, value in _WORDS.items() if value is not None),
            list("tTfF"),
        ),
        ("int", _INTEGER.pattern, list("-+0123456789")),
        ("float", _NUMBER.pattern, list("-+.0123456789")),
    ):
        _class.add_implicit_resolver(_TAG + _kind, re.compile(rf"(?:{_pattern})\Z"), _first)
