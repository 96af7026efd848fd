"""The names at the top of the package: loaded late, the same things as at home, nothing else."""

from __future__ import annotations

import ast
import importlib
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import vsf_drake
from vsf_drake.walks.embedded import embedded_trials


def test_importing_the_package_loads_neither_drake_nor_numpy_and_little_at_all():
    code = (
        "import sys; before = set(sys.modules); import vsf_drake; print(*set(sys.modules) - before)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not [
        name
        for name in loaded
        if name.split(".")[0] in ("pydrake", "numpy", "scipy", "numba", "importlib")
    ]
    assert [name for name in loaded if name.startswith("vsf_drake")] == ["vsf_drake"]


@pytest.mark.parametrize(
    ("words", "without"),
    [
        (
            "import vsf_drake.simulation.walk",
            ("scipy.signal", "scipy.stats", "scipy.ndimage", "matplotlib", "rich", "jinja2.ext"),
        ),
        (
            "from vsf_drake.cli import main; main()",
            ("scipy.signal", "scipy.stats", "scipy.ndimage"),
        ),
    ],
    ids=["a walk", "simulate"],
)
def test_what_takes_long_to_load_and_is_not_needed_is_not_loaded(words, without, tmp_path):
    """scipy.signal loads scipy.stats: together a sixth of a warm `simulate`."""
    code = "import atexit, sys; atexit.register(lambda: print(*sys.modules)); " + words
    trial = embedded_trials("exact")[0]
    done = subprocess.run(
        [sys.executable, "-c", code, "simulate", trial, "--out", tmp_path / "walk"],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = done.stdout.split()
    assert "vsf_drake.simulation.walk" in loaded and not set(without) & set(loaded)


def test_every_name_is_there_described_and_the_one_that_a_type_checker_sees():
    seen = {}
    for node in ast.parse(
        Path(vsf_drake.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    ).body:
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            seen |= {
                alias.asname or alias.name: getattr(module, alias.name) for alias in node.names
            }
    assert (
        sorted(seen) == sorted(vsf_drake.__all__) == sorted(set(dir(vsf_drake)) - {"__version__"})
    )
    for name, value in seen.items():
        assert getattr(vsf_drake, name) is value and value.__doc__ and name in vsf_drake.__doc__
    assert vsf_drake.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="no attribute 'simulate_trail'"):
        _ = vsf_drake.simulate_trail
    page = (Path(__file__).parents[1] / "docs/guide/python.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.+) \|$", page, re.MULTILINE)
    assert sorted(name for name, _ in rows) == sorted(vsf_drake.__all__), "one line each"
    assert "simulate_trial(" in pydoc.plain(pydoc.render_doc(vsf_drake))
