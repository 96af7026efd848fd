"""The numbers of a compared walk: unit, scale, format, label and meaning of each, told here alone.

A number is kept in SI units, in body weights or in foot lengths, under the name that it has in
`WalkMetrics`, JSON and CSV; tables, sentences, figures and screens look up here how it is shown.
BW is the subject's mass times 9.81 m/s², FL the length of the model's prosthetic foot.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

JUDGED = "grf_rmse_bw"
"""The error that a walk is judged by: the one of a sweep, of a null model, of a layer."""
NULL = f"null_model_{JUDGED}"
STRETCHED = f"stretched_null_{JUDGED}"
IN_LATE_STANCE = f"null_model_predicted_times_{JUDGED}"
FLOOR = f"floor_{JUDGED}"


@dataclass(frozen=True)
class Quantity:
    """What a number of a compared walk is; one without `form` is no number."""

    label: str
    unit: str  # in which it is kept, in words
    scale: float  # from that one to the one in which it is shown
    shown: str  # unit
    form: str  # of the number in that unit
    meaning: str

    @property
    def heading(self) -> str:
        """Of a column: the label with the unit."""
        return f"{self.label} ({self.shown})" if self.shown else self.label

    def told(self, value: float | None) -> str:
        """The number in a sentence, which says itself of what it is a share: "4.3 %"."""
        if value is None:
            return "unknown"
        return f"{self.form.format(self.scale * value)} {self.shown.partition(' ')[0]}"


_TABLE = """
grf_rmse_bw                | GRF                    | body weights | 100  | % BW | {:.1f}
    RMS error of the resultant force, both low-passed at 40 Hz, stances ± 0.25 s
grf_r2                     | R²                     | 1            | 1    |      | {:.3f}
    of the resultant: 1 - SSE/SST
vertical_rmse_bw           | vertical               | body weights | 100  | % BW | {:.1f}
    RMS error of the vertical force
fore_aft_rmse_bw           | fore-aft               | body weights | 100  | % BW | {:.1f}
    RMS error of the fore-aft force
medio_lateral_rmse_bw      | medio-lateral          | body weights | 100  | % BW | {:.1f}
    RMS error of the lateral force; unknown where nobody measured one
vertical_impulse_error     | vertical impulse       | 1            | 100  | %    | {:+.1f}
    vertical impulse, model over plate, minus one
impulse_rmse_bws           | impulse                | BW s         | 1    | BW s | {:.3f}
    RMS error of the resultant's running integral over stance
impulse_r2                 | R² of impulse          | 1            | 1    |      | {:.3f}
    of the resultant's running integral
cop_rmse_fl                | CoP                    | foot lengths | 100  | % FL | {:.1f}
    RMS error of the centre of pressure, fore-aft, in lengths of the model's foot
cop_ml_rmse_fl             | CoP lateral            | foot lengths | 100  | % FL | {:.1f}
    RMS error of the centre of pressure, lateral, in lengths of the model's foot
cop_r2                     | R² of CoP              | 1            | 1    |      | {:.3f}
    fore-aft, about the mean of each footprint
cop_points                 | CoP instants           | 1            | 1    |      | {:.0f}
    instants at which model and plate have one
stance_measured_s          | stance, plate          | s            | 1    | s    | {:.3f}
    mean of the stances simulated as a whole
stance_model_s             | stance, model          | s            | 1    | s    | {:.3f}
    mean of the same stances
stance_error_s             | stance error           | s            | 1    | s    | {:+.3f}
    how much longer the model's lasts
heel_strike_error_s        | heel strike            | s            | 1000 | ms   | {:+.1f}
    model less plate: late is positive
toe_off_error_s            | toe-off                | s            | 1000 | ms   | {:+.1f}
    model less plate: late is positive
stances                    | stances                |              | 1    |      |
    the measured stances, each with times and peaks
extra_model_stances        | extra stances          | 1            | 1    |      | {:.0f}
    of the model, which the plate has not
scored_window_s            | compared               |              | 1    |      |
    from when to when, on the recording's clock
coverage                   | coverage               | 1            | 100  | %    | {:.0f}
    share of the stances and their margins that is simulated
heading_deg                | heading                | deg          | 1    | °    | {:.1f}
    of the walk, from W's x axis to its y axis
body_weight_n              | body weight            | N            | 1    | N    | {:.1f}
    BW
foot_length_m              | foot length            | m            | 1    | m    | {:.3f}
    FL
