"""What a walk costs against how finely it is modelled: step size, spheres, keel elements, free
coordinates.

Walks an embedded trial, which is synthetic. Run it on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from refined_spheres import with_spheres

from vsf_drake.base.files import replaced
from vsf_drake.model.parameters import GRAVITY, PELVIS_COORDINATES, FootParameters, leg_coordinates
from vsf_drake.motion.events import runs
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.plants.foot import with_elements
from vsf_drake.report.style import NEUTRAL, colour_of, drawing, label, log_scale, save_figure
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.walk import DEFAULT_STEP_S, Walk, Walker
from vsf_drake.walks.embedded import embedded_trials

COLUMNS = (
    "family",
    "size",
    "walk",
    "simulated_s",
    "wall_s",
    "settling_s",
    "times_faster_than_real_time",
    "newton_iterations_a_step",
    "unconverged_steps",
    "difference_percent_body_weight",
    "difference_from",
)


def main() -> None:
    """Measures, prints a table, writes it as CSV and the figure as PNG and SVG."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/cost_against_work"))
    parser.add_argument("--quick", action="store_true", help="fewer walks, each run once")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    trial = load_trial(embedded_trials("exact")[0])
    costs = measure_costs(trial, quick=arguments.quick, repeats=1 if arguments.quick else REPEATS)
    for cost in costs:
        print(
            f"{cost.label:52} {1e3 * cost.wall_s:8.1f} ms for {cost.simulated_s:.2f} s  "
            f"{100 * cost.difference_bw:7.4f} % BW"
            + (f" from {cost.against}" if cost.against else "")
        )
    write_table(arguments.out / "cost_against_work.csv", costs)
    title = (
        f"Cost against work. {trial.name}: {WALK_S:g} s, whole person, {1e3 * DEFAULT_STEP_S:g} "
        "ms unless said,\none core, without the settling before the start"
    )
    save_figure(cost_figure(costs, title=title), arguments.out / "cost_against_work")


def write_table(path: Path, costs: Sequence[Cost]) -> None:
    """One row a walk."""
    with replaced(path) as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(COLUMNS)
        for cost in costs:
            table.writerow(
                [
                    cost.family,
                    cost.size,
                    cost.label,
                    cost.simulated_s,
                    cost.wall_s,
                    cost.settling_s,
                    cost.simulated_s / cost.wall_s,
                    cost.iterations,
                    cost.unconverged,
                    100 * cost.difference_bw,
                    cost.against,
                ]
            )


# What a walk costs against how finely it is modelled: step size, spheres, keel elements, free
# coordinates.
#
# Each family makes one thing finer and leaves the rest. A walk's cost is its wall time; beside it
# stands how far the 40 Hz resultant of its ground reaction force on the prosthetic foot is from
# that of the finest of its family, since a fast wrong number is worth nothing. Free coordinates
# change the motion itself: there each walk is compared with the same one in the finest step. Times
# belong to the machine.


WALK_S = 1.2
STEPS_S = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
SPHERES = (24, 50, 100, 200)
ELEMENTS = (8, 16, 32, 64)
COARSE_STEP_S = 2e-3
LIMP_S = 0.3
"""Length of the runs with free coordinates: after that a body let go is on the ground."""
REPEATS, SHORTEST_ROUND_S = 5, 0.2
_COMPARED_S = 4e-3
"""Grid on which forces are compared: every step size here divides it."""
_PLATE_S = 1e-3
_CUTOFF_HZ = 40.0


@dataclass(frozen=True)
class Cost:
    """One walk's cost and error.

    Attributes:
        family: "step", "spheres", "elements" or "free".
        size: what is varied: s for steps, else a count.
        label: the walk in words.
        simulated_s: length of the walk. wall_s: of the whole run; settling_s: the part before the
            first step.
        iterations: of Newton's method a step, mean. unconverged: steps.
        difference_bw: RMS of the difference of the 40 Hz resultants, fraction of body weight.
        against: what it is the difference from; empty where the walk is its own measure.
    """

    family: str
    size: float
    label: str
    simulated_s: float
    wall_s: float
    settling_s: float
    iterations: float
    unconverged: int
    difference_bw: float
    against: str

    @property
    def stepping_per_second(self) -> float:
        """Wall time per simulated time from the first step on; below 1 is faster than real time."""
        return (self.wall_s - self.settling_s) / self.simulated_s


@dataclass(eq=False)
class _Job:
    """One walk to measure; `measured` against another job, or against None if it is the finest
    itself."""

    family: str
    size: float
    label: str
    walker: Walker
    window: tuple[float, float]
    step_s: float
    finest: _Job | None = None
    against: str = ""
    walk: Walk | None = None
    wall_s: float = np.inf
    settling_s: float = np.inf


