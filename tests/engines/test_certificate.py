"""The certificate: engines that read the exported files agree, and a wrong file is found out."""

from __future__ import annotations

import dataclasses
import re
import shutil
import sys
import tomllib
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from made_condensed import MADE_ERROR

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import read_npz
from vsf_drake.engines.certificate import run as certificate
from vsf_drake.engines.certificate.ask import questions, write_full
from vsf_drake.engines.certificate.asked import NOMINAL, Asked, foot_file
from vsf_drake.engines.certificate.in_stepper import small_rises
from vsf_drake.engines.certificate.rows import (
    AGREES,
    DIFFERS,
    FAILED,
    NOT_RUN,
    REPORTED,
    ROWS,
    agree,
    judged,
)
from vsf_drake.engines.certificate.run import (
    ENGINES,
    REFERENCE,
    Ran,
    answer_of,
    certify,
    judge,
    run,
)
from vsf_drake.model.parameters import FootParameters

STATIC = ("keel_rise", "mass_matrix", "gravity", "beam")
SHORT = 4
"""Instants of the roll-over that are asked where only static rows are looked at."""
FORMATS = {"drake": "sdf", "mujoco": "xml", "opensim": "osim"}
STIFFNESS = {
    "drake": r'(<joint name="keel_3".*?<spring_stiffness>)([\d.]+)',
    "mujoco": r'(<joint name="keel_3"[^>]* stiffness=")([\d.]+)',
    "opensim": r'(name="spring_keel_3">.*?<stiffness>)([\d.]+)',
}
SIGN = {
    "drake": r'(<joint name="keel_3".*?<xyz>0 )(-1)',
    "mujoco": r'(<joint name="keel_3" axis="0 )(-1)',
    "opensim": r'(<Body name="keel_body_3">.*?<mass_center>)([\d.]+)',
}
JOINT = {"drake": "<joint name=", "mujoco": "<joint name=", "opensim": "<Coordinate name="}


def optional(name):
    """An engine, left out where it is not installed."""
    return pytest.param(
        name,
        marks=pytest.mark.skipif(not find_spec(name), reason=f"{name} is not installed"),
    )


