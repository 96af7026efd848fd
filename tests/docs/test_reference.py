"""The reference of YAML keys says of each key what the sources say of it."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest
from generated_reference import FILES, _keys, yaml_files

from vsf_drake.base.schema import choice, quantity


@dataclass(frozen=True, kw_only=True)
class Spring:
    """A spring of 0 ... 9 coils. It is only here to be described."""

    rate: float = quantity(unit="N/m", low=0.0, high=1.0, source="measured: on the bench")
    length: float = quantity(  # unloaded
        0.1, unit="m", low=0.0, high=1.0, source="measured: end to end"
    )
    end: str = choice("flat", options=("flat", "open"), source="stated")


@dataclass(frozen=True, kw_only=True)
class Foot(Spring):
    name: str  # for the page
    """And nothing else."""
    springs: tuple[Spring, ...] = ()
    heel: Spring | None = None  # noqa: RUF100


def test_a_meaning_is_the_comment_the_text_below_what_was_measured_or_the_schema_and_else_a_dash():
    meanings = {key: meaning for key, meaning, *_ in _keys(Foot, "", ())}
    assert meanings == {
        "`rate`": "on the bench",
        "`length`": "unloaded",
        "`end`": "–",
        "`name`": "for the page And nothing else.",
        "`springs[]`": "A spring of 0 ... 9 coils",
        "`springs[].rate`": "on the bench",
        "`springs[].length`": "unloaded",
        "`springs[].end`": "–",
        "`heel`": "A spring of 0 ... 9 coils",
        "`heel.rate`": "on the bench",
        "`heel.length`": "unloaded",
        "`heel.end`": "–",
    }


@pytest.mark.parametrize(
    ("key", "meaning"),
    [
        ("kinematics", "OpenSim .mot or .sto"),
        ("offsets.alignment_deg", "toe up"),
        ("thigh_length_m", "hip to knee"),
        ("knee_width_mm", "epicondyles"),
        ("foot.zones[].full_damping_depth_m", "full"),
        ("foot.keel", "leaf-spring"),
    ],
)
def test_keys_that_are_often_looked_up_have_their_meaning(key, meaning):
    row = next(line for line in yaml_files().splitlines() if line.startswith(f"| `{key}` |"))
    assert meaning in row.split(" | ")[1]


def test_no_key_is_without_a_meaning():
    bare = [
        line
        for line in yaml_files().splitlines()
        if line.startswith("| `") and line.split(" | ")[1] == "–"
    ]
    assert bare == []


def test_every_row_has_every_column():
    rows = [line for line in yaml_files().splitlines() if line.startswith("| `")]
    assert {len(re.split(r"(?<!\\)\|", row)) for row in rows} == {9}
    assert len(rows) == sum(len(list(_keys(schema, "", ()))) for schema, _ in FILES.values()) > 300
