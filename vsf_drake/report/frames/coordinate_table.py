"""The table of all coordinates, with unit, name of a positive value, and what then moves where, as the model has it."""

from __future__ import annotations

import numpy as np

from vsf_drake.parameters import FootParameters
from vsf_drake.report.frames.foot_positions import DrawnFoot
from vsf_drake.report.frames.person_poses import STEP, Effect, effects, kind_of

BEGIN, END = "<!-- coordinates: begin (docs/make_pictures.py writes this table) -->", "<!-- coordinates: end -->"
BENDING = "bending of the keel"
HEAD = "| coordinate | unit | positive | what it moves, and where |\n|---|---|---|---|"


def coordinate_table() -> str:
    """The table as Markdown, from `BEGIN` to `END`."""
    lines = [BEGIN, "", HEAD]
    merged: dict[tuple[str, str], list[Effect]] = {}
    for effect in (*effects(), *foot_effects(FootParameters())):
        kind = "keel" if effect.positive == BENDING else kind_of(effect.name)
        merged.setdefault((kind, effect.direction), []).append(effect)
    for group in merged.values():
        named, first = [f"`{effect.name}`" for effect in group], group[0]
        names = f"{named[0]} … {named[-1]}" if len(named) > 2 else ", ".join(named)
        lines.append(f"| {names} | {first.unit} | {first.positive} | {first.point} {first.direction} |")
    return "\n".join([*lines, "", END])


def with_table(text: str) -> str:
    """`text` with the table as it is now.

    Raises:
        ValueError: `text` has no place for it.
    """
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"there is no {BEGIN} ... {END} in the text")
    return head + coordinate_table() + tail


def foot_effects(parameters: FootParameters) -> tuple[Effect, ...]:
    """What the foot's own coordinates do: the pin, the sprung joints, the carriage."""
    drawn = DrawnFoot(parameters)
    rest = drawn.positions(parameters.fulcrum.rearmost_m)
    found = []
    for i, name in enumerate(drawn.foot.keel_joint_names):
        angles = np.zeros(len(drawn.foot.keel))
        angles[i] = STEP
        rises = (drawn.positions(parameters.fulcrum.rearmost_m, angles).tip - rest.tip)[2] > 0.0
        found.append(Effect(name, "rad", BENDING if i else "turn about A", "toe", "up" if rises else "down"))
    ahead = (drawn.positions(parameters.fulcrum.rearmost_m + STEP).carriage - rest.carriage)[0] > 0.0
    found.append(Effect(drawn.foot.carriage_joint_name, "m", "distance from A", "carriage",
                        "forward" if ahead else "backward"))
    return tuple(found)
