"""What a tuning with a free motion ended with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.tuning.level2.costs import StrideCosts
from vsf_drake.analysis.tuning.level2.search import Fixed, StrideSearch, StrideTuning
from vsf_drake.analysis.tuning.level2.stride import MM
from vsf_drake.collocation.solution import TrajectorySolution
from vsf_drake.errors import FitError


@dataclass(frozen=True)
class StrideCheck:
    """One check: its value with unit, what it should be, whether it is (None: nothing is demanded), and in words."""

    name: str
    label: str
    value: float | None
    unit: str
    target: str
    met: bool | None
    sentence: str


@dataclass(frozen=True, eq=False)
class DrawnStride:
    """The optimum with one drawn contact: position and cost, NaN if none was found, and its outcomes."""

    what: str
    fulcrum_mm: float
    cost: float
    outcomes: dict[str, float]


@dataclass(eq=False)
class StrideSolution:
    """Searches of one tuning. `fulcrum_mm`, `cost` and `stride` demand an optimum.

    Attributes:
        tracked: the recorded stride as a possible motion. sweep: the best stride at each fixed position.
        free: where each search with the fulcrum free began (mm), and how it ended.
        checks, confirmed, simulated: see `checks`. drawn: the optimum with drawn contacts.
        message: how it ended. doing: what it was at last. wall_s: that it took.
    """

    tuning: StrideTuning
    tracked: TrajectorySolution
    search: StrideSearch
    sweep: list[Fixed] = field(default_factory=list)
    free: list[tuple[float, TrajectorySolution]] = field(default_factory=list)
    checks: list[StrideCheck] = field(default_factory=list)
    confirmed: list[dict[str, Any]] = field(default_factory=list)
    simulated: dict[str, np.ndarray] = field(default_factory=dict)
    drawn: list[DrawnStride] = field(default_factory=list)
    message: str = ""
    doing: str = "tracking the recording"
    wall_s: float = 0.0

    @property
    def best(self) -> TrajectorySolution | None:
        """The best optimum with the fulcrum free; None if no search converged."""
        good = [solution for _, solution in self.free if solution.success]
        return min(good, key=lambda solution: solution.last_cost) if good else None

    @property
    def success(self) -> bool:
        """Whether there is an optimum and nothing ended the tuning before it was checked."""
        return self.best is not None and not self.message.startswith("interrupted")

    @property
    def stride(self) -> TrajectorySolution:
        """The optimal stride.

        Raises:
            FitError: there is none.
        """
        if not self.success or self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def stride_or_best(self) -> TrajectorySolution:
        """The optimum, for what is done with it before the tuning has ended."""
        if self.best is None:
            raise FitError(f"this tuning has no optimum: {self.message}")
        return self.best

    @property
    def cost_unit(self) -> str:
        """Costs are relative to the tracked stride's."""
        return "1"

    @property
    def fulcrum_mm(self) -> float:
        """The best position from A."""
        return float(self.stride.p[0]) / MM

    @property
    def cost(self) -> float:
        """The cost there."""
        return self.stride.cost

    @property
    def shown(self) -> TrajectorySolution:
        """The best there is, optimum or not."""
        fixed = [row.solution for row in self.sweep if row.solution is not None]
        return self.best or min(fixed, key=lambda s: s.last_cost, default=self.tracked)


# What a person and a device would notice of a stride that was solved for.


KINDS = {
    "push_off_work": ("push-off work on the residual limb", "J/kg"),
    "stored_energy": ("largest energy in keel, support and socket", "J"),
    "prosthetic_first_peak": ("prosthetic first peak of the vertical force", "BW"),
    "prosthetic_second_peak": ("prosthetic second peak of the vertical force", "BW"),
    "intact_first_peak": ("intact first peak of the vertical force", "BW"),
    "intact_knee_moment": ("peak intact knee moment, either sign", "N m/kg"),
    "prosthetic_hip_moment": ("peak prosthetic hip moment, either sign", "N m/kg"),
    "prosthetic_knee_moment": ("peak prosthetic knee moment, either sign", "N m/kg"),
    "socket_moment": ("peak moment on the residual limb", "N m/kg"),
    "metabolic": ("joint-work estimate of metabolic energy, a stride", "J/kg"),
    "joint_load": ("squared joint and socket load", "1"),
    "motion_change": ("root mean square change of the joint angles", "deg"),
    "force_change": ("root mean square change of the ground reaction force, worse foot", "BW")}
"""Labels and units."""


def outcomes(solution: TrajectorySolution, costs: StrideCosts) -> dict[str, float]:
    """KINDS of a solved stride; the changes are from the recording."""
    y, reference, index = solution.unsealed().y(), costs.reference, costs.function.index
    weights, mass, weight = solution.problem.grid.weights, costs.mass_kg, costs.weight_n

    def column(name: str) -> np.ndarray:
        return np.asarray(y[:, index(name)[0]])

    def peak(foot: str, late: bool) -> float:
        rows = np.flatnonzero(reference.stance[foot])
        # A stance that goes over the end of the period begins late in it.
        gap = np.flatnonzero(np.diff(rows) > 1)
        rows = rows if not len(gap) else np.concatenate([rows[gap[0] + 1:], rows[:gap[0] + 1]])
        half = rows[len(rows) // 2:] if late else rows[: len(rows) // 2]
        return float(column(f"{foot}_fz")[half].max() / weight) if len(half) else float("nan")

    _, _, _, hip_p, knee_p, _, knee_i, _ = costs.function.layout.coordinates
    change = np.degrees(y[:, costs.function.starting_with("q_")][:, 3:] - reference.q[:, 3:])
    force = [np.sum((y[:, index(f"{foot}_fx", f"{foot}_fz")] - known) ** 2, axis=1)[reference.known[foot]].mean()
             for foot, known in reference.force.items() if reference.known[foot].any()]
    return {
        "push_off_work": -costs.of("push_off").value(y, weights), "stored_energy": float(column("stored_energy").max()),
        "prosthetic_first_peak": peak("prosthetic", False), "prosthetic_second_peak": peak("prosthetic", True),
        "intact_first_peak": peak("intact", False),
        "intact_knee_moment": _largest(column(f"torque_{knee_i}"), mass),
        "prosthetic_hip_moment": _largest(column(f"torque_{hip_p}"), mass),
        "prosthetic_knee_moment": _largest(column(f"torque_{knee_p}"), mass),
        "socket_moment": _largest(column("force_socket_flexion"), mass),
        "metabolic": costs.of("metabolic").value(y, weights), "joint_load": costs.of("joint_load").value(y, weights),
        "motion_change": float(np.sqrt(np.mean(change**2))),
        "force_change": float(np.sqrt(max(force)) / weight) if force else float("nan")}


def _largest(moment: np.ndarray, mass_kg: float) -> float:
    return float(np.abs(moment).max() / mass_kg)
