"""Pages with code run as they stand, print what they say they print, and show the pictures that
their code makes."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import tutorial
from contact_comparison import WAYS
from matplotlib import pyplot
from matplotlib.image import imread

from vsf_drake.plants.foot import CONTACTS

DOCS = Path(__file__).resolve().parents[2] / "docs"
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))


def test_the_page_on_contacts_wires_a_foot_and_has_every_contact_under_every_way_once():
    page = (DOCS / "contacts.md").read_text(encoding="utf-8")
    names: dict = {}
    for block in re.findall(r"^```python\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL):
        exec(block, names)
    assert names["wired"].reaction is not None and names["wired"].command is not None
    rows = re.findall(
        r"^\| `(\w+)` \| ([^|]+) \|(?: [^|]+ \|){4}[^|]*\|$", page, flags=re.MULTILINE
    )
    assert sorted(rows) == sorted((contact, way.name) for contact in CONTACTS for way in WAYS)


WALK_BY_IT = """
from dataclasses import replace
import numpy as np
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS
from vsf_drake.simulation.walk import Walker, trial_request
from vsf_drake.walks.embedded import embedded_trials

trial = load_trial(embedded_trials("exact")[0])
walker = Walker(trial.subject, replace(trial.model, contact_law="voigt"))
by = [name for name in walker.variables if name.startswith("contact.") and "damping" in name]
walk = walker.walk(**trial_request(trial, start_s=0.45, end_s=0.454), with_respect_to=by)
constants = dict(zip(SITE_COLUMNS, walk.mechanism.sites.T))
depth, rate, found = (walk.record.site(n) for n in ("depth", "depth_rate", "normal_force"))
force = np.where(depth > 0.0, constants["stiffness"] * depth + constants["damping"] * rate, 0.0)
assert found.max() > 10.0
np.testing.assert_allclose(found, np.maximum(force, 0.0), rtol=1e-9, atol=1e-9)
assert walk.sensitivity.grf_W.any()
"""


def test_the_law_that_the_page_adds_is_walked_by_after_one_file_and_one_line(tmp_path):
    """In a copy of the package, in Python: its compilation would take longer than the walk."""
    page = (DOCS / "contacts.md").read_text(encoding="utf-8")
    [law] = re.findall(r"^```python\n(\"\"\"Spring and damper.*?)^```$", page, re.M | re.S)
    [line] = re.findall(r"`(\"voigt\": \"voigt\",)`", page)
    for name in ("models", "data"):
        (tmp_path / name).symlink_to(DOCS.parent / name)
    package = tmp_path / "vsf_drake"
    shutil.copytree(
        DOCS.parent / "vsf_drake", package, ignore=shutil.ignore_patterns("__pycache__")
    )
    (package / "laws" / "voigt.py").write_text(law, encoding="utf-8")
    table = package / "laws" / "contact_laws.py"
    before, after = table.read_text(encoding="utf-8").split("}\n")
    table.write_text(f"{before}    {line}\n}}\n{after}", encoding="utf-8")
    subprocess.run(
        [sys.executable, "-c", WALK_BY_IT],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        check=True,
    )


def test_the_notebook_quotes_the_stored_error_of_the_true_foot():
    """On the walk that it holds out; fitted to the same two walks."""
    case = json.loads(
        (DOCS.parent / "studies" / "results" / "contact_fit.json").read_text(encoding="utf-8")
    )
    fit = case["laboratory"]["transfer"]
    assert fit["fitted"] == ["low_1", "high_1"]
    cells = json.loads((DOCS / "notebooks" / "walk_and_fit.ipynb").read_text(encoding="utf-8"))[
        "cells"
    ]
    text = " ".join("".join("".join(cell["source"]) for cell in cells).split())
    quoted = re.findall(r"\*true\* foot is (\d\.\d) % off", text)
    assert quoted == [f"{100.0 * fit['trials']['medium_1']['floor_grf_rmse_bw']:.1f}"]


@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_tutorial_does_what_it_says(page, tmp_path):
    with matplotlib.rc_context({"backend": "agg"}):
        wrong = tutorial.run(page, tmp_path)
        pyplot.close("all")
    assert not wrong, "\n\n".join(wrong)
    for name in tutorial.pictures(page):
        made, shown = imread(tmp_path / name), imread(page.parent / "pictures" / name)
        assert made.shape == shown.shape, f"run python docs/_ext/tutorial.py {page}"
        assert np.mean(np.abs(made - shown)) < 0.02, (
            f"the picture is another: python docs/_ext/tutorial.py {page}"
        )


def test_every_figure_in_a_tutorial_is_checked():
    """What a block prints is followed by what the reader will see; nothing else is run."""
    assert {path.stem for path in TUTORIALS} == {
        "prosthetist",
        "researcher",
        "roboticist",
        "tester",
    }
    for page in TUTORIALS:
        blocks = tutorial.blocks(page)
        assert {block.language for block in blocks} <= {"python", "bash", "text", "shell"}
        for block, following in zip(blocks, [*blocks[1:], None], strict=True):
            if block.language == "python" and "print(" in block.text:
                assert following is not None and following.language == "text", (
                    f"{page.name}:{block.line}"
                )
        assert any(block.language == "text" for block in blocks)


@pytest.mark.parametrize(
    ("printed", "page", "agrees"),
    [
        ("peak 12.35 N\n", "peak 12.34 N", True),
        ("peak 12.36 N\n", "peak 12.34 N", False),
        ("peak -3 N", "peak 3 N", False),
        (
            "at 66 mm: 10.0 N/mm\nat 151 mm: 32.0 N/mm",
            "at 66 mm:  10.0 N/mm\n  at 151 mm: 32.0 N/mm",
            True,
        ),
        ("name v_3: 7 steps, done", "name v_2: ... done", False),
        ("a table | walk_1 | good | 5\nmore", "... walk_1 ... good ...", True),
        ("2.1e-05 m", "2.0e-05 m", True),
    ],
)
def test_printed_numbers_are_compared_to_their_last_written_digit(printed, page, agrees):
    assert tutorial.same(printed, page) is agrees


def test_blocks_share_a_namespace_and_a_wrong_number_or_a_command_that_fails_is_told(tmp_path):
    page = tmp_path / "page.md"
    blocks = (
        "Text.\n",
        "```python\na = 2\n```\n",
        "```python\nprint(a + 2)\n```\n",
        "```text\n7\n```\n",
    )
    page.write_text("\n".join(blocks), encoding="utf-8")
    (wrong,) = tutorial.run(page, tmp_path)
    assert "page.md:12" in wrong
    page.write_text("```python\n1 / 0\n```\n", encoding="utf-8")
    with pytest.raises(ZeroDivisionError):
        tutorial.run(page, tmp_path)
    page.write_text(
        "```bash\nvsf-drake bench --fulcrum-mm 9000 \\\n    --out x\n```\n", encoding="utf-8"
    )
    with pytest.raises(AssertionError, match="bench --fulcrum-mm 9000 --out x ended with 2"):
        tutorial.run(page, tmp_path)
