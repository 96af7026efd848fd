"""`vsf-drake doctor` says what is installed, and does not call a broken installation sound."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
from types import SimpleNamespace

import pydrake.solvers
from command_line import exit_code

import vsf_drake.simulation.bench
from vsf_drake.base.errors import SimulationError
from vsf_drake.laws.compiled import kept_code


def test_versions_solvers_and_compiled_code_are_told_and_the_foot_has_its_stiffness(capsys):
    assert exit_code("doctor") == 0
    said = capsys.readouterr().out
    for name in ("drake", "numpy", "numba"):
        assert f"{name} {importlib.metadata.version(name)}" in said.lower()
    assert (
        all(name in said for name in ("SNOPT", "Ipopt", "NLopt", "Clarabel"))
        and "MISSING" not in said
    )
    for name in ("opensim", "mujoco", "exudyn"):
        found = [*importlib.metadata.distributions(name=name)]
        there = found[0].version if found else "not installed"
        assert f"{name} {there}" in said and (f"[{name}] lacks {name}" in said) is not found
    kept = kept_code()
    assert kept.current and kept.functions > 0 and f"{kept.functions} functions" in said
    stiffness = float(re.search(r"([\d.]+) N/mm", said)[1])
    assert abs(stiffness - 16.7) < 0.8, "the tuned joints of the authors' scripts, at 108 mm"


def test_a_missing_solver_and_a_foot_that_does_not_run_end_with_an_error(capsys, monkeypatch):
    def refused(*_, **__):
        raise SimulationError("the keel gave way", time_s=0.1)

    own = pydrake.solvers.IpoptSolver.id
    with monkeypatch.context() as patch:
        patch.setattr(
            pydrake.solvers,
            "IpoptSolver",
            lambda: SimpleNamespace(solver_id=own, available=lambda: False),
        )
        assert exit_code("doctor") == SimulationError.exit_code
    assert "Ipopt MISSING" in capsys.readouterr().out
    monkeypatch.setattr(vsf_drake.simulation.bench, "run_bench", refused)
    assert exit_code("doctor") == SimulationError.exit_code
    seen = capsys.readouterr()
    assert "FAILED" in seen.out and "the keel gave way" in seen.err


def test_a_module_in_the_place_of_drake_is_found_out_without_a_traceback(tmp_path):
    """Of a new process: in this one Drake is loaded."""
    (tmp_path / "pydrake").mkdir()
    (tmp_path / "pydrake/__init__.py").write_text(
        "raise OSError('libdrake.so: cannot open shared object file')"
    )
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, "-c", "from vsf_drake.cli import main; main()", "doctor"],
        text=True,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        check=False,
    )
    assert done.returncode == SimulationError.exit_code
    assert (
        done.stderr
        == "error: Drake cannot be imported: OSError: libdrake.so: cannot open shared object file\n"
    )
    assert str(tmp_path / "pydrake/__init__.py") in done.stdout and "PYTHONPATH" in done.stdout


def test_a_command_without_drake_says_so_and_leads_to_doctor(tmp_path):
    (tmp_path / "pydrake").mkdir()
    (tmp_path / "pydrake/__init__.py").write_text("raise ImportError('no libdrake.so')")
    found = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", "from vsf_drake.cli import main; main()", "bench", "--out", "bench"],
        check=False,
        text=True,
        capture_output=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": found},
    )
    assert done.returncode == SimulationError.exit_code and "Traceback" not in done.stderr
    assert "Drake cannot be imported" in done.stderr and "vsf-drake doctor" in " ".join(
        done.stderr.split()
    )
    assert not (tmp_path / "bench").exists()


def test_a_drake_of_its_own_that_is_broken_is_to_be_installed_again(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pydrake.solvers", None)
    assert exit_code("doctor") == SimulationError.exit_code
    seen = capsys.readouterr()
    assert "Drake cannot be imported" in seen.err and "PYTHONPATH" not in seen.out
    needed = re.search(r'--force-reinstall\s+"(drake[^"]+)"', seen.out)[1]
    assert {"<1.59", ">=1.51.1"} == set(needed.removeprefix("drake").split(","))