def measure_costs(trial: Trial, *, quick: bool = False, repeats: int = REPEATS) -> list[Cost]:
    """All four families on `trial`, which must hold a stance of the prosthetic foot in its last
    `WALK_S`.

    Args:
        quick: fewer members of each family.
        repeats: rounds of all walks, in each of which a walk runs once, or for SHORTEST_ROUND_S if
            it is shorter. The fastest counts; what else the machine does falls on all of them.

    Raises:
        InputError, SimulationError: see `Walker`.
    """
    chosen = (STEPS_S[1:5], SPHERES[:3], ELEMENTS[:3]) if quick else (STEPS_S, SPHERES, ELEMENTS)
    jobs = [
        *_step_jobs(trial, chosen[0]),
        *_foot_jobs(trial, "spheres", chosen[1], with_spheres),
        *_foot_jobs(trial, "elements", chosen[2], with_elements),
        *_free_jobs(trial, chosen[0][-1]),
    ]
    hidden = [job.finest for job in jobs if job.finest is not None and job.finest not in jobs]
    for job in hidden:
        _run(job, trial)
    for job in repeats * jobs:
        _run(job, trial)
    return [_cost(trial, job) for job in jobs]


def _step_jobs(trial: Trial, steps_s: Sequence[float]) -> list[_Job]:
    walker, words = (
        Walker(trial.subject, trial.model),
        [f"{1e3 * step_s:g} ms" for step_s in steps_s],
    )
    return _family(
        [
            _Job("step", step_s, f"step of {each}", walker, _window(trial), step_s)
            for step_s, each in zip(steps_s, words, strict=True)
        ],
        words[-1],
    )


def _foot_jobs(
    trial: Trial,
    family: str,
    counts: Sequence[int],
    refine: Callable[[FootParameters, int], FootParameters],
) -> list[_Job]:
    what, jobs = "spheres under the prosthetic foot" if family == "spheres" else "keel elements", []
    for count in counts:
        model = dataclasses.replace(trial.model, foot=refine(trial.model.foot, count))
        jobs.append(
            _Job(
                family,
                count,
                f"{count} {what}",
                Walker(trial.subject, model),
                _window(trial),
                DEFAULT_STEP_S,
            )
        )
    return _family(jobs, f"{counts[-1]} {family}")


def _family(jobs: list[_Job], against: str) -> list[_Job]:
    for job in jobs[:-1]:
        job.finest, job.against = jobs[-1], against
    return jobs


def _free_jobs(trial: Trial, finest_s: float) -> list[_Job]:
    """From the middle of the prosthetic stance, with ever more joints let go."""
    middle = _single_stance(trial)
    window, jobs = (middle, min(middle + LIMP_S, trial.end_s)), []
    for words, free in _let_go(trial.subject.prosthetic_side).items():
        walker = Walker(trial.subject, trial.model, free=free)
        count = walker.gait.plant.num_velocities() - len(walker.gait.prescribed) - 1
        label = f"{count} coordinates free: {words}"
        exact = _Job("free", count, label, walker, window, finest_s)
        jobs.append(
            _Job(
                "free",
                count,
                label,
                walker,
                window,
                DEFAULT_STEP_S,
                finest=exact,
                against=f"the same at {1e3 * finest_s:g} ms",
            )
        )
    return jobs


def _let_go(side: str) -> dict[str, tuple[str, ...]]:
    """Anatomical coordinates that are not prescribed, by what that is called."""
    swinging = leg_coordinates("left" if side == "right" else "right", intact=True)
    sagittal = tuple(name for name in swinging if "flexion" in name or "angle" in name)
    return {
        "socket and keel": (),
        "intact leg limp in its plane": sagittal,
        "intact leg limp": swinging,
        "pelvis too": (*PELVIS_COORDINATES, *swinging),
        "everything": (*PELVIS_COORDINATES, *swinging, *leg_coordinates(side, intact=False)),
    }


