"""From the parameters of a fit to the variables of one trial's walk, and the derivatives of these by those."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.contact_fit.parameters import (
    CURVE,
    DAMPING_TIME,
    HEIGHT,
    LAW,
    PATH,
    PATH_COEFFICIENTS,
    REFERENCE_DEPTH_M,
    FitParameters,
    curve_coefficients,
    meanings,
    zones_of,
)
from vsf_drake.errors import InputError
from vsf_drake.motion.gait_cycle import gait_phase
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines
from vsf_drake.motion.trial_record import Trial
from vsf_drake.simulation.variables import Course, Variable

OFFSET_HEIGHT = "offset.height"


@dataclass(frozen=True)
class WalkValues:
    """What one walk takes, at one point of the search.

    Attributes:
        values: of the walk's variables, by name.
        names: the Q variables that free parameters change.
        by: (Q, P) derivatives of those by the free parameters' search coordinates.
    """

    values: dict[str, float]
    names: tuple[str, ...]
    by: np.ndarray


class TrialMap:
    """The parameters' part in one trial.

    Heights of trials enter as deviations from their mean: what they have in common is the height of the prosthesis, and
    shall not be lost where a trial has none of its own.

    Args:
        parameters: of the fit. variables: of the walker.
        label: of the trial, as parameters of its own name it; None for a trial that has none.
        trial: the recording; None for what is not walked, which then has no courses.

    Attributes:
        courses: that the walk takes, one for each curve or path parameter.

    Raises:
        InputError: a parameter means nothing to this walker, or has the form of none.
    """

    def __init__(
        self, parameters: FitParameters, variables: Mapping[str, Variable], label: str | None, trial: Trial | None
    ) -> None:
        self.parameters = parameters
        self._label, self._means = label, meanings(parameters.by_name, variables)
        self._heights = sum(mean.kind == HEIGHT for mean in self._means.values())
        self._laws = [zone for zone in zones_of(variables) if f"contact.{zone}.force" in parameters.by_name]
        self._known = {name: self._target(name) for name in parameters.by_name}
        self.courses = () if trial is None else _courses(self._known, trial, curve_coefficients(parameters.by_name))

    def at(self, u: np.ndarray) -> WalkValues:
        """The walk's values at u (P,)."""
        values = self.parameters.values(u)
        walk = self._walk(values)
        by: dict[str, np.ndarray] = {}
        slopes = self.parameters.slopes(u)
        for p, name in enumerate(self.parameters.names):
            for variable, slope in self._slopes(name, values):
                by.setdefault(variable, np.zeros(len(self.parameters)))[p] += slope * slopes[p]
        names = tuple(by)
        return WalkValues(values=walk, names=names,
                          by=np.array([by[name] for name in names]).reshape(len(names), len(self.parameters)))

    def _target(self, name: str) -> str | None:
        """The variable that a parameter sets; "" for those of a law, None for another trial's path."""
        mean = self._means[name]
        if mean.kind == LAW:
            return ""
        if mean.kind == HEIGHT:
            return OFFSET_HEIGHT if self._label is not None else None
        if mean.kind == PATH and mean.owner != self._label:
            return None
        return f"course.{mean.course}" if mean.course else name

    def _walk(self, values: Mapping[str, float]) -> dict[str, float]:
        walk: dict[str, float] = {}
        for name, value in values.items():
            target = self._known[name]
            if target:
                walk[target] = walk.get(target, 0.0) + self._share(name) * value
        for zone in self._laws:
            force, n, time = self._law(zone, values)
            walk[f"contact.{zone}.stiffness"] = force / REFERENCE_DEPTH_M**n
            walk[f"contact.{zone}.exponent"] = n
            walk[f"contact.{zone}.damping"] = time * n * force / REFERENCE_DEPTH_M
        return walk

    def _share(self, name: str) -> float:
        """What a parameter counts for in its variable: 1, but heights of trials are deviations from their mean."""
        mean = self._means[name]
        return 1.0 if mean.kind != HEIGHT else float(mean.owner == self._label) - 1.0 / self._heights

    def _law(self, zone: str, values: Mapping[str, float]) -> tuple[float, float, float]:
        """Force (N), exponent and damping time (s) of a zone."""
        own = f"contact.{zone}."
        return (values[f"{own}force"], values[f"{own}exponent"],
                values.get(f"{own}damping_time", values.get(DAMPING_TIME, 0.0)))

    def _slopes(self, name: str, values: Mapping[str, float]) -> list[tuple[str, float]]:
        """Variables that a parameter changes, with d variable / d parameter."""
        target = self._known[name]
        if target is None:
            return []
        if target:
            return [(target, self._share(name))]
        kind = name.rsplit(".", maxsplit=1)[-1]
        zones = self._laws if name == DAMPING_TIME else [self._means[name].owner]
        found: list[tuple[str, float]] = []
        for zone in zones:
            if name == DAMPING_TIME and f"contact.{zone}.damping_time" in values:
                continue
            force, n, time = self._law(zone, values)
            k, b = force / REFERENCE_DEPTH_M**n, time * n * force / REFERENCE_DEPTH_M
            stiffness, damping = f"contact.{zone}.stiffness", f"contact.{zone}.damping"
            if kind == "force":
                found += [(stiffness, k / force), (damping, b / force)]
            elif kind == "exponent":
                found += [(stiffness, -k * np.log(REFERENCE_DEPTH_M)), (f"contact.{zone}.exponent", 1.0),
                          (damping, b / n)]
            else:
                found.append((damping, b / time))
        return found


class _Sampled:
    """A family of functions of time, worked out once for each of the few grids of times that walks have."""

    def __init__(self, family: Callable[[np.ndarray], np.ndarray]) -> None:
        self._known = functools.lru_cache(maxsize=8)(lambda times: family(np.frombuffer(times)))

    def member(self, i: int) -> Callable[[np.ndarray], np.ndarray]:
        return lambda times: self._known(np.ascontiguousarray(times, dtype=float).tobytes())[:, i]


def _courses(known: Mapping[str, str | None], trial: Trial, coefficients: int) -> tuple[Course, ...]:
    found: list[Course] = []
    families: dict[str, _Sampled] = {}
    for target in dict.fromkeys(target for target in known.values() if target and target.startswith("course.")):
        name = target.removeprefix("course.")
        kind, coordinate, index = name.rsplit(".", 2)
        if kind not in families:
            families[kind] = _Sampled(_curves(trial, coefficients) if kind == CURVE else
                                      window_bsplines(trial.start_s, trial.end_s, PATH_COEFFICIENTS))
        if kind == PATH and int(index) >= PATH_COEFFICIENTS:
            raise InputError(f"{name} is beyond the {PATH_COEFFICIENTS} coefficients of a path", where="parameters")
        found.append(Course(name=name, coordinate=coordinate, shape=families[kind].member(int(index))))
    return tuple(found)


def _curves(trial: Trial, coefficients: int) -> Callable[[np.ndarray], np.ndarray]:
    phase, basis = gait_phase(trial), periodic_bsplines(coefficients)
    return lambda times: basis(phase(times))
