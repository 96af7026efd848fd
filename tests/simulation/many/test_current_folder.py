"""Nothing of a downloaded folder runs because a command is called there."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from vsf_drake.simulation.many.processes import ProcessWorkers

HOSTILE = ("signal", "numpy", "vsf_drake", "yaml", "scipy", "numba", "gc", "matplotlib", "usercustomize", "evil")
LOADED = """
import sys
from pathlib import Path
from vsf_drake.cli import main
import vsf_drake.analysis.contact_fit, vsf_drake.report.outputs, vsf_drake.report.style as style
style.save_figure(style.new_figure(1, 1), Path(sys.argv[1], "empty"))
sys.argv = ["vsf-drake", "--version"]
main()
"""


@pytest.fixture
def folder(tmp_path):
    """One in which every file that could be taken for another leaves a mark."""
    place = tmp_path / "downloaded"
    place.mkdir()
    for name in HOSTILE:
        (place / f"{name}.py").write_text(f"open({str(tmp_path / 'marks')!r}, 'a').write('{name} ')", encoding="utf-8")
    (place / "matplotlibrc").write_text("backend: module://evil\ntext.usetex: True\n", encoding="utf-8")
    (place / ".numba_config.yaml").write_text("cache_dir: machine_code\n", encoding="utf-8")
    return place


def marks(folder):
    path = folder.parent / "marks"
    return path.read_text(encoding="utf-8") if path.exists() else ""


@pytest.mark.parametrize("entry", ["", "its name"])
def test_a_worker_imports_nothing_from_the_current_folder_but_what_is_nowhere_else(folder, monkeypatch, entry):
    """As in a notebook, whose path begins with the current folder, and whose own modules lie there."""
    (folder / "own_module_of_a_user.py").write_text("def twice(x):\n    return 2 * x\n", encoding="utf-8")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", [entry and str(folder), *sys.path])
    twice = importlib.import_module("own_module_of_a_user").twice
    with ProcessWorkers(1) as pool:
        assert pool.submit(abs, -1).result() == 1
        assert pool.submit(twice, 2).result() == 4
    assert marks(folder) == ""


def test_a_worker_of_a_checkout_that_is_not_installed_takes_the_same_package(tmp_path, monkeypatch):
    """Its parent has found it in the current folder."""
    import vsf_drake  # noqa: PLC0415

    monkeypatch.chdir(tmp_path)
    (tmp_path / "vsf_drake").mkdir()
    (tmp_path / "vsf_drake" / "__init__.py").write_text("raise SystemExit(3)", encoding="utf-8")
    home = str(vsf_drake.__path__[0]).removesuffix("/vsf_drake")
    monkeypatch.setattr(sys, "path", ["", *(entry for entry in sys.path if entry != home)])
    with ProcessWorkers(1) as pool:
        assert pool.submit(eval, "__import__('vsf_drake').__file__").result() == vsf_drake.__file__


def test_settings_that_lie_in_the_current_folder_run_nothing(folder):
    done = subprocess.run([sys.executable, "-P", "-c", LOADED, folder.parent], cwd=folder, capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert marks(folder) == ""
    assert not (folder / "machine_code").exists()
