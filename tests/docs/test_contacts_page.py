"""The page on contacts: its example runs, and its table has every combination that the comparison has."""

from __future__ import annotations

import re
from pathlib import Path

from contact_comparison import WAYS

from vsf_drake.plants.foot import CONTACTS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "contacts.md").read_text(encoding="utf-8")


def test_example_of_the_page_wires_a_foot_on_drakes_contact():
    names: dict = {}
    for block in re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL):
        exec(block, names)
    assert names["wired"].reaction is not None
    assert names["wired"].command is not None


def test_table_has_every_contact_under_every_way_once():
    cells = r"^\| `(\w+)` \| ([^|]+) \|(?: [^|]+ \|){4}[^|]*\|$"
    rows = re.findall(cells, PAGE, flags=re.MULTILINE)
    assert sorted(rows) == sorted((contact, way.name) for contact in CONTACTS for way in WAYS)
