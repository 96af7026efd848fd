"""What a contact fit changes: named numbers with bounds, prior and a frozen flag, and the
coordinates it searches in.

The search runs in prior standard deviations: u = (g(value) - g(mean)) / scale with g the identity,
or the logarithm for numbers that span orders of magnitude. So a unit step is as likely in every
direction, the prior is the length of u, and the singular values of a Jacobian by u say how much
more the data know than the prior.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import SIDES
from vsf_drake.motion.fitted_trial import gait_phase
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.variables import MotionPerturbation, Variable, check_number

PATH_COORDINATES = ("pelvis_tx", "pelvis_tz")
DAMPING_TIME = "contact.damping_time"
OFFSET_HEIGHT = "offset.height"
KINETIC_SHARE = "friction.kinetic_share"
MU_STATIC = "friction.mu_static"
MU_KINETIC = "friction.mu_kinetic"
OF_TRIAL = re.compile(
    rf"trial\.(?P<label>.+)\.(?:(?P<height>height)|(?P<slow>path\.(?:{'|'.join(PATH_COORDINATES)})"
    r"\.\d+|curve\.[^.]+\.\d+))"
)
_CURVE = re.compile(r"curve\.([^.]+)\.(\d+)")
_LAW = re.compile(r"contact\.([^.]+)\.(force|exponent|damping_time)")


@dataclass(frozen=True, kw_only=True)
class FitParameter:
    """One number of a fit, with a prior, and between two bounds as mean and start are; see
    `standard_parameters`."""

    name: str
    unit: str
    start: float  # where the first search begins, and the value of a frozen parameter
    low: float
    high: float
    mean: float  # centre of the prior
    scale: float  # standard deviation of the prior; of the value's logarithm if `logarithmic`
    prior: bool = True  # the prior is a residual; without it, `scale` only scales the search
    frozen: bool = False
    logarithmic: bool = False  # the search runs in the logarithm of the value
    why: str = ""  # bounds and prior are so

    def __post_init__(self) -> None:
        where = f"parameter {self.name}"
        for name in ("start", "low", "high", "mean", "scale"):
            check_number(getattr(self, name), f"{where}: {name}")
        bounds = f"{self.low:g} to {self.high:g} {self.unit}"
        if not self.low < self.high:
            raise InputError(
                f"its bounds {bounds} cross", where=where, right="Give the lower one first"
            )
        if self.logarithmic and self.low <= 0.0:
            raise InputError(
                f"its bounds are {bounds}", where=where, right="The search is in logarithms"
            )
        for name in ("start", "mean"):
            if not self.low <= getattr(self, name) <= self.high:
                raise InputError(
                    f"its {name}, {getattr(self, name):g}, lies outside its bounds {bounds}",
                    where=where,
                )
        if self.scale <= 0.0:
            raise InputError(
                f"its scale is {self.scale:g}", where=where, right="It must be above 0"
            )

    def to_u(self, value: float) -> float:
        """The search coordinate of a value."""
        if self.logarithmic:
            return math.log(value / self.mean) / self.scale
        return (value - self.mean) / self.scale

    def from_u(self, u: float) -> float:
        """The value at a search coordinate, within the bounds."""
        value = (
            self.mean * math.exp(u * self.scale) if self.logarithmic else self.mean + u * self.scale
        )
        return min(max(value, self.low), self.high)


class FitParameters:
    """An ordered set of parameters, at least one of them free; u (P,) are the search coordinates of
    the free ones."""

    def __init__(self, items: Iterable[FitParameter]) -> None:
        self.items = tuple(items)
        self.by_name: dict[str, FitParameter] = {}
        for item in self.items:
            if item.name in self.by_name:
                raise InputError(f"the parameter {item.name} stands twice", where="parameters")
            self.by_name[item.name] = item
        self.free = tuple(item for item in self.items if not item.frozen)
        if not self.free:
            raise InputError(
                "all parameters are frozen", where="parameters", right="Free at least one"
            )
        self.names = tuple(item.name for item in self.free)

    def __len__(self) -> int:
        return len(self.free)

    def changed(self, names: Sequence[str], **fields: object) -> FitParameters:
        """The set with `fields` of these parameters replaced, e.g. `changed(["friction.mu_static"],
        frozen=False)`."""
        for name in names:
            if name not in self.by_name:
                raise InputError(
                    f"there is no parameter {name!r}",
                    where="parameters",
                    right=f"There are: {', '.join(self.by_name)}",
                )
        return FitParameters(
            dataclasses.replace(item, **fields) if item.name in names else item  # type: ignore[arg-type]
            for item in self.items
        )

    def with_held(self) -> FitParameters:
        """The free ones in their order, and then, free too, the frozen ones that have a prior."""
        return FitParameters(
            [
                *self.free,
                *(
                    dataclasses.replace(item, frozen=not item.prior)
                    for item in self.items
                    if item.frozen
                ),
            ]
        )

    @property
    def start(self) -> np.ndarray:
        """(P,) u where the first search begins."""
        return np.array([item.to_u(item.start) for item in self.free])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest u, (P,) each."""
        return (
            np.array([item.to_u(item.low) for item in self.free]),
            np.array([item.to_u(item.high) for item in self.free]),
        )

    def values(self, u: np.ndarray) -> dict[str, float]:
        """All values by name, the frozen ones too, at u (P,)."""
        if np.shape(u) != (len(self.free),):
            raise ValueError(
                f"u has shape {np.shape(u)}, but there are {len(self.free)} free parameters"
            )
        own = dict(zip(self.names, map(float, u), strict=True))
        return {
            item.name: item.from_u(own[item.name]) if item.name in own else item.start
            for item in self.items
        }

    def u(self, values: Mapping[str, float]) -> np.ndarray:
        """(P,) search coordinates of the values of the free parameters, moved to the bounds where
        they lie outside."""
        return np.array(
            [item.to_u(min(max(values[item.name], item.low), item.high)) for item in self.free]
        )

    def slopes(self, u: np.ndarray) -> np.ndarray:
        """(P,) d value / d u."""
        values = self.values(u)
        return np.array(
            [
                values[item.name] * item.scale if item.logarithmic else item.scale
                for item in self.free
            ]
        )