def _single_stance(trial: Trial) -> float:
    """A third into the first time (s) that the prosthetic foot alone bears the model."""
    walker = Walker(trial.subject, trial.model)
    walk = _walked(walker, trial, (trial.start_s, trial.end_s), COARSE_STEP_S)
    alone = (walk.prosthetic.grf_W[:, 2] > LOADED_N) & (walk.intact.grf_W[:, 2] <= LOADED_N)
    start, stop = runs(alone)[0]
    return float(walk.record.time_s[(2 * start + stop) // 3])


def _window(trial: Trial) -> tuple[float, float]:
    return max(trial.start_s, trial.end_s - WALK_S), trial.end_s


def _walked(walker: Walker, trial: Trial, window: tuple[float, float], step_s: float) -> Walk:
    return walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=window[0],
        end_s=window[1],
        step_s=step_s,
        offsets=trial.offsets,
    )


def _run(job: _Job, trial: Trial) -> None:
    """The walk, and one of a single step, which takes as long as settling; short ones more than
    once."""
    one = (job.window[0], job.window[0] + job.step_s)
    spent = 0.0
    while spent < SHORTEST_ROUND_S:
        job.walk = _walked(job.walker, trial, job.window, job.step_s)
        job.wall_s = min(job.wall_s, job.walk.wall_s)
        job.settling_s = min(job.settling_s, _walked(job.walker, trial, one, job.step_s).wall_s)
        spent += job.walk.wall_s


def _cost(trial: Trial, job: _Job) -> Cost:
    walk, exact = job.walk, (job.finest or job).walk
    record = walk.record
    pair = [resultant_40_hz(each) for each in (walk, exact)]
    count = min(len(force) for force in pair)
    apart = float(np.sqrt(np.mean((pair[0][:count] - pair[1][:count]) ** 2)))
    return Cost(
        family=job.family,
        size=float(job.size),
        label=job.label,
        simulated_s=len(record.time_s) * walk.step_s,
        wall_s=job.wall_s,
        settling_s=job.settling_s,
        iterations=float(record.iterations.mean()),
        unconverged=int(np.count_nonzero(~record.converged)),
        difference_bw=apart / (trial.subject.mass_kg * GRAVITY),
        against=job.against,
    )


def resultant_40_hz(walk: Walk) -> np.ndarray:
    """(n,) N, every 4 ms from 4 ms after the start on: 40 Hz resultant on the prosthetic foot.

    Filtered at the walk's own rate, but not above the 1 kHz of a force plate: where a filter begins
    depends on it.
    """
    plate_s = max(walk.step_s, _PLATE_S)
    force = walk.prosthetic.grf_W[round(plate_s / walk.step_s) - 1 :: round(plate_s / walk.step_s)]
    resultant = np.linalg.norm(low_pass(force, rate_hz=1.0 / plate_s, cutoff_hz=_CUTOFF_HZ), axis=1)
    return resultant[round(_COMPARED_S / plate_s) - 1 :: round(_COMPARED_S / plate_s)]


# Cost against work in one figure: wall time per simulated second, with each walk's error written
# beside it.


_PANELS = {
    "step": ("step size (ms)", "Step size"),
    "spheres": (
        "contact spheres of the prosthetic foot",
        "Contact spheres (same outline and stiffness)",
    ),
    "elements": ("elements of the keel", "Keel elements (same beam)"),
    "free": ("coordinates that are not prescribed", "Free coordinates (let go in mid-stance)"),
}
_FLOOR = 5e-5
"""Share of body weight below which an error is written as below that."""


def cost_figure(costs: Sequence[Cost], *, title: str) -> Figure:
    """Four panels, one a family of `costs`.

    Args:
        title: what was walked, and on what.
    """
    with drawing(9.6, 7.0) as figure:
        heights = [cost.stepping_per_second for cost in costs]
        for axes, (family, (x, name)) in zip(
            figure.subplots(2, 2, sharey=True).flat, _PANELS.items(), strict=True
        ):
            members = sorted(
                (cost for cost in costs if cost.family == family), key=lambda cost: cost.size
            )
            _panel(axes, members, 1e3 if family == "step" else 1.0)
            label(axes, x=x, y="wall time per simulated second (s)", title=name)
            axes.label_outer(remove_inner_ticks=True)
            axes.set_xlabel(x)
            axes.tick_params(labelbottom=True)
        axes.set_ylim(0.5 * min(heights), 2.0 * max(1.0, *heights))
        figure.suptitle(
            f"{title}\nBeside each point: RMS of the difference of its 40 Hz resultant from the "
            "panel's finest, % of body weight\n(free coordinates: from the same motion in the "
            "finest step)",
            x=0.01,
            ha="left",
            fontsize=9.5,
        )
    return figure


def _panel(axes: Axes, members: Sequence[Cost], unit: float) -> None:
    x = np.array([unit * cost.size for cost in members])
    y = np.array([cost.stepping_per_second for cost in members])
    axes.axhline(1.0, color=NEUTRAL, linewidth=1.0, linestyle=":")
    falling = y[-1] < y[0]
    axes.annotate(
        "real time",
        (1.0 if falling else 0.01, 1.0),
        xycoords=("axes fraction", "data"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="right" if falling else "left",
        fontsize=8,
        color=NEUTRAL,
    )
    axes.plot(x, y, marker="o", markersize=6, linewidth=1.4, color=colour_of(108.0))
    for place, height, cost in zip(x, y, members, strict=True):
        axes.annotate(
            _error(cost),
            (place, height),
            xytext=(3 if falling else -3, 7),
            textcoords="offset points",
            ha="left" if falling else "right",
            fontsize=8,
        )
    log_scale(axes.xaxis, base=2)
    log_scale(axes.yaxis)
    axes.margins(x=0.2)
    axes.xaxis.set_major_locator(FixedLocator(x.tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _error(cost: Cost) -> str:
    if not cost.against:
        return "finest"
    return (
        f"{100 * cost.difference_bw:.2g} %"
        if cost.difference_bw > _FLOOR
        else f"< {100 * _FLOOR:g} %"
    )


if __name__ == "__main__":
    main()