CHANGED = [
    "drake",
    optional("mujoco"),
    pytest.param("opensim", marks=[*optional("opensim").marks, pytest.mark.slow]),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What is asked of the nominal foot, but for most of the roll-over and the condensed foot."""
    folder = tmp_path_factory.mktemp("asked")
    asked = questions(FootParameters())
    write_full(folder, FootParameters())
    dataclasses.replace(asked, time_s=asked.time_s[:SHORT], mount=asked.mount[:SHORT]).write(folder)
    return folder


@pytest.fixture(scope="module")
def own(folder):
    """This package's answers."""
    ran, answers = answer_of(folder, ENGINES[REFERENCE])
    assert ran.status == "", ran.why
    return answers


def static_rows(folder, own, name):
    """Rows of an engine that are judged and do not move the foot, by name. Drake and MuJoCo, which
    are here already, are asked in this process."""
    if name in ("drake", "mujoco"):
        import_module(f"vsf_drake.engines.certificate.in_{name}").answer(folder)
        ran = Ran(name=name, label=name, status="", version="", why="")
        answers = read_npz(folder / f"{name}.npz")
    else:
        ran, answers = answer_of(folder, ENGINES[name])
    assert ran.status != NOT_RUN, ran.why
    rows = judge({name: ran}, {name: answers, REFERENCE: own})
    return {row.row: row for row in rows if row.row in STATIC}


@pytest.mark.parametrize("name", ["drake", *map(optional, ("mujoco", "opensim", "exudyn"))])
def test_static_rows_agree(folder, own, name):
    rows = static_rows(folder, own, name)
    assert rows
    assert {row.verdict for row in rows.values()} == {AGREES}, rows


def changed(folder, tmp_path, name, change):
    """A copy of what is asked in which `change` has been made to the engine's file at 108 mm."""
    copy = tmp_path / "changed"
    shutil.copytree(folder, copy)
    file = foot_file(copy, NOMINAL, 108.0, FORMATS[name])
    text = file.read_text(encoding="utf-8")
    written = change(text)
    assert written != text
    file.write_text(written, encoding="utf-8")
    return copy


@pytest.mark.parametrize("name", CHANGED)
def test_one_per_cent_of_one_spring_is_found_in_the_rise(folder, own, tmp_path, name):
    def stiffer(text):
        return re.sub(
            STIFFNESS[name], lambda m: f"{m[1]}{1.01 * float(m[2]):.12g}", text, flags=re.DOTALL
        )

    rows = static_rows(changed(folder, tmp_path, name, stiffer), own, name)
    assert rows["keel_rise"].verdict == DIFFERS
    assert 1e-4 < rows["keel_rise"].difference < 1e-2
    assert rows["mass_matrix"].verdict == rows["gravity"].verdict == AGREES


@pytest.mark.parametrize("name", CHANGED)
def test_a_flipped_sign_is_found_in_mass_matrix_and_gravity(folder, own, tmp_path, name):
    def flipped(text):
        return re.sub(
            SIGN[name], lambda m: f"{m[1]}{-float(m[2]):.12g}", text, count=1, flags=re.DOTALL
        )

    rows = static_rows(changed(folder, tmp_path, name, flipped), own, name)
    assert rows["mass_matrix"].verdict == rows["gravity"].verdict == DIFFERS


@pytest.mark.parametrize("name", CHANGED)
def test_two_exchanged_joints_are_found_in_mass_matrix_and_gravity(folder, own, tmp_path, name):
    def exchanged(text):
        other = {"keel_1": "keel_2", "keel_2": "keel_1"}
        return re.sub(rf'({JOINT[name]}")(keel_[12])(?=")', lambda m: m[1] + other[m[2]], text)

    rows = static_rows(changed(folder, tmp_path, name, exchanged), own, name)
    assert rows["mass_matrix"].verdict == rows["gravity"].verdict == DIFFERS


def test_the_closed_form_is_the_keels_at_small_angles_but_for_its_elements(folder, own):
    """A keel of 32 elements under 100 N, with the fulcrum at 151 mm: the rise is 1.4 mm."""
    small = small_rises(Asked.read(folder))
    np.testing.assert_allclose(small, own["rise_small_m"], rtol=1e-15)
    assert small[-1, 0] == pytest.approx(own["rise_fine_m"][-1, 0], rel=5e-3)


def engine(**changed):
    return dataclasses.replace(ENGINES["drake"], **changed)


def test_an_engine_that_is_not_installed_has_not_run_and_passes_nothing(folder, own):
    ran, answers = answer_of(folder, engine(package="no-such-engine"))
    assert ran.status == NOT_RUN
    assert "no-such-engine is not installed: pip install" in ran.why
    rows = judge({"drake": ran}, {"drake": answers, REFERENCE: own})
    assert {row.verdict for row in rows} == {NOT_RUN}
    assert all(row.difference is None and row.met for row in rows)
    assert not agree(rows)


def test_an_engine_that_is_too_old_has_not_run_and_is_named_with_its_version(folder):
    ran, _ = answer_of(folder, engine(least="999.1"))
    assert ran.status == NOT_RUN
    assert re.search(r"drake is of version 1\.[\d.]+: pip install .* brings 999.1", ran.why)


def test_the_oldest_versions_are_those_that_the_package_asks_for():
    file = Path(__file__).parents[2] / "pyproject.toml"
    project = tomllib.loads(file.read_text(encoding="utf-8"))["project"]
    groups = project["optional-dependencies"].values()
    asked_for = [*project["dependencies"], *(line for group in groups for line in group)]
    for each in ENGINES.values():
        oldest = re.compile(rf"{each.package}>={re.escape(each.least)}(?![\d.])")
        assert each.name == REFERENCE or any(map(oldest.match, asked_for)), each


def test_an_engine_that_breaks_off_has_failed_and_says_why(tmp_path, own):
    ran, answers = answer_of(tmp_path, ENGINES["drake"])
    assert ran.status == FAILED
    assert "asked.npz" in ran.why
    rows = judge({"drake": ran}, {"drake": answers, REFERENCE: own})
    assert not any(row.met for row in rows)
    assert not agree(rows)


RISE = next(row for row in ROWS if row.row == "keel_rise" and row.engine == "drake")
FORE_AFT = next(row for row in ROWS if row.row == "roll_own_fore_aft")


@pytest.mark.parametrize(
    ("answer", "verdict"),
    [
        ([1.0, 2.0], AGREES),
        ([1.0, 2.0 + 1e-6], AGREES),
        ([1.0, 2.0 + 3e-6], DIFFERS),
        ([1.0, np.nan], DIFFERS),
        ([1.0], FAILED),
        (None, FAILED),
    ],
)
def test_a_row_agrees_only_with_every_number_there_and_near(answer, verdict):
    answers = {} if answer is None else {"rise_m": np.array(answer)}
    row = judged(RISE, "", answers, {"rise_m": np.array([1.0, 2.0])})
    assert row.verdict == verdict
    assert agree([row]) == (verdict == AGREES)


def test_rest_at_a_step_of_two_milliseconds_is_not_asked_of_drake():
    row = next(row for row in ROWS if row.row == "rest" and row.engine == "steady_drake")
    own = {row.against: np.ones((3, 2))}
    unsteady = np.array([[1.0, 1.0], [1.0, 1.0], [1.0, np.nan]])
    assert judged(row, "", {row.answer: unsteady}, own).verdict == AGREES
    assert judged(row, "", {row.answer: unsteady[::-1]}, own).verdict == DIFFERS


def test_a_row_without_a_number_that_is_asked_is_reported():
    own = {FORE_AFT.against: np.array([1.0, 2.0])}
    row = judged(FORE_AFT, "", {FORE_AFT.answer: np.array([0.0, 3.0])}, own)
    assert row.verdict == REPORTED
    assert row.difference == 0.5


def test_an_engine_that_nobody_knows_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match=r"'simbody' is no engine.*opensim, mujoco"):
        certify(FootParameters(), engines=["simbody"])


