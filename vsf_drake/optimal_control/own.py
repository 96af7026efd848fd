"""A person's own stride as a function of the setting: what a stride that adapts is held to where
walks at two settings or more were recorded.

Over the phase of the cycle, 0 the prosthetic foot's strike, angles, path of the pelvis and forces
of both feet are means of a setting's walks, linear in the fulcrum between settings
(`walks.between_settings`), and so is the stride's time. The speed is one, the mean over settings:
what walking faster costs is not the foot's. Such a mean is no possible motion of the model; the
stride is held to the possible one nearest to it at the same position (`Hold`), so that the hold
costs nothing there at any of these positions and favours none. Deviations count in standard
deviations between walks of one setting, no less than what a laboratory sees (`tuning.common.SEEN`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsf_drake.base.sentences import say
from vsf_drake.collocation.problem import Grid
from vsf_drake.optimal_control.normal import ANGLES, without_side
from vsf_drake.optimal_control.recorded_curves import Span
from vsf_drake.optimal_control.recorded_projection import TX
from vsf_drake.optimal_control.recorded_stride import RecordedStride
from vsf_drake.optimal_control.reference import (
    FEET,
    LOADED_N,
    StrideReference,
    phases_of,
    stride_reference,
)
from vsf_drake.tuning.common import SEEN, SEEN_SHARE
from vsf_drake.walks.answer import Answer
from vsf_drake.walks.between_settings import between_settings

SPREAD_PHASES = 200


@dataclass(frozen=True, eq=False)
class Spread:
    """Standard deviations."""

    angles_rad: np.ndarray  # (8,) of the coordinates, infinite of those that are no angles
    forces_n: dict[str, np.ndarray]  # by foot (2,) along and up
    time: float  # of a stride, over its mean


@dataclass(frozen=True, eq=False)
class OwnStrides:
    """Recorded strides of one person at two settings or more."""

    answer: Answer  # how the person answers the setting
    strides: tuple[RecordedStride, ...]  # of its walks
    weight_n: float  # of the body

    @property
    def middle_m(self) -> float:
        """The most central setting."""
        settings = self.answer.settings_m
        return float(settings[np.argmin(np.abs(settings - settings[[0, -1]].mean()))])

    @property
    def speed(self) -> float:
        """m/s, mean over settings."""
        speeds = np.array([stride.advance_m / stride.period_s for stride in self.strides])
        return float(np.mean([speeds[walks].mean() for walks in self.answer.settings]))

    def period_s(self, fulcrum_m: float) -> float:
        return float(self._at(fulcrum_m, [stride.period_s for stride in self.strides]))

    def _at(self, fulcrum_m: float, values: Sequence[np.ndarray | float]) -> np.ndarray:
        return between_settings(self.answer.fulcrum_m, np.array(values), fulcrum_m)

    def positions_mm(self, reach_mm: tuple[float, float], count: int) -> list[float]:
        """About `count` positions over a range, its ends and the recorded settings among them, the
        others evenly between these."""
        inside = [mm for mm in 1e3 * self.answer.settings_m if reach_mm[0] < mm < reach_mm[1]]
        edges = np.array([reach_mm[0], *inside, reach_mm[1]])
        spacing = (reach_mm[1] - reach_mm[0]) / (count - 1)
        found = [reach_mm[0]]
        for low, high in pairwise(edges):
            parts = max(1, round((high - low) / spacing))
            found += np.linspace(low, high, parts + 1)[1:].tolist()
        return [round(mm, 9) for mm in found]

    def drawn(self, rng: np.random.Generator) -> OwnStrides:
        """As many walks of every setting, drawn from its own with replacement."""
        walks = np.concatenate([rng.choice(own, len(own)) for own in self.answer.settings])
        answer = dataclasses.replace(self.answer, walks=tuple(self.answer.walks[i] for i in walks))
        return OwnStrides(answer, tuple(self.strides[i] for i in walks), self.weight_n)

    def reference(
        self, fulcrum_m: float, grid: Grid, advance_m: float, late_share: float
    ) -> StrideReference:
        """The mean stride at a position, in the frame of a grid (see `stride`) in whose time the
        pelvis gets on by `advance_m`."""
        phase = grid.times_s / grid.duration_s
        speed = advance_m / grid.duration_s
        walks = [
            stride_reference(stride, phase * stride.period_s, late_share) for stride in self.strides
        ]
        # In the grid's frame the way of every walk is that of the one speed.
        ways = [
            walk.q[0, TX] + (stride.advance_m - advance_m) * phase
            for walk, stride in zip(walks, self.strides, strict=True)
        ]
        along = np.eye(walks[0].q.shape[1])[TX]
        periods = np.array([stride.period_s for stride in self.strides])
        rates = np.array([walk.v for walk in walks]) * periods[:, None, None]
        rates[:, :, TX] -= np.array([stride.advance_m for stride in self.strides])[:, None]
        bends = np.array([walk.a for walk in walks]) * periods[:, None, None] ** 2
        period = self.period_s(fulcrum_m)
        force = {}
        cop = {}
        moment = {}
        known = {}
        for foot in FEET:
            force[foot] = self._at(fulcrum_m, [walk.force[foot] for walk in walks])
            seen = self._at(fulcrum_m, [1.0 * walk.known[foot] for walk in walks])
            known[foot] = seen > 1.0 - 1e-9
            up = force[foot][:, 1]
            turning = self._at(
                fulcrum_m,
                [
                    walk.force[foot][:, 1] * (walk.cop_x[foot] - way)
                    for walk, way in zip(walks, ways, strict=True)
                ],
            )
            cop[foot] = np.where(up > LOADED_N, turning / np.maximum(up, LOADED_N), 0.0)
            moment[foot] = cop[foot] * up - turning
        return StrideReference(
            q=self._at(
                fulcrum_m,
                [walk.q - np.outer(way, along) for walk, way in zip(walks, ways, strict=True)],
            ),
            v=self._at(fulcrum_m, rates) / period + speed * along,
            a=self._at(fulcrum_m, bends) / period**2,
            force=force,
            cop_x=cop,
            moment=moment,
            known=known,
            **phases_of(self._spans(fulcrum_m), phase, 1.0, late_share),
        )

    def _spans(self, fulcrum_m: float) -> dict[str, Span | None]:
        """Stances by foot, in shares of the cycle; None of a foot that some walk lacks."""
        spans: dict[str, Span | None] = dict.fromkeys(FEET)
        for foot in FEET:
            own = [getattr(stride, f"{foot}_stance") for stride in self.strides]
            if None not in own:
                shares = [
                    np.array(span) / stride.period_s
                    for span, stride in zip(own, self.strides, strict=True)
                ]
                start, end = self._at(fulcrum_m, shares)
                spans[foot] = float(start), float(end)
        return spans

    @cached_property
    def sd(self) -> Spread:
        """What counts as one: the spread, at least what is seen of it."""
        held = [without_side(name) in ANGLES for name in self.strides[0].names]
        least_n = SEEN["BW"] * self.weight_n
        spread = self.spread or Spread(np.zeros(len(held)), dict.fromkeys(FEET, np.zeros(2)), 0.0)
        return Spread(
            np.where(held, np.maximum(spread.angles_rad, np.radians(SEEN["deg"])), np.inf),
            {foot: np.fmax(force, least_n) for foot, force in spread.forces_n.items()},
            max(spread.time, SEEN_SHARE),
        )

    @cached_property
    def spread(self) -> Spread | None:
        """Between walks of one setting, pooled over settings, root mean square over the cycle; NaN
        where a force is not known, None where no setting was walked twice."""
        if len(self.strides) == len(self.answer.settings):
            return None
        phase = np.arange(SPREAD_PHASES) / SPREAD_PHASES

        def pooled(values: Sequence[np.ndarray]) -> np.ndarray:
            spread = self.answer.spread_of(np.array(values))
            assert spread is not None
            known = spread[np.isfinite(spread).all(axis=1)]
            return np.asarray(np.sqrt(np.mean(known**2, axis=0)) if len(known) else spread[0])

        periods = np.array([[[s.period_s]] for s in self.strides])
        return Spread(
            pooled([s.sample(phase * s.period_s)[0] for s in self.strides]),
            {
                foot: pooled([s.measured(foot, phase * s.period_s)[0][:, :2] for s in self.strides])
                for foot in FEET
            },
            float(pooled(periods / periods.mean())[0]),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader has to know, in sentences."""
        sd = self.sd
        known = np.isfinite(sd.angles_rad)
        failed = sum("NOT CONVERGE" in note for s in self.strides for note in s.notes)
        return tuple(
            say(
                "stride",
                "own_strides",
                walks=len(self.strides),
                settings_mm=1e3 * self.answer.settings_m,
                speed=self.speed,
                spread=self.spread is not None,
                angles_deg=np.degrees(sd.angles_rad[known]),
                forces_bw=np.concatenate(list(sd.forces_n.values())) / self.weight_n,
                time=sd.time,
                least=SEEN,
                least_share=SEEN_SHARE,
                failed=failed,
            )
        )


@dataclass(frozen=True, eq=False)
class Hold:
    """What a stride is held to, as a function of the position: the possible motions nearest to the
    person's own at K of them, by monotone cubics in between."""

    at_m: np.ndarray  # (K,) rising
    names: tuple[str, ...]  # (c,) outputs of a stride's function
    targets: np.ndarray  # (K, N, c)

    @cached_property
    def _curves(self) -> tuple[Callable[[float], np.ndarray], Callable[[float], np.ndarray]]:
        curve = PchipInterpolator(self.at_m, self.targets, axis=0)
        return curve, curve.derivative()

    def at(self, fulcrum_m: float, rows: int) -> tuple[np.ndarray, np.ndarray]:
        """(rows, c) the targets, and their derivatives by the position (1/m), of instants that
        are given several times over."""
        many = rows // self.targets.shape[1], 1
        value, slope = (np.tile(curve(fulcrum_m), many) for curve in self._curves)
        return value, slope
