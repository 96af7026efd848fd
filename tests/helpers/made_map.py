"""A stiffness map without simulation: cells, held-out cells and draws of given functions of mass,
slope and fulcrum."""

from __future__ import annotations

import numpy as np

from vsf_drake.base.schema import to_plain
from vsf_drake.device.stiffness_map import FORMAT, MapTable, StiffnessMap, iso_22675
from vsf_drake.device.stiffness_map.cells import ROLLED
from vsf_drake.device.stiffness_map.surface import LoadRecord, MapQuantity
from vsf_drake.model.parameters import FootParameters
from vsf_drake.simulation.archive import provenance

LOAD = iso_22675(2e-3)
AXES = {
    "mass_kg": (50.0, 70.0, 90.0, 110.0),
    "slope_deg": (-6.0, -2.0, 2.0, 6.0),
    "fulcrum_mm": tuple(np.linspace(66.0, 151.0, 6).tolist()),
    "alignment_deg": (0.0,),
    "heel_ratio": (1.0,),
}
OTHERS = {
    "stiffness": lambda m, s, x: 10.0 + 0.2 * (x - 66.0) + 0 * m,
    "eflr": lambda m, s, x: 0.6 + 0.002 * (x - 66.0) + 0 * m,
    "moment_arm": lambda m, s, x: 0.5 * (x - 100.0) + s,
    "stored": lambda m, s, x: m / x,
    "returned": lambda m, s, x: 0.8 * m / x,
    "loading_rate": lambda m, s, x: 0.1 * m + 0 * x,
}


def made_map(radius, factors=(), unknown=False):
    """The map whose radius is `radius(mass, slope, fulcrum)`; each draw is every quantity times one
    of `factors`."""
    coarse = {name: tuple(dict.fromkeys((v[0], v[len(v) // 2], v[-1]))) for name, v in AXES.items()}
    functions = {**OTHERS, "radius": radius}
    rng = np.random.default_rng(0)
    held = np.column_stack([rng.uniform(v[0], v[-1], 10) for v in AXES.values()])

    def on(axes):
        m, s, x, _, _ = np.meshgrid(*axes.values(), indexing="ij")
        return {name: function(m, s, x) for name, function in functions.items()}

    arrays = {f"cells/{name}": values for name, values in on(AXES).items()}
    arrays |= {
        f"draws/{name}": np.array([f * values for f in factors]).reshape(-1, *values.shape)
        for name, values in on(coarse).items()
    }
    arrays |= {f"held_out/{name}": function(*held.T[:3]) for name, function in functions.items()}
    arrays |= {
        "held_out/at": held,
        **{f"load/{name}": getattr(LOAD, name) for name in ("time_s", "tilt_rad", "force_bw")},
    }
    units = {name: unit for name, (unit, _) in ROLLED.items()}
    table = MapTable(
        format=FORMAT,
        axes=AXES,
        coarse=coarse,
        unknown={"radius": 3} if unknown else {},
        quantities=tuple(
            MapQuantity(name=name, unit=unit, meaning="")
            for name, unit in units.items()
            if not (unknown and name == "radius")
        ),
        cells=96,
        not_followed=1,
        largest_residual=0.02,
        held_out=10,
        draws=len(factors),
        seed=0,
        load=LoadRecord(name="ISO 22675", duration_s=0.6, steps=300, shape_ends_s=0.4475),
        foot=to_plain(FootParameters()),
        provenance=provenance(),
        wall_s=0.0,
    )
    return StiffnessMap(StiffnessMap(table, arrays).judged(1.0), arrays)
