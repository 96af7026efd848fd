"""Machine code that is kept on disk is never older than the sources that it was made from."""

from __future__ import annotations

import ast
import operator
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from vsf_drake.laws import compiled as module
from vsf_drake.laws.compiled import COMPILED, KEPT, compiled, internal

PACKAGE = Path(module.__file__).parents[1]
CALLER = """
from vsf_drake.laws.compiled import compiled
from vsf_drake.laws.contact import force
from vsf_drake.laws.contact_law import LawConstants

@compiled
def pressed(depth):
    site = LawConstants(2e4, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0)
    return force(0, depth, 0.0, site)[0]
"""
PRESSED = """
from vsf_drake.laws.pressed import pressed
print(pressed(0.01), sum(pressed.stats.cache_hits.values()))
"""
EDITED_MEANWHILE = """
import sys
from pathlib import Path
import vsf_drake.laws.compiled
law = Path(sys.argv[1], "laws", "kelvin_voigt.py")
source = law.read_text(encoding="utf-8")
law.write_text(source.replace("= site.stiffness * power", "= 2.0 * site.stiffness * power", 1), encoding="utf-8")
from vsf_drake.laws.pressed import pressed
print(pressed(0.01), 0)
law.write_text(source, encoding="utf-8")
"""  # noqa: E501


def twice(x):
    return 2.0 * x


@pytest.fixture
def package(tmp_path):
    """A copy of the package with one more compiled law, whose callee is in another file."""
    copy = shutil.copytree(
        PACKAGE, tmp_path / "vsf_drake", ignore=shutil.ignore_patterns("__pycache__")
    )
    (copy / "laws" / "pressed.py").write_text(CALLER, encoding="utf-8")
    return copy


def pressed(package, code=PRESSED):
    """The force of 10 mm on 20 N/mm by a new process, and whether its machine code was there
    already."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code, package],
        env=environment | {"PYTHONPATH": str(package.parent)},
        cwd=package.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    force, hits = done.stdout.split()
    return float(force), bool(int(hits))


@pytest.mark.slow
def test_a_changed_callee_in_another_file_changes_the_compiled_caller_of_the_next_process(package):
    # which leaves nothing under the old name
    assert pressed(package, EDITED_MEANWHILE) == (400.0, False)
    assert pressed(package) == (200.0, False)
    assert pressed(package) == (200.0, True)
    law = package / "laws" / "kelvin_voigt.py"
    law.write_text(
        law.read_text(encoding="utf-8").replace(
            "= site.stiffness * power", "= 2.0 * site.stiffness * power", 1
        ),
        encoding="utf-8",
    )
    assert pressed(package) == (400.0, False)
    page = package / "report" / "style.py"
    page.write_text(page.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert pressed(package) == (400.0, True)


def test_every_compiled_function_and_the_constants_in_it_are_under_the_digest():
    covered = [PACKAGE / part for part in COMPILED]
    for file in PACKAGE.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        taken = {node.module: node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        if "vsf_drake.laws.compiled" not in taken or taken["vsf_drake.laws.compiled"].names[
            0
        ].name not in ("compiled", "internal", "generic"):
            continue
        from_outside = [
            PACKAGE.joinpath(*name.split(".")[1:])
            for name, node in taken.items()
            if name.startswith("vsf_drake.")
            and any(alias.name.isupper() or alias.name.islower() for alias in node.names)
        ]
        for path in [
            file,
            *(path if path.is_dir() else path.with_suffix(".py") for path in from_outside),
        ]:
            assert any(path == part or part in path.parents for part in covered), (
                f"{file} takes from {path}"
            )


def test_states_of_the_sources_that_nobody_uses_any_more_are_removed(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    current = Path(module._folder())
    for age in range(KEPT + 2):
        old = current.with_name(f"state_{age}")
        old.mkdir()
        os.utime(old, (2e9 - age,) * 2 if age == 0 else (1e9 - age,) * 2)
    assert module._folder() == str(current)
    assert {path.name for path in current.parent.iterdir()} == {
        current.name,
        *(f"state_{i}" for i in range(KEPT - 1)),
    }


def test_machine_code_that_cannot_be_kept_on_disk_is_made_anew(monkeypatch):
    """As in a container whose package folder and home cannot be written, where numba raises this at
    the import."""
    njit = numba.njit

    def without_a_folder(*function, **options):
        if options.pop("cache", False):
            raise RuntimeError("cannot cache function 'twice': no locator available for file")
        return njit(*function, **options)

    monkeypatch.setattr(numba, "njit", without_a_folder)
    assert compiled(twice)(3.0) == 6.0


@pytest.mark.parametrize(
    ("place", "parent", "lines"),
    [
        ("simulation.stepping.step", None, 1),
        ("systems._foot_kernel", None, 1),
        ("laws.beam", None, 0),
        ("simulation.stepping.step", "a process", 0),
    ],
)
def test_what_takes_long_is_announced_once_and_by_the_command_itself(
    monkeypatch, caplog, place, parent, lines
):
    monkeypatch.setattr(module.multiprocessing, "parent_process", lambda: parent)
    listener = module._Announced()
    for _ in range(2):
        function = SimpleNamespace(py_func=SimpleNamespace(__module__=f"vsf_drake.{place}"))
        listener.on_start(SimpleNamespace(data={"dispatcher": function}))
    assert [record.getMessage() for record in caplog.records] == [
        "compiling once, about 20 s"
    ] * lines


WALKED = """
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker
trial = load_trial(embedded_trials("exact")[0])
walk = Walker(trial.subject, trial.model).walk(
    trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=0.5, end_s=0.51, offsets=trial.offsets,
    with_respect_to=("offset.height", "contact.heel.damping", "keel.flexural_modulus"))
