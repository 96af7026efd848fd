"""What is tuned with a motion that adapts: one stride of one person, a cost, and how it is solved for."""

from __future__ import annotations

from collections.abc import Sequence

from vsf_drake.analysis.tuning.level2.options import COSTS, WEIGHTED, StrideOptions
from vsf_drake.analysis.tuning.level2.stride import MM, Stride
from vsf_drake.analysis.tuning.recorded_stride import recorded_stride
from vsf_drake.errors import InputError
from vsf_drake.motion.trial_record import Trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.walk import Walker


class StrideTuning:
    """The fulcrum's position, and design variables, that with the best motion for them minimise a cost.

    Args:
        trials: one trial with its fitted contact applied; the stride is the one around its prosthetic stance.
        cost: of COSTS or WEIGHTED. options: how. labels: of the trial.

    Raises:
        InputError: there is not exactly one trial; the cost is none; the recording holds no whole stride, or no plate
            of the prosthetic foot; the prosthesis is turned out of the sagittal plane; the range of the fulcrum is
            out of the carriage's reach.
    """

    def __init__(
        self, trials: Sequence[Trial], *, cost: str, options: StrideOptions | None = None,
        labels: Sequence[str] | None = None
    ) -> None:
        if len(trials) != 1:
            raise InputError(f"{len(trials)} trials are given", where="trials",
                             right="A free motion is solved for one recorded stride at a time: give one")
        if cost not in (*COSTS, WEIGHTED):
            raise InputError(f"{cost!r} is no cost", where="cost", right=f"There are: {', '.join((*COSTS, WEIGHTED))}")
        self.trial, self.cost, self.options = trials[0], cost, options or StrideOptions()
        self.label = labels[0] if labels else self.trial.name
        self.walker = Walker(self.trial.subject, self.trial.model)
        recorded = recorded_stride(self.trial, self.walker)
        body = scale_body(self.trial.subject, self.trial.model.foot, self.trial.model.socket)
        self.stride = Stride(
            model=SagittalModel(self.walker, offsets=self.trial.offsets), recorded=recorded,
            own_m=self.trial.fulcrum_m, leg_m=body.thigh_length + body.shank_length, options=self.options)
        low, high = self.stride.reach_mm
        fulcrum = self.trial.model.foot.fulcrum
        if not fulcrum.rearmost_m / MM - 1e-6 <= low < high <= fulcrum.foremost_m / MM + 1e-6:
            raise InputError(f"{low:g} to {high:g} mm is out of the carriage's reach", where="bounds_mm",
                             right=f"It must lie within {fulcrum.rearmost_m / MM:g} to {fulcrum.foremost_m / MM:g} mm")
        self.grid = self.stride.grid()
