"""The keel pulled up at its load point by a soft spring, advanced by the stepper until it rests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.simulation.bench import keel_shape
from vsf_drake.simulation.mechanism import bench_mechanism
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS, SPRING_COLUMNS
from vsf_drake.simulation.stepping.runs import Inputs
from vsf_drake.simulation.stepping.stepper import Stepper

SPRING = 1e-5
"""Stiffness of what pulls, over the keel's own."""


def rises(
    foot: FootParameters, loads_n: np.ndarray, fulcrum_m: float, support_width_m: float = 0.0
) -> np.ndarray:
    """(n,) m, rise of the load point under each load: steps of 1 s without damping, in which
    inertia has no part."""
    bench = make_bench(foot)
    m = bench_mechanism(bench, bench.diagram.CreateDefaultContext())
    carriage = m.tree.index(bench.foot.carriage_joint_name)
    guess = keel_shape(foot, fulcrum_m=fulcrum_m, load_n=float(loads_n[0])).load_point_K[1]
    spring = SPRING * loads_n[0] / guess
    sites, springs = m.sites.copy(), m.springs.copy()
    for name, value in {"stiffness": spring, "exponent": 1.0, "damping": 0.0}.items():
        sites[:, SITE_COLUMNS.index(name)] = value
    springs[:, SPRING_COLUMNS.index("damping")] = 0.0
    stepper = Stepper(
        replace(
            m,
            sites=sites,
            springs=springs,
            fulcrum=m.fulcrum * [1.0, 0.0],
            support_width=support_width_m,
        )
    )
    q, found, raised = np.zeros(m.tree.num_coordinates), [], 0.0
    q[carriage] = fulcrum_m
    for load in loads_n:
        rise = 0.0
        for _ in range(2):  # the second time further by how far the load point has risen
            path = np.append(
                np.linspace(raised, load / spring + rise, 60), np.full(60, load / spring + rise)
            )
            inputs = Inputs(
                time_s=1.0 * np.arange(len(path)),
                prescribed=np.array([carriage]),
                prescribed_q=np.full((len(path), 1), fulcrum_m),
                fulcrum=np.full(len(path), fulcrum_m),
                ground=m.ground_height + path,
            )
            record = stepper.run(inputs, q, np.zeros_like(q))
            q, raised = record.q[-1], path[-1]
            rise = raised - record.site("depth")[-1, 0]
        found.append(rise)
    return np.array(found)