print(*walk.prosthetic.grf_W[-1], *walk.sensitivity.grf_W[-1].ravel())
"""


def test_a_walk_that_a_debugger_steps_through_is_the_compiled_one():
    """NUMBA_DISABLE_JIT leaves the kernels as they were written."""
    forces = []
    for off in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-c", WALKED],
            env=os.environ | {"NUMBA_DISABLE_JIT": off},
            capture_output=True,
            text=True,
            check=True,
        )
        forces.append([float(word) for word in done.stdout.split()])
    assert np.linalg.norm(forces[0]) > 100.0
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


def test_without_a_home_nothing_is_kept_in_the_current_folder(monkeypatch, tmp_path):
    """Machine code from there would be run, and the folder may be a downloaded one; `~` stays `~`
    without a home."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setattr(module.os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(module, "_PACKAGE", Path("/dev/null"))
    monkeypatch.chdir(tmp_path)
    assert module._folder() == ""
    assert list(tmp_path.iterdir()) == []


IN_TURN = """
import sys, time
from numba.core import event
from vsf_drake.laws.pressed import pressed

class Slow(event.Listener):
    def on_start(self, event):
        if event.data["dispatcher"].py_func.__name__ == "pressed":
            print("begins", flush=True)
            time.sleep(1.5)

    def on_end(self, event):
        pass

event.register("numba:compile", Slow())
pressed(0.01)
print(*map(sum, (pressed.stats.cache_misses.values(), pressed.stats.cache_hits.values())))
"""


def test_of_two_processes_that_need_a_function_at_once_one_compiles_and_the_other_waits(package):
    started = [sys.executable, "-c", IN_TURN]
    options = {
        "env": os.environ
        | {"PYTHONPATH": str(package.parent), "NUMBA_CACHE_DIR": str(package.parent / "kept")},
        "cwd": package.parent,
        "stdout": subprocess.PIPE,
        "text": True,
    }
    with subprocess.Popen(started, **options) as first:
        assert first.stdout.readline() == "begins\n"
        with subprocess.Popen(started, **options) as second:
            assert second.communicate()[0] == "0 1\n"
        assert first.communicate()[0] == "1 0\n"


def test_an_inner_function_is_compiled_once_for_all_whole_numbers_and_has_no_code_of_its_own():
    @internal
    def raised(x, n):
        return x + n

    @compiled
    def outer(x):
        return raised(x, 1) * raised(x, 2)

    assert outer(3.0) == 20.0
    assert len(raised.signatures) == 1
    [inside] = [each.library for each in raised.overloads.values()]
    [whole] = [each.library for each in outer.overloads.values()]
    engine = whole.codegen._engine
    assert [engine.is_symbol_defined(each.name) for each in inside.get_defined_functions()] == [
        False
    ]


def test_what_is_remembered_of_types_is_what_numba_finds():
    context = numba.core.registry.cpu_target.typing_context
    ours = module._typing(context)
    real, whole = numba.types.float64, numba.types.int64
    for function, args in (
        (operator.mul, (real, whole)),
        (operator.add, (whole, whole)),
        (operator.truediv, (whole, whole)),
        (operator.getitem, (numba.types.Array(real, 2, "C"), whole)),
    ):
        for _ in range(2):
            assert ours.resolve_function_type(function, args, {}) == (
                context.resolve_function_type(function, args, {})
            )
    with pytest.raises(numba.TypingError):
        ours.resolve_function_type(operator.mul, (real, numba.types.none), {})