def zones_of(variables: Iterable[str]) -> list[str]:
    """Zones of the foot whose walk has these variables."""
    return [
        name.split(".")[1]
        for name in variables
        if name.startswith("contact.") and name.endswith(".stiffness")
    ]


def owner(name: str) -> str | None:
    """The label of the trial that a parameter belongs to alone, or None."""
    match = OF_TRIAL.fullmatch(name)
    return match["label"] if match else None


# The parameters that a contact fit starts from.
#
#     contact.ZONE.force        N, load of one sphere of the zone at REFERENCE_DEPTH
#     contact.ZONE.exponent     of its law
#     contact.damping_time      s, damping of all zones over the slope of their law at
#                               REFERENCE_DEPTH
#     contact.ZONE.rise         m, of the zone's spheres
#     offset.height | fore_aft | alignment | inversion | toe_out      of the foot under the pylon,
#                                                                     in all trials
#     coordinate.NAME           rad, error of a joint angle that all trials share
#     curve.NAME.i              rad, smooth error over the gait cycle that all trials share
#     socket.AXIS.stiffness     of the bushing
#     trial.LABEL.height        m, of one recording alone; its deviation from the mean of all is
#                               what is added
#     trial.LABEL.curve.NAME.i  rad, slow error of a joint angle in one recording alone
#     trial.LABEL.path.NAME.i   m, slow correction of the pelvis's path in one recording alone
#     friction.mu_static | threshold_velocity, friction.kinetic_share     kinetic over static
#                                                                         friction, at most 1
#     keel.flexural_modulus, fulcrum.stiffness     free where there is a bench
#     contact.ZONE.full_damping_depth     frozen
#
# A law's stiffness in N/m^exponent and its exponent cannot be told apart by what a foot carries; a
# force at a depth that it reaches, and the exponent, can. Prior widths are choices unless a source
# is given with them.

