"""Sensitivity of GRF error, centre of pressure and energy return to what one does not know of a
walk's model.

Every factor is screened with Morris' elementary effects; the groups of factors then get Sobol
indices. The screening walks one trial a condition, a held-out one where there is one, and gives
effects on the mean of these. Indices are of the middle condition's trial alone, which allows more
points.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from shipped_sections.sensitivity_indices import (
    SamplingDesign,
    dropped,
    morris_design,
    morris_rows,
    sobol_design,
    sobol_rows,
)
from shipped_sections.settings_walks import KEEP
from vsf_drake.base.progress import Progress
from vsf_drake.base.sentences import say
from vsf_drake.fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.simulation.batch import SweepProgress, WalkCase, WalkOutcome, simulate_batch
from vsf_drake.simulation.batch.processes import chosen
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.validation.sensitivity_section import (
    FactorRange,
    OutputRow,
    SensitivityTable,
    WalkedCondition,
)
from vsf_drake.validation.study import HELD_OUT, Section, Study, StudyWalk
from vsf_drake.walks.angle_errors import LIMB_ANGLES
from vsf_drake.walks.comparison import (
    FORCE_CUTOFF_HZ,
    THRESHOLD_N,
    Comparison,
    StanceComparison,
    compare,
    filtered_while_loaded,
    partner,
    percent_instants,
    resample,
    rmse,
    uniform_grid,
    walk_axes,
)
from vsf_drake.walks.numbers import finite, known, rms
from vsf_drake.walks.quantities import JUDGED
from vsf_drake.walks.recorded_walk import STEP_S, walkers_of

TRAJECTORIES = 16
QUICK_TRAJECTORIES = 5
GROUP_SAMPLES = 512


def sensitivity_section(
    study: Study, *, progress: Progress | None = None
) -> Section[SensitivityTable]:
    """The sensitivity study; in its short form the screening of one walk alone. A table without
    arrays."""
    quick = study.options.quick
    seed = study.options.seed
    walked = chosen_walks(study, one=quick)
    show = progress or (lambda what, fraction: None)
    show("as the study is", 0.0)
    with chosen(study.options.workers, None, AT_ONCE) as (executor, _, count):
        walks = DesignWalks(walked, executor=executor, count=count)
        factors = sensitivity_factors(
            walks.trials[0].variables, walked[0].trial.subject.prosthetic_side
        )
        names = [factor.name for factor in factors]
        middle = len(walked) // 2
        baseline = walks.baseline()
        screen = morris_design(names, QUICK_TRAJECTORIES if quick else TRAJECTORIES, seed)
        total = len(screen.points) * len(walked) + (
            0 if quick else GROUP_SAMPLES * (len({factor.group for factor in factors}) + 2)
        )

        def run(design: SamplingDesign, what: str, trials: Sequence[int]) -> FactorWalk:
            done, size = walks.walked - len(walked), len(design.points) * len(trials)
            return FactorWalk(
                design,
                walks(
                    design.points,
                    factors=factors,
                    trials=trials,
                    progress=lambda fraction: show(
                        what, min((done + fraction * size) / total, 1.0)
                    ),
                ),
            )

        screened = run(screen, "screening", range(len(walked)))
        grouped = (
            None
            if quick
            else run(
                sobol_design(
                    names, GROUP_SAMPLES, seed + 1, groups=[factor.group for factor in factors]
                ),
                "Sobol indices of groups",
                [middle],
            )
        )

    morris = {name: morris_rows(screen, screened.of(i), seed) for i, name in enumerate(OUTPUTS)}

    def output_row(i: int, name: str) -> OutputRow:
        sobol = None if grouped is None else sobol_rows(grouped.design, grouped.of(i), seed)
        by_condition = [
            morris_rows(screen, screened.values[:, t, i], seed) for t in range(len(walked))
        ]
        p05, p50, p95 = percentiles(grouped, i)
        return OutputRow(
            baseline=finite(baseline[:, i].mean()),
            baseline_indexed=finite(baseline[middle, i]),
            p05=p05,
            p50=p50,
            p95=p95,
            stability=stability([[row.mu_star for row in rows] for rows in by_condition if rows]),
            interaction=None if sobol is None else 1.0 - sum(row.s1 for row in sobol),
            interaction_conf=None
            if sobol is None
            else float(np.linalg.norm([row.s1_conf for row in sobol])),
            dropped=sum(
                dropped(part.design, part.of(i)) for part in (screened, grouped) if part is not None
            ),
            morris=morris[name],
            sobol=sobol,
        )

    ranges = [one.name for one in dataclasses.fields(FactorRange)]
    table = SensitivityTable(
        factors=tuple(
            FactorRange(**{key: getattr(factor, key) for key in ranges}) for factor in factors
        ),
        conditions=tuple(
            WalkedCondition(label=walk.label, fulcrum_mm=walk.fulcrum_mm, role=walk.role)
            for walk in walked
        ),
        indexed=middle,
        walks=walks.walked,
        unconverged=walks.unconverged,
        failed=len(walks.failures),
        first_failure=next(iter(walks.failures), ""),
        trajectories=len(screen.points) // screen.block,
        blocks=None if quick else GROUP_SAMPLES,
        seed=seed,
        synthetic=any(walk.trial.synthetic for walk in walked),
        outputs={name: output_row(i, name) for i, name in enumerate(OUTPUTS)},
    )
    without = [walk.label for walk in walked if not walk.trial.prosthetic_plate.has_cop]
    return Section(
        table=table,
        missing=tuple(
            say(
                "sensitivity",
                "missing",
                quick=quick,
                trajectories=table.trajectories,
                conditions=len(walked),
                without_cop=without,
                failed=len(walks.failures),
                walks=walks.walked,
                without_effects=[
                    name
                    for name in OUTPUTS
                    if morris[name] is None and not (without and name.startswith("cop_"))
                ],
            )
        ),
    )


def chosen_walks(study: Study, *, one: bool = False) -> tuple[StudyWalk, ...]:
    """One walk a condition, or only the middle condition's: the held-out one (any, where none is)
    nearest to the middle of the repeats."""
    chosen_ones = []
    for repeats in study.conditions().values():
        held = [i for i, walk in enumerate(repeats) if walk.role == HELD_OUT] or range(len(repeats))
        chosen_ones.append(repeats[min(held, key=lambda i: abs(i - (len(repeats) - 1) / 2))])
    return (chosen_ones[len(chosen_ones) // 2],) if one else tuple(chosen_ones)


# What is read off the walked designs of the sensitivity study, by output.


@dataclass(frozen=True, eq=False)
class FactorWalk:
    """A design and `values` (rows, trials, len(OUTPUTS)) at its points, NaN where unknown."""

    design: SamplingDesign
    values: np.ndarray

    def of(self, output: int) -> np.ndarray:
        """(rows,) mean of an output over the trials."""
        return np.asarray(self.values[:, :, output].mean(axis=1))

    def independent(self, output: int) -> np.ndarray:
        """(n,) an output at the independent points of Saltelli's design: the first and the last of
        each whole block."""
        y = self.of(output)
        return np.asarray(
            y[self.design.whole(y)].reshape(-1, self.design.block)[:, [0, -1]].ravel()
        )


def percentiles(walked: FactorWalk | None, output: int) -> list[float | None]:
    """The 5th, 50th and 95th of an output over the uncertainty; None below two points."""
    y = np.empty(0) if walked is None else walked.independent(output)
    return np.percentile(y, (5, 50, 95)).tolist() if len(y) > 1 else [None] * 3


def stability(effects: Sequence[Sequence[float]]) -> float | None:
    """The lowest rank correlation of mu* between two conditions; None of fewer than two."""
    pairs = [spearmanr(a, b).statistic for a, b in combinations(effects, 2)]
    return finite(min(pairs)) if pairs else None


# The walks of the study: each point of a design walked in every trial, and what is read off each
# walk.

OUTPUTS = (
    JUDGED,
    "cop_rmse_fl",
    "cop_shift_mm",
    "peak_vertical_bw",
    "spring_stored_j",
    "spring_returned_j",
)
"""What is read off a walk:

