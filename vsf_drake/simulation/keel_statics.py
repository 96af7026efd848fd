"""The keel at rest under a vertical load on its load point, with exact derivatives.

The chain of the bench is pulled up by a spring so soft that where its end is sets the load, and advanced by the
implicit stepper without damping until nothing moves; then once more with the end moved by how far the load point
has risen, which makes the load exact. Steps freeze the pose at their start, so on the way they
are off by what the pose changes in one; at rest they are exact. Sensitivities are carried along and become at rest the
derivatives of the rest, whatever the path.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from vsf_drake.errors import SimulationError
from vsf_drake.laws.beam import combined_stiffness, section_inertia
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.simulation.mechanism import bench_mechanism
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS, SPRING_COLUMNS
from vsf_drake.simulation.stepping.carried import Carried
from vsf_drake.simulation.stepping.edit import Edit
from vsf_drake.simulation.stepping.stepper import Inputs, Record, Stepper

LOAD_SPRING = 1e-5
"""Stiffness of what pulls the keel up, over the keel's own."""
STEP_S = 1.0
"""Of the steps to rest: inertia has no part at this, 1e-9 of a joint's stiffness."""
HOLDS = 24, 400
"""Steps for which a load is held: usually enough; for feet near the end of what they bear."""
AT_REST_M, AT_REST = 1e-10, 1e-8
"""Of the load point in the last step, and of derivatives over themselves."""


class KeelStatics:
    """The keel on pin and fulcrum, pressed upwards at its load point.

    Args:
        foot: the keel of which, but for what `press` is given.
        loads_n: (n,) N, increasing.
        steps_per_mm: of the path to a load, in the travel that it takes if small; where it ends does not depend on it.
    """

    def __init__(self, foot: FootParameters, loads_n: np.ndarray, steps_per_mm: float) -> None:
        bench = make_bench(foot)
        self.foot, self.loads_n, self.steps_per_mm = foot, loads_n, steps_per_mm
        self.mechanism = bench_mechanism(bench, bench.diagram.CreateDefaultContext())
        self.carriage = self.mechanism.tree.index(bench.foot.carriage_joint_name)

    def press(self, fulcrum_m: float, modulus_pa: float, fulcrum_n_per_m: float) -> tuple[np.ndarray, np.ndarray]:
        """(n,) m, rise of the load point under each load, and (n, 2) its derivatives by modulus and support.

        Raises:
            SimulationError: the keel folds up under a load, or finds no rest.
        """
        try:
            for hold in HOLDS:
                rises, by, at_rest = self._press(fulcrum_m, modulus_pa, fulcrum_n_per_m, hold)
                if at_rest:
                    return rises, by
            raise SimulationError("it finds no rest", time_s=0.0)
        except SimulationError as error:
            raise SimulationError(f"the forefoot gives way under {self.loads_n[-1]:g} N with the fulcrum at "
                                  f"{1e3 * fulcrum_m:g} mm: {error.what}", time_s=0.0) from error

    def _press(
        self, fulcrum_m: float, modulus_pa: float, fulcrum_n_per_m: float, hold: int
    ) -> tuple[np.ndarray, np.ndarray, bool]:
        keel = self.foot.keel
        small = float(combined_stiffness(
            bending_stiffness=modulus_pa * section_inertia(keel.width_m, keel.thickness_m), support=fulcrum_m,
            load_point=self.foot.load_point_m, fulcrum_stiffness=fulcrum_n_per_m))
        spring = LOAD_SPRING * small
        stepper, edits = self._pulled_by(spring, modulus_pa, fulcrum_n_per_m)
        q, raised = np.zeros(self.mechanism.tree.num_coordinates), 0.0
        q[self.carriage] = fulcrum_m
        rises, by, at_rest = np.zeros(len(self.loads_n)), np.zeros((len(self.loads_n), 2)), True
        for i, load in enumerate(self.loads_n):
            travel = min((load / spring - raised) * LOAD_SPRING, self.foot.load_point_m)  # no keel goes further
            steps = math.ceil(self.steps_per_mm * 1e3 * travel)
            path = np.linspace(raised, load / spring, steps + 1)
            record = self._run(stepper, q, np.append(path, np.full(hold, path[-1])))
            raised = 2.0 * load / spring - record.site("depth")[-1, 0]
            record = self._run(stepper, record.q[-1], np.full(hold + 1, raised), edits)
            q, depth = record.q[-1], record.site("depth")[:, 0]
            force_by, before = record.wrench_by[-1, 5], record.wrench_by[-2, 5]
            at_rest &= bool(abs(depth[-1] - depth[-2]) <= AT_REST_M and record.converged[-1]
                            and np.all(np.abs(force_by - before) <= AT_REST * np.abs(force_by)))
            # The spring bears F = spring (raised - rise(F)): from the derivatives of F while its end stays follow
            # those of the rise while F stays, with 1 + spring rise' = depth / (dF / dspring).
            rises[i] = raised - depth[-1]
            by[i] = -force_by[:2] * depth[-1] / (force_by[2] * spring)
        return rises, by, at_rest

    def _pulled_by(
        self, spring: float, modulus_pa: float, fulcrum_n_per_m: float
    ) -> tuple[Stepper, tuple[Edit, Edit, Edit]]:
        """The keel on an elastic `spring` (N/m) without damping, and what units of modulus, support, spring add."""
        m = self.mechanism
        sites, springs, fulcrum = np.zeros_like(m.sites), np.zeros_like(m.springs), np.zeros_like(m.fulcrum)
        springs[:, :2], fulcrum[0] = m.springs[:, :2] / self.foot.keel.flexural_modulus_pa, 1.0
        sites[:, SITE_COLUMNS.index("stiffness")] = 1.0
        law, elastic = m.sites.copy(), m.springs.copy()
        for name, value in {"stiffness": spring, "exponent": 1.0, "damping": 0.0}.items():
            law[:, SITE_COLUMNS.index(name)] = value
        elastic[:, :2], elastic[:, SPRING_COLUMNS.index("damping")] = modulus_pa * springs[:, :2], 0.0
        pulled = dataclasses.replace(m, sites=law, springs=elastic, fulcrum=fulcrum_n_per_m * fulcrum)
        return Stepper(pulled), (Edit(springs=springs), Edit(fulcrum=fulcrum), Edit(sites=sites))

    def _run(self, stepper: Stepper, q0: np.ndarray, raised: np.ndarray, edits: tuple[Edit, ...] = ()) -> Record:
        """From rest at `q0` with the spring's end at heights `raised` (n + 1,) above where it is slack."""
        m, count, fulcrum = self.mechanism, len(raised), q0[self.carriage]
        inputs = Inputs(
            time_s=STEP_S * np.arange(count), prescribed=np.array([self.carriage]),
            prescribed_q=np.full((count, 1), fulcrum), fulcrum=np.full(count, fulcrum),
            ground=m.ground_height + raised)
        carried = Carried(edits=edits, measured=np.ones(len(m.sites), dtype=bool),
                          q0=np.zeros((len(q0), len(edits)))) if edits else None
        return stepper.run(inputs, q0, np.zeros_like(q0), carried=carried)