REFERENCE_DEPTH_M = 9e-3
"""To which the bench's 600 N presses the nominal foot: 600 N / 65 N/mm at the heel, / 59 N/mm at
the forefoot."""
SLOW = ("hip_flexion", "knee_angle")
"""Joint angles of the prosthetic side whose errors in one trial alone are fitted: those that move
the foot in the sagittal plane."""
CONSTANT_DEG = {
    "hip_flexion": (
        2.6,
        "sessions 1.8 (Wilken 2012, pubmed 22041096), skin 1.9 (Fiorentino 2017, "
        "doi 10.1016/j.gaitpost.2017.03.033), as squares",
    ),
    "knee_angle": (2.8, "sessions 1.8 (Wilken 2012), skin 2.1 (Reinschmidt 1997), as squares"),
    "hip_adduction": (
        3.25,
        "between days, largest of the frontal plane (Riazati 2022, doi 10.3389/fnhum.2022.867474)",
    ),
    "hip_rotation": (
        7.0,
        "sessions 4.0 (choice, order of McGinley 2009), skin 5.8 (Fiorentino 2017), as squares",
    ),
}
"""Standard deviations of errors of joint angles that all trials share, and where they are from:
rows of data/published/kinematic_repeatability.csv and soft_tissue_artefact.csv."""
CURVE_DEG = {
    "hip_flexion": (1.9, "skin over the thigh (Fiorentino 2017)"),
    "knee_angle": (2.1, "skin over the shank (Reinschmidt 1997)"),
    "hip_adduction": (0.6, "skin over the thigh (Fiorentino 2017)"),
}
"""Amplitudes of waves over the gait cycle, data/published/soft_tissue_artefact.csv. Coefficients
with such a standard deviation make a curve that is, in the mean over the cycle, as large as a sine
of that amplitude (0.69 of it)."""
SLOW_DEG = 0.5
"""Of each coefficient of a trial's own slow error (a choice): a third of the 1.5 that angles spread
from trial to trial (data/published/kinematic_repeatability.csv), most of which the person walks and
the plate feels."""
CURVE_COEFFICIENTS = 8
SLOW_COEFFICIENTS = 6


