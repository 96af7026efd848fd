"""Rows by fulcrum position."""

from __future__ import annotations

from types import SimpleNamespace

from vsf_drake.walks.numbers import by_fulcrum


def test_rows_stand_by_their_position_softest_first_and_else_in_their_order():
    rows = [SimpleNamespace(fulcrum_mm=x, name=name) for x, name in ((151.0, "a"), (66.0, "b"))]
    rows += [SimpleNamespace(fulcrum_mm=66.0, name="c")]
    groups = {x: [row.name for row in own] for x, own in by_fulcrum(rows).items()}
    assert list(groups.items()) == [(66.0, ["b", "c"]), (151.0, ["a"])]
    assert by_fulcrum([]) == {}
