"""Options that are fields of a class: what --help says of them is what stands in the field."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from dataclasses import dataclass
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import option, quantity
from vsf_drake.cli.device import BenchRequest, ExportRequest, ShowRequest, WalkRequest
from vsf_drake.cli.fit import FitRequest
from vsf_drake.cli.options import Asked, PlaceOptions, fields_of, flags, from_fields, made
from vsf_drake.cli.recordings import ImportRequest
from vsf_drake.cli.session import SessionRequest
from vsf_drake.cli.study import StudyRequest
from vsf_drake.cli.sweep import SweepRequest
from vsf_drake.device.stiffness_map.make import DRAWS, standard_axes
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.import_options import ImportOptions
from vsf_drake.motion.manifest import Laboratory
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.optimal_control.stride import StrideOptions
from vsf_drake.simulation.batch import WalkCase
from vsf_drake.simulation.bench import run_bench
from vsf_drake.simulation.options import BenchOptions, StandingOptions, StepOptions
from vsf_drake.simulation.standing import simulate_standing
from vsf_drake.simulation.walk import simulate_trial
from vsf_drake.tuning.common import FreeMotionOptions, GivenMotionOptions
from vsf_drake.tuning.options import TuningOptions
from vsf_drake.validation.options import StudyOptions
from vsf_drake.walks.recorded_walk import walk_trial

MADE_FROM = {
    "fit": (FitRequest, ContactFitOptions),
    "tune": (GivenMotionOptions, FreeMotionOptions),
    "import": (PersonFacts, ImportRequest, Laboratory, ImportOptions),
    "session": (SessionRequest, Laboratory),
    "validate": (StudyRequest, StudyOptions),
    "bench": (BenchRequest,),
    "export": (ExportRequest,),
    "show": (ShowRequest,),
    "stand": (PlaceOptions, StandingOptions),
    "simulate": (WalkRequest,),
    "sweep": (SweepRequest,),
}
WALK = resource("data/reference_subject/exact/low_1.yaml")


@pytest.fixture
def told(run, monkeypatch):
    """By option, what --help of a command says of it."""
    monkeypatch.setenv("COLUMNS", "100")

    def entries(command: str) -> dict[str, str]:
        lines = run(command, "--help")[1].partition("Options:")[2]
        texts = [" ".join(text.split()) for text in re.split(r"\n  (?=--)", lines)]
        return {re.match(r"--[\w-]+", text)[0]: text for text in texts if text}

    return entries


@pytest.mark.parametrize("command", MADE_FROM)
def test_defaults_ranges_and_words_of_help_are_those_of_the_fields(told, command):
    said = told(command)
    for field in fields_of(*MADE_FROM[command]).values():
        text = said.pop(flags(field)[0])
        assert " ".join(field.metadata["help"].split()) in text
        default = re.search(r"\[(?:[^\]]*)default: \(?([^;\])]+)", text)
        if type(field.default) in (str, int, float):
            assert default[1] == str(field.default), text
        elif field.default is True:
            assert f"--{default[1]} / --no-{default[1]} " in text
        else:
            assert (default and default[1]) == field.metadata.get("shown"), text
        reach = re.search(r"(?:(\d+)<=)?x(?:>=(\d+)|<=(\d+))", text)
        low, high = field.metadata.get("low"), field.metadata.get("high")
        if reach:
            assert float(reach[1] or reach[2]) == low and float(reach[3] or "inf") == high, text
        else:
            assert type(field.default) is not int, text


def test_both_levels_of_a_tuning_have_the_defaults_that_its_help_tells():
    for level, schema in ((GivenMotionOptions, TuningOptions), (FreeMotionOptions, StrideOptions)):
        for name, field in fields_of(level).items():
            assert getattr(schema(), name) == getattr(level(), name), flags(field)


def test_functions_have_the_defaults_of_the_classes_from_which_commands_are_made(told):
    def default(function, name):
        return inspect.signature(function).parameters[name].default

    assert default(run_bench, "max_load_n") == BenchOptions.max_load_n
    assert 6e4 * default(run_bench, "speed_m_per_s") == BenchOptions.speed_mm_per_min
    assert default(simulate_standing, "duration_s") == StandingOptions.duration_s
    for function in (simulate_trial, walk_trial, WalkCase):
        assert 1e3 * default(function, "step_s") == StepOptions.step_ms
    axes = standard_axes(ModelParameters().foot)
    grids = {
        name: f"{values[0]:g}:{values[-1]:g}:{len(values)}" if values[1:] else f"{values[0]:g}"
        for name, values in axes.items()
    }
    for option_, value in (
        ("--mass", f"({grids['mass_kg']})"),
        ("--slope", f"({grids['slope_deg']})"),
        ("--fulcrum-mm", f"(the reach, {len(axes['fulcrum_mm'])})"),
        ("--alignment", f"({grids['alignment_deg']})"),
        ("--heel", f"({grids['heel_ratio']})"),
        ("--draws", f"({DRAWS})"),
    ):
        assert f"[default: {value}" in told("map")[option_], option_


# What a command gets.


@dataclass(frozen=True, kw_only=True)
class Cake:
    """A class of options."""

    eggs: int = quantity(3, unit="1", low=1, source="choice", help="How many.")
    heat_deg: float = quantity(
        180.0, unit="deg", low=50.0, high=300.0, source="choice", help="Of the oven.", flag="--heat"
    )
    on_top: tuple[str, ...] = option((), "May be repeated.", metavar="NAME")
    layers: tuple[str, ...] = option(("dough",), "From below.", metavar="NAME,...")
    shares: dict[str, float] | None = option(None, "Of what.", metavar="NAME=NUMBER,...")
    vegan: bool = option(False, "Without eggs.")
    hidden: float = quantity(1.0, unit="1", source="choice")


@pytest.fixture
def baked():
    """Runs a command that is made from `Cake` with words; the cake, and what was given of it."""

    def run_with(*words: str) -> tuple[Cake, Asked]:
        app = typer.Typer()
        seen = []

        @app.command()
        @from_fields
        def command(*, asked: Annotated[Asked, Cake]) -> None:
            seen.append(asked)

        CliRunner().invoke(app, list(words), catch_exceptions=False)
        return made(Cake, seen[0]), seen[0]

    return run_with


def test_a_command_gets_what_was_given_and_the_class_has_the_rest(baked):
    """What is given counts as given where it is the default, too."""
    assert baked() == (Cake(), {})
    cake, given = baked(
        *("--eggs", "3", "--on-top", "a", "--on-top", "b", "--layers", "c, d", "--vegan"),
        *("--shares", "flour=0.5,sugar=1"),
    )
    assert given == {
        "eggs": 3,
        "on_top": ("a", "b"),
        "layers": ("c", "d"),
        "vegan": True,
        "shares": {"flour": 0.5, "sugar": 1.0},
    }
    assert (cake.layers, cake.heat_deg) == (("c", "d"), 180.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--heat", "500"),
            "--heat: 500 deg is outside its physical range. It must be between 50 and 300 deg",
        ),
        (("--heat", "nan"), "--heat: nan is not a finite number"),
        (("--layers", ","), "--layers: names nothing"),
        (("--shares", "flour=x"), "--shares flour: 'x' is not a finite number"),
    ],
)
def test_a_value_that_a_field_cannot_have_is_named_by_its_option(baked, words, said):
    with pytest.raises(InputError) as raised:
        baked(*words)
    assert str(raised.value) == said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fit", WALK, "--time-limit", "0"), "--time-limit: 0 s is outside its physical range"),
        (("fit", WALK, "--starts", "0"), "--starts"),
        # what is given counts as given, though it is the default
        (("fit", WALK, "--strategy", "paper", "--starts", "5"), "--starts: is an option of the"),
        (("tune", WALK, "--level", "2", "--intervals", "5"), "--intervals"),
        (("tune", WALK, "--fulcrum-range", "nan", "100"), "--fulcrum-range"),
        (("simulate", WALK, "--step-ms", "20"), "--step-ms: 20 ms is outside its physical range"),
        (("validate", "--against", "x"), "--against: 'x' is not known. Known are: published"),
        (("import", "a.c3d", "b.c3d", "--mass-kg", "900"), "--mass-kg: 900 kg is outside its"),
        (("import", "a.c3d", "b.c3d", "--sex", "x"), "--sex: 'x' is not known. Known are: male"),
        (("import", "a.c3d", "b.c3d", "--up", "q"), "--up: 'q' is not known. Known are: x, y, z"),
        (("import", "a.c3d", "b.c3d", "--hip", "q"), "--hip: 'q' is not known"),
        (("import", "a.c3d", "b.c3d", "--belt-speed-m-per-s", "9"), "between -5 and 5 m/s"),
    ],
    ids=lambda words: " ".join(map(str, words[2:])) if isinstance(words, tuple) else "",
)
def test_a_bad_value_is_refused_by_the_name_of_its_option(run, tmp_path, words, said):
    code, _, error = run(*words, "--out", tmp_path / "out")
    assert code == 2 and said in error and "Traceback" not in error
    assert not (tmp_path / "out").exists()


def test_help_is_there_without_drake_numba_and_scipy():
    """They take seconds to load, and who has no Drake yet asks for help, too."""
    refuses = (
        "import sys; sys.modules |= dict.fromkeys(('pydrake', 'numba', 'scipy', 'matplotlib'))\n"
        "from vsf_drake.cli import main\n"
        "for words in ([], *([name] for name in sys.argv[1:])):\n"
        "    sys.argv[1:] = [*words, '--help']\n"
        "    try: main()\n"
        "    except SystemExit as ended: assert not ended.code, words\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", refuses, *MADE_FROM], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and done.stdout.count("Usage:") == 1 + len(MADE_FROM), done.stderr