def standard_parameters(
    variables: Mapping[str, Variable],
    side: str,
    labels: Sequence[str],
    *,
    bench: bool = False,
    damping_by_zone: bool = False,
    paths: bool = False,
) -> FitParameters:
    """The parameters of the joint fit.

    Args:
        variables: of the walker. side: "right" or "left", the prosthetic one.
        labels: of the trials.
        bench: there is one, which tells the keel's modulus and the support's stiffness.
        damping_by_zone: a damping time for each zone in place of one for all.
        paths: each trial has a slow correction of the pelvis's path.
    """
    if side not in SIDES:
        raise InputError(
            f"{side!r} is no side", where="side", right=f"It must be {' or '.join(SIDES)}"
        )

    def log(
        name: str, unit: str, value: float, scale: float, fold: float, why: str
    ) -> FitParameter:
        return FitParameter(
            name=name,
            unit=unit,
            start=value,
            low=value / fold,
            high=value * fold,
            mean=value,
            scale=scale,
            logarithmic=True,
            why=why,
        )

    def zero(name: str, unit: str, scale: float, reach: float, why: str) -> FitParameter:
        return FitParameter(
            name=name,
            unit=unit,
            start=0.0,
            low=-reach * scale,
            high=reach * scale,
            mean=0.0,
            scale=scale,
            why=why,
        )

    def own(name: str, scale: float, why: str, *, frozen: bool = True) -> FitParameter:
        v = variables[name]
        return FitParameter(
            name=name,
            unit=v.unit,
            start=v.default,
            low=v.low,
            high=v.high,
            mean=v.default,
            scale=scale,
            logarithmic=True,
            frozen=frozen,
            why=why,
        )

    zones = zones_of(variables)
    items = []
    for zone in zones:
        k, n, b = (
            variables[f"contact.{zone}.{name}"].default
            for name in ("stiffness", "exponent", "damping")
        )
        exponent = max(n, 1.2)
        items += [
            log(
                f"contact.{zone}.force",
                "N",
                k * REFERENCE_DEPTH_M**n,
                0.5,
                8,
                "the bench knows the foam under one load point, no more",
            ),
            FitParameter(
                name=f"contact.{zone}.exponent",
                unit="1",
                start=exponent,
                low=1.0,
                high=2.0,
                mean=exponent,
                scale=0.3,
                why="foam hardens; McGeehan 2021 starts from 1",
            ),
            zero(f"contact.{zone}.rise", "m", 4e-3, 4, "the sole is drawn flat; soles are round"),
            own(f"contact.{zone}.full_damping_depth", 0.5, "0.1 % body weight for twice of it"),
        ]
        if damping_by_zone or zone == zones[-1]:
            time = float(b / (k * n * REFERENCE_DEPTH_M ** (n - 1.0)))
            items.append(
                log(
                    f"contact.{zone}.damping_time" if damping_by_zone else DAMPING_TIME,
                    "s",
                    time,
                    0.7,
                    20,
                    "10 % loss a load cycle by default, a choice",
                )
            )
    items += [
        zero(
            "offset.height", "m", 0.01, 4, "length of the prosthesis and of the limb in its socket"
        ),
        zero("offset.fore_aft", "m", 0.01, 4, "where the foot is bolted on"),
        *(
            zero(f"offset.{name}", "rad", math.radians(3.0), 4, "what a prosthetist sets")
            for name in ("alignment", "inversion", "toe_out")
        ),
    ]
    items += [
        zero(f"coordinate.{name}_{side[0]}", "rad", math.radians(sd), 6, why)
        for name, (sd, why) in CONSTANT_DEG.items()
    ]
    items += [
        zero(f"curve.{name}_{side[0]}.{i}", "rad", math.radians(sd), 8, why)
        for name, (sd, why) in CURVE_DEG.items()
        for i in range(CURVE_COEFFICIENTS)
    ]
    items += [
        own(
            f"socket.{axis}.stiffness",
            0.5,
            "measured sockets fix it within a factor of two",
            frozen=axis != "tz",
        )
        for axis in ("tx", "ty", "tz", "flexion", "adduction", "rotation")
    ]
    if len(labels) > 1:
        items += [
            zero(
                f"trial.{label}.height",
                "m",
                2e-3,
                10,
                "calibration of the laboratory from trial to trial",
            )
            for label in labels
        ]
        items += [
            zero(
                f"trial.{label}.curve.{name}_{side[0]}.{i}",
                "rad",
                math.radians(SLOW_DEG),
                8,
                "markers move within a trial",
            )
            for label in labels
            for name in SLOW
            for i in range(SLOW_COEFFICIENTS)
        ]
    if paths:
        items += [
            zero(
                f"trial.{label}.path.{name}.{i}",
                "m",
                1e-3,
                10,
                "a slow drift that no foot could make",
            )
            for label in labels
            for name in PATH_COORDINATES
            for i in range(SLOW_COEFFICIENTS)
        ]
    items += [
        own(
            "keel.flexural_modulus",
            0.2,
            "effective: it stands for what yields in one keel and its anchor",
            frozen=not bench,
        ),
        # a bench's middle positions tell it from the keel
        own("fulcrum.stiffness", 0.6, "a choice: the model's sinks 0.9 mm", frozen=not bench),
    ]
    share = min(variables[MU_KINETIC].default / variables[MU_STATIC].default, 1.0)
    # the paper's coefficients were given, not fitted; a foot that the recording drags along slips
    # at 0.1 to 0.2 m/s
    items += [
        own(MU_STATIC, 0.5, "shoes on floors: 0.3 to 0.8 (a choice)", frozen=False),
        FitParameter(
            name=KINETIC_SHARE,
            unit="1",
            start=share,
            low=0.2,
            high=1.0,
            mean=share,
            scale=0.2,
            why="no more than static friction (a choice)",
        ),
        own(
            "friction.threshold_velocity",
            0.7,
            "a factor of two: a numerical width (a choice)",
            frozen=False,
        ),
    ]
    return FitParameters(items)


# From the parameters to the variables of one trial's walk, and the derivatives of these by those.


