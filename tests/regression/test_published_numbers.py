"""Published numbers that the program finds: each with its source, a tolerance, and the reason for
the tolerance.

`pytest -m regression` runs these and the numbers that README and guides quote, before one trusts
the program.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest
from pydrake.multibody.plant import MultibodyPlant

import vsf_drake as vsf
from vsf_drake.laws.beam import combined_stiffness, lumped_stiffness
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.kelvin_voigt import normal_force
from vsf_drake.laws.stick_slip import STICK_SLIP
from vsf_drake.model.parameters import FootParameters, ModelParameters, SocketParameters
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.plants.foot import add_foot
from vsf_drake.walks.embedded import embedded_trials

MCGEEHAN = "McGeehan 2021, doi 10.1115/1.4050456"
GLANZER = "Glanzer & Adamczyk 2018, PMC6289620"
DE_LEVA = "de Leva 1996, J Biomech 29:1223-1230, means scaled to 78 kg and 1.81 m"
GERE = "Gere & Timoshenko, overhung beam"

pytestmark = pytest.mark.regression


@dataclass(frozen=True)
class Published:
    """A number as printed, where, how near the program has to come, and why so near."""

    what: str
    value: float
    tolerance: float
    unit: str
    source: str
    why: str
    group: str  # what makes it


PAPERS_OWN = "what the paper's own model left between its curves and the bench (RMSE)"
DIGITS = "half of the last printed digit"
ROWS = (
    Published(
        "forefoot stiffness, fulcrum at 66 mm", 10.0, 1.37, "N/mm", MCGEEHAN, PAPERS_OWN, "bench"
    ),
    Published(
        "forefoot stiffness, fulcrum at 151 mm", 32.0, 1.37, "N/mm", MCGEEHAN, PAPERS_OWN, "bench"
    ),
    Published("heel stiffness", 65.0, 0.5, "N/mm", MCGEEHAN, DIGITS, "bench"),
    Published("keel length", 0.229, 0.0005, "m", MCGEEHAN, DIGITS, "device"),
    Published("build height", 0.087, 0.0005, "m", GLANZER, DIGITS, "device"),
    Published("spheres under the foot", 24, 0, "1", MCGEEHAN, "a count", "device"),
    Published("sprung joints of the keel", 8, 0, "1", MCGEEHAN, "a count", "device"),
    Published("rigid pieces of the keel", 16, 0, "1", MCGEEHAN, "a count", "device"),
    Published("thigh mass", 11.045, 0.0005, "kg", DE_LEVA, DIGITS, "person"),
    Published("shank mass", 3.377, 0.0005, "kg", DE_LEVA, DIGITS, "person"),
    Published("foot mass", 1.069, 0.0005, "kg", DE_LEVA, DIGITS, "person"),
    Published("thigh length", 0.4389, 0.00005, "m", DE_LEVA, DIGITS, "person"),
    Published(
        "friction at the threshold, 100 N",
        50.0,
        1e-9,
        "N",
        MCGEEHAN,
        "the law reaches it there",
        "laws",
    ),
    Published(
        "friction far beyond it, 100 N", 30.0, 1e-9, "N", MCGEEHAN, "the law ends in it", "laws"
    ),
    Published(
        "normal force, eq. (1), n = 2, full damping",
        9.0,
        1e-9,
        "N",
        MCGEEHAN,
        "the equation by hand",
        "laws",
    ),
    Published("end of an overhung beam, load 100 N", 7.8225, 5e-5, "mm", GERE, DIGITS, "laws"),
    Published(
        "a fine chain of joints instead of the beam",
        7.8225,
        0.02,
        "mm",
        GERE,
        "1/1000 of it, 200 joints",
        "laws",
    ),
)


def bench() -> dict[str, float]:
    """As the paper pressed: slope above 200 N, platen at 30 mm from the tip; the heel by itself."""
    table = vsf.bench_table(vsf.run_bench(ModelParameters()))
    stiffness = {row.fulcrum_mm: row.stiffness_n_per_mm for row in table.settings}
    return {
        "forefoot stiffness, fulcrum at 66 mm": stiffness[66.0],
        "forefoot stiffness, fulcrum at 151 mm": stiffness[151.0],
        "heel stiffness": table.heel_stiffness_n_per_mm,
    }


def device() -> dict[str, float]:
    """The nominal foot under a mount that does not move, unloaded."""
    plant = MultibodyPlant(0.0)
    foot = add_foot(plant, plant.world_frame(), FootParameters())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    bottoms = [
        (plant.get_body(body).EvalPoseInWorld(context) @ p_BS)[2] - radius
        for body, p_BS, radius in zip(
            foot.sites.body_indices, foot.sites.p_BS, foot.sites.radius, strict=True
        )
    ]
    keel = FootParameters().keel
    return {
        "keel length": sum(keel.element_lengths_m),
        "build height": -min(bottoms),
        "spheres under the foot": len(bottoms),
        "sprung joints of the keel": len(keel.element_lengths_m),
        "rigid pieces of the keel": 2 * len(keel.element_lengths_m),
    }


def person() -> dict[str, float]:
    """The embedded subject, who has the paper's mass and stature; lengths by stature, as nobody
    measured them."""
    trial = vsf.load_trial(embedded_trials("exact")[0])
    body = scale_body(trial.subject, FootParameters(), SocketParameters())
    return {
        "thigh mass": body.thigh_mass,
        "shank mass": body.shank_mass,
        "foot mass": body.foot_mass,
        "thigh length": body.thigh_length,
    }


def laws() -> dict[str, float]:
    """k d^n + b d' with k 1e6 N/m^2, d 2 mm, b 50 N s/m, d' 0.1 m/s; a beam of 15 N m^2, 66 mm from
    pin to support, 100 N at 199 mm: F a^2 C / (3 E I) with a 133 mm."""
    friction = LawConstants(mu_static=0.5, mu_kinetic=0.3, threshold_velocity=0.1)
    beam = {"bending_stiffness": 15.0, "support": 0.066, "load_point": 0.199}
    rigid = {"fulcrum_stiffness": 1e15, "series_stiffness": 1e15}
    depth = LawConstants(stiffness=1e6, exponent=2.0, damping=50.0, full_damping_depth=1e-3)
    return {
        "friction at the threshold, 100 N": STICK_SLIP.per_speed(0.1, friction)[0] * 0.1 * 100.0,
        "friction far beyond it, 100 N": STICK_SLIP.per_speed(2.0, friction)[0] * 2.0 * 100.0,
        "normal force, eq. (1), n = 2, full damping": normal_force(2e-3, 0.1, depth)[0],
        "end of an overhung beam, load 100 N": 1e5 / combined_stiffness(**beam, **rigid),
        "a fine chain of joints instead of the beam": 1e5
        / lumped_stiffness(**beam, **rigid, element_lengths=(0.229 / 200,) * 200),
    }


MAKERS: tuple[Callable[[], dict[str, float]], ...] = (bench, device, person, laws)


@pytest.fixture(scope="module")
def found() -> dict[str, dict[str, float]]:
    """What the program finds, by group; each group is made when it is first asked for."""
    return {}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.what)
def test_published_number_is_found_again(row, found):
    if row.group not in found:
        found[row.group] = next(make for make in MAKERS if make.__name__ == row.group)()
    value = found[row.group][row.what]
    assert abs(value - row.value) <= row.tolerance, (
        f"{row.what}: {value:.5g} {row.unit}; {row.source} has {row.value:g}, allowed are "
        f"{row.tolerance:g}: {row.why}"
    )