- JUDGED, cop_rmse_fl: as in `walks.metrics`.
- cop_shift_mm: mean over the stance of the model's CoP less the plate's, fore-aft, forward
  positive.
- peak_vertical_bw: largest vertical force (40 Hz) in the measured stance.
- spring_stored_j: largest strain energy of the spring, which is the keel with the support under it,
  between the model's touch-down and toe-off, less that at touch-down. The foam is not in it.
- spring_returned_j: what of it is gone by toe-off, less what the damping of both took on the way.

The last three are means over complete stances."""
AT_ONCE = 480
"""Walks whose arrays are held at a time."""


class DesignTrial:
    """One trial in which designs are walked, and how the OUTPUTS are read off its walks: by the
    definitions of `walks.comparison` and `walks.metrics`."""

    def __init__(self, walk: StudyWalk, walker: Walker) -> None:
        trial = walk.trial
        reach = walk.trial.model.foot.fulcrum
        self.trial = trial
        self.walker = walker
        self.variables: Mapping[str, Variable] = walker.variables
        self.limits = {
            "fulcrum.shift": (
                min(reach.rearmost_m - trial.fulcrum_m, 0.0),
                # as in `values_at`
                max(reach.foremost_m - trial.fulcrum_m, 0.0),
            )
        }
        self.weight_n = trial.subject.mass_kg * GRAVITY
        self.result = walker.result(self.run(), trial, trial.offsets, energy=False)
        self.comparison: Comparison = compare(self.result, trial.prosthetic_plate)
        self._axes = walk_axes(self.comparison.heading)
        self._measured = (
            np.linalg.norm(self.comparison.measured, axis=1)[self.comparison.scored] / self.weight_n
        )

    def run(self, **more: Any) -> Walk:
        """The trial walked as the study has it; `more` is what else `Walker.walk` takes."""
        trial = self.trial
        return self.walker.walk(
            trial.trajectory,
            fulcrum_m=trial.fulcrum_m,
            start_s=trial.start_s,
            end_s=trial.end_s,
            step_s=STEP_S,
            offsets=trial.offsets,
            **more,
        )

    def values(self, factors: Sequence[Factor], shares: np.ndarray) -> dict[str, float]:
        """`values_at` with this walker's variables and within the reach of the fulcrum."""
        return values_at(factors, shares, self.variables, self.limits)

    def score(self, outcome: WalkOutcome) -> np.ndarray:
        """(len(OUTPUTS),) of a walk that kept KEEP; NaN where one is not known, all NaN of a walk
        that failed."""
        if not outcome.ok:
            return np.full(len(OUTPUTS), np.nan)
        time, grf, cop, energies = (outcome.arrays[name] for name in KEEP)
        energy = dict(zip(outcome.columns["energy_j"], energies.T, strict=True))
        c = self.comparison
        grid = uniform_grid(time)
        raw = resample(grid, time, grf @ self._axes.T)
        first = int(np.searchsorted(grid, c.time_s[0] - 1e-9))
        model = low_pass(raw, rate_hz=1.0 / c.step_s, cutoff_hz=FORCE_CUTOFF_HZ)[
            first : first + len(c.time_s)
        ]
        error = rmse(np.linalg.norm(model, axis=1)[c.scored] / self.weight_n, self._measured)
        off_m = known(x for item in c.stances for x in self._cop_error(item, time, grf, cop))
        stances = find_stances(grid, raw[:, 2], threshold_n=THRESHOLD_N)
        rows = [
            [
                model[c.within(item.measured.start_s, item.measured.end_s), 2].max()
                / self.weight_n,
                *_spring(time, energy, item.measured, stances),
            ]
            for item in c.stances
            if item.inside
        ]
        return np.array(
            [
                error,
                rms(off_m) / self.result.foot_length_m,
                1e3 * off_m.mean() if off_m.size else np.nan,
                *(np.mean(rows, axis=0) if rows else np.full(3, np.nan)),
            ]
        )

    def _cop_error(
        self, item: StanceComparison, time: np.ndarray, grf: np.ndarray, cop: np.ndarray
    ) -> np.ndarray:
        """(101,) m, model less plate over the measured stance, fore-aft; NaN where either is not
        loaded."""
        instants = percent_instants(item.measured)
        curve = filtered_while_loaded(cop @ self._axes[:2].T, time, grf[:, 2], cop, instants)[:, 0]
        outside = (instants < self.comparison.time_s[0] - 1e-9) | (
            instants > self.comparison.time_s[-1] + 1e-9
        )
        return np.where(outside, np.nan, curve - item.measured_cop[:, 0])


