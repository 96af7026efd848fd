"""In plants with a time step: supports that follow their fulcrum positions while a Simulator runs."""

from __future__ import annotations

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from vsf_drake.errors import InputError
from vsf_drake.plants.discrete_foot import place_fulcrum, support_of
from vsf_drake.plants.foot_wiring import WiredFoot

MOVED_M = 1e-9
"""Travel below which a support stays."""


def follow_fulcrum(simulator: Simulator, plant: MultibodyPlant, *feet: WiredFoot) -> None:
    """Makes the supports of `feet` follow their fulcrum positions: sets the simulator's monitor.

    In a plant with a time step a support has its place in the Context, so somebody must move it between steps. A
    monitor of your own goes on working if it is set before this: it is called first, and what it returns counts.

    Raises:
        InputError: a foot is not what `wire_foot` returned, or not in a plant with a time step.
    """
    for wired in feet:
        if not hasattr(wired, "command"):
            raise InputError(f"is a {type(wired).__name__}", where="feet", right="Give what wire_foot returned")
        support_of(wired.foot)
    earlier = simulator.get_monitor()

    def monitor(root: Context) -> EventStatus | None:
        status = earlier(root) if earlier else None
        for wired in feet:
            own = wired.command.GetMyContextFromRoot(root)
            wanted = float(wired.command.GetOutputPort("position").Eval(own)[0])
            plant_context = plant.GetMyMutableContextFromRoot(root)
            stands = plant.GetDistanceConstraintParams(plant_context, support_of(wired.foot)).p_BQ()[0]
            if abs(wanted - stands) > MOVED_M:
                place_fulcrum(plant, plant_context, wired.foot, wanted)
        return status

    simulator.set_monitor(monitor)
    monitor(simulator.get_mutable_context())