null_model_grf_rmse_bw     | null model             | body weights | 100  | % BW | {:.1f}
    RMS error of the resultant of the harder null model
stretched_null_grf_rmse_bw | nearest single curve   | body weights | 100  | % BW | {:.1f}
    RMS error of the nearest curve of another walk, stretched
null_model_unknown         | null model unknown     |              | 1    |      |
    why it is
null_model_predicted_times_grf_rmse_bw | null, predicted stance | body weights | 100 | % BW | {:.1f}
    RMS error of the harder null at the physics' times of stance
floor_grf_rmse_bw          | floor                  | body weights | 100  | % BW | {:.1f}
    what the true foot would be left with on this motion
angle_rmse_deg             | angles                 | deg          | 1    | °    | {:.2f}
    RMS of followed less commanded rotations
trial                      | trial                  |              | 1    |      |
    name of the trial
simulated_s                | simulated              | s            | 1    | s    | {:.3f}
    time that was simulated
wall_s                     | wall time              | s            | 1    | s    | {:.3f}
    that it took, compiling left out
compile_s                  | compiling              | s            | 1    | s    | {:.3f}
    time that compiling took
step_s                     | step                   | s            | 1    | s    | {:g}
    of the simulation
unconverged_steps          | unconverged steps      | 1            | 1    |      | {:.0f}
    steps accepted without convergence
refined_steps              | refined steps          | 1            | 1    |      | {:.0f}
    steps cut into smaller ones to converge
converged                  | converged              |              | 1    |      |
    no step was accepted without convergence
synthetic                  | SYNTHETIC              |              | 1    |      |
    nobody walked this
fulcrum_mm                 | fulcrum                | mm           | 1    | mm   | {:g}
    fulcrum from the keel's posterior end
sweep_best_mm              | sweep: best            | mm           | 1    | mm   | {:.0f}
    fulcrum where the error is least
peak_vertical_bw           | peak vertical force    | body weights | 1    | BW   | {:.2f}
    largest vertical force of the model in a measured stance
free_moment_rmse_nm        | free moment            | N m          | 1    | N m  | {:.2f}
    RMS error over all stances
free_moment_r2             | R² of free moment      | 1            | 1    |      | {:.2f}
    1 - SSE/SST
"""
_LINES = _TABLE.strip().splitlines()


def _entry(line: str, meaning: str) -> tuple[str, Quantity]:
    """Of a line `name | label | unit | scale | unit as shown | format`, and the next."""
    name, label, unit, scale, shown, form = (cell.strip() for cell in line.split("|"))
    return name, Quantity(label, unit, float(scale), shown, form, meaning.strip())


QUANTITIES = dict(map(_entry, _LINES[::2], _LINES[1::2]))


def quantity(name: str) -> Quantity:
    """What NAME is, also that of `NAME_worst` and `LAYER_NAME`; KeyError for anything else."""
    own = name.removesuffix("_worst")
    return QUANTITIES[own if own in QUANTITIES else own.partition("_")[2]]


def known(numbers: Iterable[float | None]) -> list[float]:
    """Those that are."""
    return [number for number in numbers if number is not None]


def mean(numbers: Iterable[float | None]) -> float | None:
    """Of what is known; None where nothing is."""
    own = known(numbers)
    return float(np.mean(own)) if own else None


class Judged:
    """A record of a compared walk, whose numbers stand under their names."""

    def number(self, name: str) -> Any:
        """What it holds under this name; None for what it does not know."""
        return getattr(self, name, None)

    @property
    def error_bw(self) -> float | None:
        """The error that the walk is judged by."""
        error: float | None = self.number(JUDGED)
        return error

    @property
    def null_bw(self) -> float | None:
        """That of the null model."""
        error: float | None = self.number(NULL)
        return error

    @property
    def nearest_bw(self) -> float | None:
        """That of the nearest single curve."""
        error: float | None = self.number(STRETCHED)
        return error

    def __str__(self) -> str:
        """A line for each number that is known: label, unit, number."""
        return "\n".join(
            f"{own.heading:30}{own.form.format(own.scale * self.number(name)):>8}"
            for name, own in QUANTITIES.items()
            if own.form and self.number(name) is not None
        )


class Scored(Judged):
    """One with numbers in a mapping, by name."""

    scores: Mapping[str, Any]

    def number(self, name: str) -> Any:
        """What its `scores` or it itself holds under this name; None for what neither knows."""
        return self.scores.get(name, super().number(name))