def test_an_engine_that_must_be_there_and_is_not_is_refused(monkeypatch):
    monkeypatch.setitem(ENGINES, "mujoco", engine(name="mujoco", package="no-such-engine"))
    with pytest.raises(InputError, match="mujoco: no-such-engine is not installed"):
        certify(FootParameters(), engines=["mujoco"])


def test_an_engine_that_is_named_is_asked_all_that_its_package_is_asked(monkeypatch):
    asked = []

    def noted(folder, engines, progress):
        asked.extend(each.name for each in engines)
        raise InterruptedError

    monkeypatch.setattr(certificate, "ask", lambda folder, parameters: (None, MADE_ERROR))
    monkeypatch.setattr(certificate, "run", noted)
    with pytest.raises(InterruptedError):
        certify(FootParameters(), engines=["drake"])
    assert asked == [REFERENCE, "drake", "steady_drake"]


def test_who_runs_this_python_runs_the_engines_with_it(folder, monkeypatch):
    asked = []

    def noted(words, **more):
        asked.append(words)
        raise certificate.subprocess.TimeoutExpired(words, 1.0)

    monkeypatch.setattr(certificate.subprocess, "run", noted)
    ran, _ = run(folder, [ENGINES["drake"]])
    assert asked == [
        [sys.executable, "-m", "vsf_drake.engines.certificate.in_drake", str(Path(folder))]
    ]
    assert ran["drake"].status == FAILED
    assert "no answer after" in ran["drake"].why


@pytest.mark.slow
def test_all_engines_agree():
    found = certify(FootParameters())
    wrong = [row for row in found.rows if not row.met]
    assert not wrong, wrong
    assert found.agreed


def test_a_keel_that_thins_has_no_uniform_beam_beside_it_and_is_refused():
    foot = FootParameters()
    thins = dataclasses.replace(foot, keel=dataclasses.replace(foot.keel, tip_stiffness=0.5))
    with pytest.raises(InputError, match=r"foot\.keel\.tip_stiffness: the keel thins"):
        questions(thins)