def _spring(
    time: np.ndarray, energy: dict[str, np.ndarray], measured: Stance, stances: Sequence[Stance]
) -> tuple[float, float]:
    """The last two OUTPUTS, in the model's stance that overlaps `measured`; NaN without a complete
    one."""
    own = partner(measured, stances)
    if own is None or not own.complete:
        return np.nan, np.nan
    down, off = np.searchsorted(time, [own.start_s, own.end_s])
    strain, loss = (
        energy[f"keel_{kind}"] + energy[f"fulcrum_{kind}"] for kind in ("strain", "loss")
    )
    full = down + int(np.argmax(strain[down : off + 1]))
    return (
        float(strain[full] - strain[down]),
        float(strain[full] - strain[off] - (loss[off] - loss[full])),
    )


class DesignWalks:
    """Walks every point of a design in each of several trials, on `count` workers of an executor
    (None: here)."""

    def __init__(self, walks: Sequence[StudyWalk], executor: Any = None, count: int = 1) -> None:
        self._executor = executor
        self._count = count
        self.failures: list[str] = []  # why walks failed, in the order of the points
        # walks so far, and those that accepted steps without convergence
        self.walked = self.unconverged = 0
        walkers = walkers_of(walk.trial for walk in walks)
        self.trials = [
            DesignTrial(walk, walker) for walk, walker in zip(walks, walkers, strict=True)
        ]

    def baseline(self) -> np.ndarray:
        """(trials, len(OUTPUTS)) with every factor as the study has it."""
        return np.asarray(self(np.zeros((1, 0)), factors=())[0])

    def __call__(
        self,
        points: np.ndarray,
        *,
        factors: Sequence[Factor],
        trials: Sequence[int] | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> np.ndarray:
        """(rows, trials, len(OUTPUTS)) at points (rows, k), the shares of the ranges of k factors,
        in some or all trials; NaN where a walk failed or a value is not known. What is no factor
        stays as the study has it."""
        walked = self.trials if trials is None else [self.trials[t] for t in trials]
        values = np.full((len(points), len(walked), len(OUTPUTS)), np.nan)
        rows = max(1, AT_ONCE // len(walked))
        for start in range(0, len(points), rows):
            part = points[start : start + rows]
            cases = [
                WalkCase(
                    trial=one.trial,
                    step_s=STEP_S,
                    label=f"point {start + i}",
                    values=one.values(factors, point),
                )
                for i, point in enumerate(part)
                for one in walked
            ]

            def show(state: SweepProgress, start: int = start, size: int = len(part)) -> None:
                if progress:
                    progress((start + size * state.done / max(state.total, 1)) / len(points))

            outcomes = simulate_batch(
                cases, keep=KEEP, workers=self._count, executor=self._executor, progress=show
            )
            for n, outcome in enumerate(outcomes):
                row, place = divmod(n, len(walked))
                values[start + row, place] = walked[place].score(outcome)
                self.unconverged += bool(outcome.unconverged_steps)
            self.failures += [
                outcome.failure for outcome in outcomes if outcome.failure is not None
            ]
            self.walked += len(cases)
        return values


# The factors of the sensitivity study: what one does not know of a walk's model before a fit, and
# how far.
#
# Each range is the uncertainty that one really has, not what a search may try. Shifts are added to
# the study's values (the fitted contact, where there is one); ratios multiply them and are sampled
# in the logarithm. All are sampled evenly. Errors of the pelvis's orientation are not among them:
# where markers on the thigh are tracked, the hip's angles take them up, and the leg stays where it
# was.

CONTACT, FRICTION, GEOMETRY, KINEMATICS, BUSHING, KEEL = GROUPS = (
    "contact",
    "friction",
    "geometry",
    "kinematics",
    "bushing",
    "keel",
)
SHIFT, RATIO, EXPONENT = "shift", "ratio", "exponent"
"""How a factor changes its variables: adds to them, multiplies them, or adds to an exponent at the
same force at REFERENCE_DEPTH_M."""
FULCRUM_M = 5e-3
"""How far off the support may really be, either way."""


@dataclass(frozen=True, kw_only=True)
class Factor(FactorRange):
    """A factor with the variables of the walker that it changes together, and how."""

    variables: tuple[str, ...]
    kind: str = SHIFT

    def value(self, share: float, limits: tuple[float, float] = (-math.inf, math.inf)) -> float:
        """What is added or multiplied (SI) at a share from 0 to 1 of the range, or of its part
        within `limits`."""
        low, high = (
            min(max(bound * _SI[self.unit], limits[0]), limits[1])
            for bound in (self.low, self.high)
        )
        if self.kind == RATIO:
            return float(low * (high / low) ** share)
        return float(low + (high - low) * share)


_SI = {"mm": 1e-3, "deg": math.radians(1.0), "1": 1.0, "×": 1.0}


def sensitivity_factors(variables: Mapping[str, Variable], side: str) -> tuple[Factor, ...]:
    """The factors of a walker with these variables; `side` is that of the prosthesis, "right" or
    "left"."""
    zones = [
        name.split(".")[1]
        for name in variables
        if name.startswith("contact.") and name.endswith(".stiffness")
    ]
    words = {zone: zone.replace("_", " ") for zone in zones}
    leg = side[0]

    def ratio(name: str, group: str, most: float, why: str, *changed: str) -> Factor:
        return Factor(
            name=name,
            group=group,
            unit="×",
            low=1.0 / most,
            high=most,
            why=why,
            variables=changed,
            kind=RATIO,
        )

    def shift(name: str, group: str, unit: str, most: float, why: str, changed: str) -> Factor:
        return Factor(
            name=name, group=group, unit=unit, low=-most, high=most, why=why, variables=(changed,)
        )

    factors = [
        ratio(
            f"{words[zone]} foam stiffness",
            CONTACT,
            1.5,
            "the bench knows the foam under one load point, no more",
            f"contact.{zone}.stiffness",
        )
        for zone in zones
    ]
    factors += [
        Factor(
            name="foam exponent",
            group=CONTACT,
            unit="1",
            low=-0.2,
            high=0.2,
            kind=EXPONENT,
            variables=tuple(f"contact.{zone}.exponent" for zone in zones),
            why=(
                f"foams differ; at the same force at {1e3 * REFERENCE_DEPTH_M:g} mm, so that no "
                "stiffness hides in it; not below 1"
            ),
        ),
        ratio(
            "foam damping",
            CONTACT,
            2.0,
            "not measured on the bench, a choice",
            *(f"contact.{zone}.damping" for zone in zones),
        ),
        ratio(
            "foam depth of full damping",
            CONTACT,
            2.0,
            "a number of the law rather than of the foam, a choice",
            *(f"contact.{zone}.full_damping_depth" for zone in zones),
        ),
        ratio(
            "static friction",
            FRICTION,
            1.25,
            "0.4 to 0.6 about the paper's 0.5: floors and soles differ",
            "friction.mu_static",
        ),
        ratio(
            "kinetic friction",
            FRICTION,
            1.25,
            "0.24 to 0.38 about the paper's 0.3",
            "friction.mu_kinetic",
        ),
        ratio(
            "friction threshold velocity",
            FRICTION,
            2.0,
            "a number of the law rather than of the sole, a choice",
            "friction.threshold_velocity",
        ),
        shift(
            "prosthesis height",
            GEOMETRY,
            "mm",
            2.0,
            "length of limb, socket and pylon with a tape",
            "offset.height",
        ),
        shift(
            "prosthesis fore-aft",
            GEOMETRY,
            "mm",
            5.0,
            "where the foot is bolted on, by eye",
            "offset.fore_aft",
        ),
        shift(
            "prosthesis alignment",
            GEOMETRY,
            "deg",
            1.0,
            "a prosthetist's angle, by eye",
            "offset.alignment",
        ),
        *(
            shift(
                f"{words[zone]} sole height",
                GEOMETRY,
                "mm",
                1.0,
                "the sole is drawn flat; soles are round",
                f"contact.{zone}.rise",
            )
            for zone in zones
        ),
        *(
            shift(
                name.replace("_angle", "_flexion").replace("_", " "),
                KINEMATICS,
                "deg",
                1.2,
                "misplaced markers: the standard deviation of the embedded synthetic "
                "laboratory's constant errors",
                f"coordinate.{name}_{leg}",
            )
            for name in LIMB_ANGLES
        ),
        *(
            shift(
                name,
                KINEMATICS,
                "mm",
                most,
                "errors between cameras, plates and markers, a choice",
                f"coordinate.{coordinate}",
            )
            for name, coordinate, most in (
                ("pelvis height", "pelvis_ty", 1.0),
                ("pelvis fore-aft", "pelvis_tx", 2.0),
                ("pelvis sideways", "pelvis_tz", 2.0),
            )
        ),
        *(
            ratio(
                f"{name} socket stiffness",
                BUSHING,
                1.5,
                "measured sockets fix it within a factor of two",
                f"socket.{axis}.stiffness",
            )
            for axis, name in (
                ("tx", "fore-aft"),
                ("ty", "sideways"),
                ("tz", "axial"),
                ("flexion", "flexion"),
                ("adduction", "adduction"),
                ("rotation", "rotation"),
            )
        ),
        ratio(
            "keel modulus",
            KEEL,
            1.1,
            "calibrations to the bench give 7.4 to 8.1 GPa",
            "keel.flexural_modulus",
        ),
        ratio(
            "fulcrum stiffness", KEEL, 1.5, "a choice: sinks less than 1 mm", "fulcrum.stiffness"
        ),
        shift(
            "fulcrum position",
            KEEL,
            "mm",
            1e3 * FULCRUM_M,
            "the support has a width and its drive some play; "
            "inward only where it stands at an end of its reach",
            "fulcrum.shift",
        ),
    ]
    return tuple(
        factor
        for factor in factors
        if factor.variables and all(name in variables for name in factor.variables)
    )


def values_at(
    factors: Sequence[Factor],
    shares: np.ndarray,
    variables: Mapping[str, Variable],
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> dict[str, float]:
    """Values of the walker's variables where the factors stand at these shares (k,) of their
    ranges, 0 to 1.

    `limits` are the lowest and highest shift (SI) by variable, where not all of a factor's range is
    possible.
    """
    values = {name: variables[name].default for factor in factors for name in factor.variables}
    for factor, share in zip(factors, shares, strict=True):
        change = factor.value(
            float(share), (limits or {}).get(factor.variables[0], (-math.inf, math.inf))
        )
        for name in factor.variables:
            if factor.kind == RATIO:
                values[name] *= change
            elif factor.kind == SHIFT:
                values[name] += change
            else:
                before = variables[name].default
                after = max(variables[name].default + change, 1.0)
                stiffness = name.replace(".exponent", ".stiffness")
                values[name] = after
                values[stiffness] = values.get(
                    stiffness, variables[stiffness].default
                ) * REFERENCE_DEPTH_M ** (before - after)
    return values