@dataclass(frozen=True)
class WalkValues:
    """What one walk takes, at one point of the search: values of its variables, the Q of them that
    free parameters change, and derivatives (Q, P) of those by the search coordinates."""

    values: dict[str, float]
    names: tuple[str, ...]
    by: np.ndarray


class TrialMap:
    """The parameters' part in one trial.

    Heights of trials enter as deviations from their mean: what they have in common is the height of
    the prosthesis, and shall not be lost where a trial has none of its own.

    Args:
        variables: of the walker.
        label: of the trial, as parameters of its own name it; None for a trial that has none.
        trial: the recording; None for what is not walked, which then has no `perturbations`, one
            for each curve or path parameter.
    """

    def __init__(
        self,
        parameters: FitParameters,
        variables: Mapping[str, Variable],
        label: str | None,
        trial: Trial | None,
    ) -> None:
        self.parameters = parameters
        names = parameters.by_name
        self._laws = [zone for zone in zones_of(variables) if f"contact.{zone}.force" in names]
        for own in (f"contact.{zone}." for zone in self._laws):
            if f"{own}exponent" not in names or not {f"{own}damping_time", DAMPING_TIME} & set(
                names
            ):
                raise _refused(
                    f"the law of {own.removesuffix('.')} is told by half",
                    f"With {own}force give {own}exponent, and {own}damping_time or {DAMPING_TIME}; "
                    "they may be frozen",
                )
            for twice in {f"{own}stiffness", f"{own}damping"} & set(names):
                raise _refused(f"{twice} and {own}force set the same", "Give one of them")
        if DAMPING_TIME in names and not self._laws:
            raise _refused(
                f"{DAMPING_TIME} has no law to belong to",
                "Give contact.ZONE.force and contact.ZONE.exponent too",
            )
        if KINETIC_SHARE in names and (MU_STATIC not in names or MU_KINETIC in names):
            raise _refused(
                f"{KINETIC_SHARE} is a share of {MU_STATIC}, and sets {MU_KINETIC}",
                f"Give {MU_STATIC} with it, which may be frozen, and not {MU_KINETIC}",
            )
        coefficients = curve_coefficients(names)
        self._targets = {name: self._target(name, label, variables) for name in names}
        self.perturbations = (
            ()
            if trial is None
            else _perturbations(
                [target[0] for target in self._targets.values() if target], trial, coefficients
            )
        )

    def at(self, u: np.ndarray) -> WalkValues:
        """The walk's values at u (P,)."""
        values = self.parameters.values(u)
        slopes = self.parameters.slopes(u)
        free = {name: p for p, name in enumerate(self.parameters.names)}
        walk: dict[str, float] = {}
        by: dict[str, np.ndarray] = {}

        def depends(variable: str, name: str, slope: float) -> None:
            if name in free:
                by.setdefault(variable, np.zeros(len(free)))[free[name]] += (
                    slope * slopes[free[name]]
                )

        for name, target in self._targets.items():
            if target:
                variable, share = target
                walk[variable] = walk.get(variable, 0.0) + share * values[name]
                depends(variable, name, share)
        for zone in self._laws:
            own = f"contact.{zone}."
            of_force = f"{own}force"
            of_exponent = f"{own}exponent"
            of_time = f"{own}damping_time"
            of_time = of_time if of_time in values else DAMPING_TIME
            force = values[of_force]
            n = values[of_exponent]
            time = values[of_time]
            # F = k d^n at the reference depth d, and b = time dF/dd = time n F / d there
            k = force / REFERENCE_DEPTH_M**n
            b = time * n * force / REFERENCE_DEPTH_M
            walk |= {f"{own}stiffness": k, of_exponent: n, f"{own}damping": b}
            depends(f"{own}stiffness", of_force, k / force)
            depends(f"{own}stiffness", of_exponent, -k * np.log(REFERENCE_DEPTH_M))
            depends(of_exponent, of_exponent, 1.0)
            depends(f"{own}damping", of_force, b / force)
            depends(f"{own}damping", of_exponent, b / n)
            depends(f"{own}damping", of_time, b / time)
        if KINETIC_SHARE in values:
            share = values[KINETIC_SHARE]
            mu = values[MU_STATIC]
            walk[MU_KINETIC] = share * mu
            depends(MU_KINETIC, KINETIC_SHARE, mu)
            depends(MU_KINETIC, MU_STATIC, share)
        return WalkValues(
            values=walk, names=tuple(by), by=np.array([*by.values()]).reshape(len(by), len(free))
        )

    def _target(
        self, name: str, label: str | None, variables: Collection[str]
    ) -> tuple[str, float] | None:
        """The variable that a parameter is added to, and its share in it; None for one of a law or
        of another trial."""
        if match := OF_TRIAL.fullmatch(name):
            if match["height"]:
                heights = sum(
                    name.endswith(".height") and bool(OF_TRIAL.fullmatch(name))
                    for name in self.parameters.by_name
                )
                return (
                    None
                    if label is None
                    else (OFFSET_HEIGHT, float(match["label"] == label) - 1.0 / heights)
                )
            kind, _, rest = match["slow"].partition(".")
            family = f"perturbation.{'slow' if kind == 'curve' else kind}.{rest}"
            return (family, 1.0) if match["label"] == label else None
        if _CURVE.fullmatch(name):
            return f"perturbation.{name}", 1.0
        law = _LAW.fullmatch(name)
        if name in (DAMPING_TIME, KINETIC_SHARE) or (law and law[1] in self._laws):
            return None
        if name not in variables:
            raise _refused(
                f"{name} is no parameter of a contact fit",
                "See vsf_drake.fit.parameters for the names",
            )
        return name, 1.0


