"""A scenario: which station to build, out of which files, on which ground. Schema only;
`plants.station` builds it.

    kind: leg           # bench, person, or leg: a foot, or several, under any model
    directives:         # Drake's model directives; or `robot`, a file for Drake's Parser
      - add_model: {name: leg, file: package://vsf_drake/leg.urdf}
      - add_weld: {parent: world, child: "leg::hip", X_PC: {translation: [0, 0, 0.84]}}
    feet:
      - {name: vsf, parent_frame: "leg::pylon_end", side: right}
    ground: {patches: [{slope_deg: 5.0}]}
    fulcrum_mm: 108

A file's own paths are relative to its folder, or `package://vsf_drake/...` for what ships with this
package. `load_scenario` reads it; Drake's yaml_load_typed cannot, and `schema` says why.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from vsf_drake.base import errors
from vsf_drake.base.errors import InputError
from vsf_drake.base.files import PACKAGE, user_path
from vsf_drake.base.schema import check, choice, load_yaml, quantity
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.ground import Ground, check_ground, load_ground
from vsf_drake.model.parameters import GRAVITY, SIDES, Subject

KINDS = ("bench", "person", "leg")
# as `plants.foot.CONTACTS`
CONTACTS = (*CONTACT_LAWS, "drake_point", "hydroelastic")
INTEGRATORS = (
    "implicit_euler",
    "radau1",
    "radau3",
    "velocity_implicit_euler",
    "runge_kutta2",
    "runge_kutta3",
    "runge_kutta5",
    "bogacki_shampine3",
    "explicit_euler",
    "semi_explicit_euler",
)
_CHOICE = "a description of the set-up"
_PATHS = ("robot", "model", "contact_file", "subject", "ground")
_KINDS_OF = {
    "heel": ("bench",),
    "subject": ("person",),
    "free": ("person",),
    "robot": ("leg",),
    "directives": ("leg",),
    "feet": ("leg",),
    "guides": ("leg",),
    "gravity_m_per_s2": ("leg",),
    "contact": ("leg",),
    "time_step_s": ("leg",),
    "ground": ("person", "leg"),
}


@dataclass(frozen=True, kw_only=True)
class ScenarioFoot:
    """One foot of a leg. What is None is as in the scenario.

    Its mount is welded to `parent_frame` of the model, `instance::frame` or a name that stands
    once; None: the model has the foot already (package://vsf_drake/vsf_foot.sdf) as the instance
    `name`.
    """

    name: str = "vsf"  # of the foot and its model instance
    parent_frame: str | None = None  # frame of the model to which its mount is welded
    side: str | None = choice(None, options=SIDES, source=_CHOICE)  # body side that the foot is on
    model: str | None = None  # parameter file of this foot
    contact: str | None = choice(None, options=CONTACTS, source=_CHOICE)
    """by which this foot meets the ground"""
    fulcrum_mm: float | None = quantity(  # distance of this foot's fulcrum from A
        None, unit="mm", low=0.0, high=1000.0, source=_CHOICE
    )


@dataclass(frozen=True, kw_only=True)
class ScenarioGuide:
    """A spring and damper that pull a joint of one degree of freedom along the input
    `desired_state`."""

    joint: str  # that is guided, of one degree of freedom
    stiffness: float = quantity(  # of the spring towards the desired position
        unit="N/m or N m/rad", low=0.0, high=1e9, source=_CHOICE
    )
    damping: float = quantity(  # of the damper towards the desired rate
        unit="N s/m or N m s/rad", low=0.0, high=1e9, source=_CHOICE
    )


@dataclass(frozen=True, kw_only=True)
class ScenarioSimulation:
    """How Drake's Simulator is to advance the station's continuous states;
    `Station.simulator_config` passes it on.

    A plant with a time step has none: it goes by its own step.
    """

    integrator: str = choice(  # integration scheme of Drake's Simulator
        "implicit_euler", options=INTEGRATORS, source="choice: the foam is stiff"
    )
    accuracy: float = quantity(1e-3, unit="1", low=1e-12, high=1.0, source=_CHOICE)
    """target accuracy of the integrator"""
    max_step_s: float = quantity(5e-3, unit="s", low=1e-9, high=1.0, source=_CHOICE)
    """longest integration step"""


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that `plants.station.make_station` needs; keys of some kinds only are refused by
    the others."""

    kind: str = choice(options=KINDS, source=_CHOICE)  # of station, which decides the other keys
    name: str = "station"  # of the station's diagram
    model: str | None = None  # parameter file of the devices; None: the nominal ones
    contact_file: str | None = None  # fitted contact to write into them
    fulcrum_mm: float | None = quantity(
        None,
        unit="mm",
        low=0.0,
        high=1000.0,
        source="McGeehan 2021: the middle of five published positions, 108 mm, where left out",
    )
    """where nothing sets the fulcrum's position; a passive foot has none"""
    heel: bool = False  # (bench) press the heel instead of the forefoot
    subject: Subject | str | None = None  # (person) or the file or trial manifest that has them
    free: tuple[str, ...] = ()  # (person) coordinates that are not prescribed
    ground: Ground | str | None = None
    """(person, leg) or the file that has it; None: the plane z = 0"""
    contact: str = choice("kelvin_voigt", options=CONTACTS, source=_CHOICE)
    """(leg) by which feet meet the ground"""
    robot: str | None = None  # (leg) a file for Drake's Parser: URDF, SDF, MJCF, model directives
    directives: tuple[Any, ...] = ()
    """(leg) Drake's; those of `robot`, if it is a file of such, come before"""
    feet: tuple[ScenarioFoot, ...] = ()  # (leg) at least one
    guides: tuple[ScenarioGuide, ...] = ()
    """(leg) joints that follow the input `desired_state`, in its order"""
    gravity_m_per_s2: float = quantity(
        GRAVITY, unit="m/s^2", low=0.0, high=100.0, source="as in Drake"
    )
    """(leg) along -z; a bench is tared and has none, a person has GRAVITY"""
    time_step_s: float = quantity(  # (leg) of the plant; 0 is a continuous one
        0.0, unit="s", low=0.0, high=0.1, source=_CHOICE
    )
    simulation: ScenarioSimulation = field(default_factory=ScenarioSimulation)


def load_scenario(path: str | Path) -> Scenario:
    """Reads and checks a scenario; its paths come back absolute."""
    path = Path(path)
    scenario = load_yaml(path, Scenario)
    paths = {name: _absolute(getattr(scenario, name), path, name) for name in _PATHS}
    feet = tuple(replace(foot, model=_absolute(foot.model, path, "feet")) for foot in scenario.feet)
    return check_scenario(replace(scenario, feet=feet, **paths), file=path)


def check_scenario(scenario: Scenario, *, file: str | Path | None = None) -> Scenario:
    """Returns `scenario` after checking every number, that its keys belong together and that its
    files exist."""
    require = functools.partial(errors.require, file=file)
    check(scenario, file=file)
    for item in fields(Scenario):
        kinds = _KINDS_OF.get(item.name, KINDS)
        require(
            scenario.kind in kinds or getattr(scenario, item.name) in (item.default, ()),
            f"is not for the kind {scenario.kind!r}",
            item.name,
            f"It is for {' and '.join(kinds)}",
        )
    require(
        scenario.kind != "person" or scenario.subject is not None,
        "the key is missing",
        "subject",
        "Give a subject's file or keys (mass_kg, stature_m, sex, ...)",
    )
    if scenario.kind == "leg":
        require(
            scenario.robot or scenario.directives,
            "there is no model",
            "robot",
            "Name a file for Drake's Parser, or give directives",
        )
        require(
            not (scenario.robot and scenario.directives)
            or scenario.robot.endswith((".dmd.yaml", ".dmd.yml")),
            "beside directives it must be a file of directives (.dmd.yaml) itself",
            "robot",
            f"Leave it out and begin with - add_model: {{name: ..., file: {scenario.robot}}}",
        )
        require(
            scenario.feet,
            "there is no foot",
            "feet",
            "Give at least one, such as {name: vsf, parent_frame: leg::shank}",
        )
    for key, names in (
        ("feet", [foot.name for foot in scenario.feet]),
        ("guides", [g.joint for g in scenario.guides]),
    ):
        for i, name in enumerate(names):
            require(
                name not in names[:i],
                f"{name!r} stands twice",
                f"{key}[{i}]",
                "Every one needs a name of its own",
            )
    if isinstance(scenario.ground, Ground):
        check_ground(scenario.ground, file=file)
    named = {name: getattr(scenario, name) for name in _PATHS}
    named |= {f"feet[{i}].model": foot.model for i, foot in enumerate(scenario.feet)}
    for key, value in named.items():
        if isinstance(value, str):
            require(
                "://" not in value or value.startswith(PACKAGE),
                f"{value!r} is in a package that is not known here",
                key,
                f"Give a path, or one below {PACKAGE}",
            )
            require(
                _exists(value),
                f"there is no file {value}",
                key,
                f"Paths are relative to the scenario's folder, or begin with {PACKAGE}",
            )
    return scenario


def _exists(value: str) -> bool:
    try:
        return user_path(value).is_file()
    except InputError:
        return False


def scenario_ground(scenario: Scenario) -> Ground | None:
    """The ground, read where it is a file."""
    return (
        load_ground(user_path(scenario.ground))
        if isinstance(scenario.ground, str)
        else scenario.ground
    )


def _absolute(value: Any, path: Path, key: str) -> Any:
    if not isinstance(value, str) or "://" in value:
        return value
    return str(
        user_path(
            path.parent / user_path(value, file=path, where=key), file=path, where=key
        ).resolve()
    )
