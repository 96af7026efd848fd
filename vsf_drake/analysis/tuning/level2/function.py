"""The sagittal person as a function of one instant, in the form that collocation takes.

Outputs are those of `SagittalModel.evaluate`; FOOT_cop_moment, the ground's moment (N m) about +y at the recorded
centre of pressure; q_* and a_*, the coordinates and their accelerations themselves. The latter are for terms that
compare with a recording.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vsf_drake.analysis.collocation.grid import Layout
from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import SagittalModel
from vsf_drake.simulation.sagittal.smooth_laws import Smoothing


class StrideFunction:
    """Outputs y (N, m) of z (N, Z), p (4,), see `collocation.problem.InstantFunction`.

    Attributes:
        layout: q, v, a; w, u. names: (m,) of the outputs.
    """

    def __init__(self, model: SagittalModel, smoothing: Smoothing, cop_x: Mapping[str, np.ndarray]) -> None:
        """`cop_x`: by foot (N,) m, where the recorded centre of pressure is at every instant."""
        self.model, self.smoothing, self.cop_x = model, smoothing, dict(cop_x)
        self.layout = Layout(coordinates=model.coordinates, quasi_static=model.quasi_static)
        self.names = (*model.outputs, *(f"{foot}_cop_moment" for foot in self.cop_x),
                      *(f"{kind}_{name}" for kind in "qa" for name in model.coordinates))

    def index(self, *names: str) -> list[int]:
        """Places of outputs."""
        return [self.names.index(name) for name in names]

    def starting_with(self, start: str) -> list[int]:
        """Places of all outputs whose name begins so."""
        return [i for i, name in enumerate(self.names) if name.startswith(start)]

    def evaluate(self, z: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(N, m)."""
        y = self.model.evaluate(*self._parts(z), np.repeat(p[:, None], len(z), 1), self.smoothing).T
        return np.concatenate([y, *self._cop_moments(y), self._own(z)], axis=1)

    def linearise(self, z: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(N, m), (N, m, Z), (N, m, P)."""
        y, by = linearise(self.model, *self._parts(z), np.repeat(p[:, None], len(z), 1), self.smoothing)
        y, by = y.T, by.transpose(2, 0, 1)
        size, n = self.layout.size, self.layout.n
        moments_by = [by[:, my] + x[:, None] * by[:, fz] for my, fz, x in self._feet()]
        by = np.concatenate([by, *(part[:, None] for part in moments_by)], axis=1)
        by_z = np.concatenate([by[:, :, :size], np.zeros((len(z), 2 * n, size))], axis=1)
        by_z[:, -2 * n:-n, self.layout.q] = by_z[:, -n:, self.layout.a] = np.eye(n)
        by_p = np.concatenate([by[:, :, size:], np.zeros((len(z), 2 * n, len(p)))], axis=1)
        return np.concatenate([y, *self._cop_moments(y), self._own(z)], axis=1), by_z, by_p

    def _own(self, z: np.ndarray) -> np.ndarray:
        return np.concatenate([z[:, self.layout.q], z[:, self.layout.a]], axis=1)

    def _feet(self) -> list[tuple[int, int, np.ndarray]]:
        outputs = self.model.outputs
        return [(outputs.index(f"{foot}_my"), outputs.index(f"{foot}_fz"), x) for foot, x in self.cop_x.items()]

    def _cop_moments(self, y: np.ndarray) -> list[np.ndarray]:
        return [(y[:, my] + x * y[:, fz])[:, None] for my, fz, x in self._feet()]

    def _parts(self, z: np.ndarray) -> list[np.ndarray]:
        layout = self.layout
        return [np.ascontiguousarray(z[:, part].T) for part in (layout.q, layout.v, layout.a, layout.w, layout.u)]