def curve_coefficients(names: Collection[str]) -> int:
    """How many coefficients each curve has; 0 without curves. Raises InputError if these make no
    periodic splines."""
    by: dict[str, list[int]] = {}
    for name in names:
        if match := _CURVE.fullmatch(name):
            by.setdefault(match[1], []).append(int(match[2]))
        elif name.startswith("curve."):
            by.setdefault(name, []).append(-1)
    count = max(map(len, by.values()), default=0)
    if any(sorted(indices) != [*range(count)] for indices in by.values()):
        raise _refused(
            "the curves' coefficients are not 0, 1, 2 ... up to the same number",
            "They are named curve.COORDINATE.NUMBER",
        )
    if 0 < count < 4:
        raise _refused(f"{count} coefficients make no periodic curve", "At least 4 are needed")
    return count


def _refused(what: str, right: str | None = None) -> InputError:
    return InputError(what, where="parameters", right=right)


def _perturbations(
    targets: Collection[str], trial: Trial, coefficients: int
) -> tuple[MotionPerturbation, ...]:
    slow = _members(window_bsplines(trial.start_s, trial.end_s, SLOW_COEFFICIENTS))
    families = {"path": slow, "slow": slow}
    if coefficients:
        phase, basis = gait_phase(trial), periodic_bsplines(coefficients)
        families["curve"] = _members(lambda times: basis(phase(times)))
    perturbations: list[MotionPerturbation] = []
    names = [
        target.removeprefix("perturbation.")
        for target in targets
        if target.startswith("perturbation.")
    ]
    for name in dict.fromkeys(names):
        kind, coordinate, index = name.rsplit(".", 2)
        if kind != "curve" and int(index) >= SLOW_COEFFICIENTS:
            raise _refused(
                f"{name} is beyond the {SLOW_COEFFICIENTS} coefficients of a slow correction"
            )
        perturbations.append(
            MotionPerturbation(name=name, coordinate=coordinate, shape=families[kind](int(index)))
        )
    return tuple(perturbations)


def _members(
    family: Callable[[np.ndarray], np.ndarray],
) -> Callable[[int], Callable[[np.ndarray], np.ndarray]]:
    """The functions of a family by number, all worked out once for each of the few grids of times
    that walks have."""
    known = functools.lru_cache(maxsize=8)(lambda times: family(np.frombuffer(times)))
    return lambda i: lambda times: known(np.ascontiguousarray(times, dtype=float).tobytes())[:, i]
