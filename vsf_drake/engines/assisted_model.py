"""A muscle-driven leg with the foot, as `assist_sim` compiled it from the device of
`engines.assist_sim`: what only the compiled model can be given. Needs MuJoCo, and no Drake."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from vsf_drake.base.errors import require
from vsf_drake.mujoco import calibrate

if TYPE_CHECKING:
    import mujoco

DEVICE = "VSF"
"""The device's name in `assist_sim`; with "_" it begins the names of all its parts in the model."""
LONGEST_STEP = "longest_step_s"
"""Of the custom numeric that says up to which step (s) the device is steady."""
PARTS = ("foot", "toes")
"""Of a foot, as the legs' touch sensors name them: here what lies behind the fulcrum and before."""
_IMPLICIT = (2, 3)  # mjtIntegrator: implicit and implicitfast


def prepare(model: mujoco.MjModel) -> None:
    """Gives the foot's spheres the law of their foam (`vsf_drake.mujoco.calibrate`).

    It belongs to the model's time step: call it again after a change. The integrator, the step and
    the friction cone are those of the whole model and are not changed; `impratio` 5 is advised.

    Raises:
        InputError: no device in `model`; an integrator or a time step with which the foot is not
            steady; what `calibrate` refuses, such as the pyramidal cone.
    """
    name = f"{DEVICE}_{LONGEST_STEP}"
    require(
        name in [model.numeric(i).name for i in range(model.nnumeric)],
        "holds no variable-stiffness foot",
        "model",
        "Combine a leg with the device that vsf_drake.engines.assist_sim writes",
    )
    longest_s = model.numeric(name).data[0]
    right = (
        "It must be mujoco.mjtIntegrator.mjINT_IMPLICITFAST or mjINT_IMPLICIT, with a timestep of "
        f"{longest_s:g} s or less: the keel is stiff for its weight"
    )
    require(
        model.opt.integrator in _IMPLICIT,
        "is explicit: the foot bursts",
        "opt.integrator",
        right,
    )
    require(
        model.opt.timestep <= longest_s,
        f"is {model.opt.timestep:g} s: the foot is not steady",
        "opt.timestep",
        right,
    )
    calibrate(model)


def touch_sums(model: mujoco.MjModel) -> Callable[[mujoco.MjData], None]:
    """A function of the model's data that makes the legs' own touch sensors, such as r_foot and
    r_toes, the sum (N) of those of the foot's bodies. Call it after a step, before they are read.

    MuJoCo's touch sensor feels the contacts of one body, and a keel that bends has many.

    Raises:
        InputError: no touch sensor of the device in `model`.
    """
    names = [model.sensor(i).name for i in range(model.nsensor)]
    sums = []
    for total in (f"{side}_{part}" for side in "rl" for part in PARTS):
        parts = [name for name in names if name.startswith(f"{total}_")]
        if parts:
            sums.append((model.sensor(total).adr, [model.sensor(part).adr[0] for part in parts]))
    require(
        sums,
        "holds no touch sensors of a variable-stiffness foot",
        "model",
        "Combine a leg with the device that vsf_drake.engines.assist_sim writes",
    )

    def sum_up(data: mujoco.MjData) -> None:
        for total, parts in sums:
            data.sensordata[total] = data.sensordata[parts].sum()

    return sum_up
