"""Feet as two supports each, heel and forefoot, that stay where they are put while they carry
load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from virtual_laboratory.body import DEVICE, INTACT_FOOT
from virtual_laboratory.fitting import Targets
from virtual_laboratory.motion import Linearised, Person
from virtual_laboratory.targets import Draw, roll_over

DEVICE_REAR_M, DEVICE_HEEL_M, DEVICE_FOREFOOT_M = -0.012, 0.018, 0.195
"""The sole's rear end, and where the prosthesis's load passes from and to, from the keel's end
A."""
HEEL_N_PER_M = 65e3
FOREFOOT_N_PER_M = {"low": 10.0e3, "medium": 17.3e3, "high": 32.0e3, "passive": 45.0e3}
"""Where the fit starts from, of the reference subject: bench stiffness, heel published, forefoot
published at both ends and by beam theory between; of a passive foot a choice."""
SOCKET_N_PER_M, SOCKET_NM_PER_RAD = 1e5, 1e3
INTACT_HEEL, INTACT_FOREFOOT = 0.14, 0.78
"""The same of the intact foot, in foot lengths from its heel."""
INTACT_HEEL_N_PER_M, INTACT_FOREFOOT_N_PER_M = 76e3, 150e3
"""Of the spheres of the model's intact foot there: three of 25.5 N/mm, and six."""
LOADED_N, FULL_N = 15.0, 120.0
"""A support is not held below the first load and fully from the second on."""


@dataclass(frozen=True)
class Support:
    """A point of a foot and where it shall be.

    Attributes:
        segment: index into `motion.SEGMENTS`; p_B: (N, 3) m in it, deflection included.
        p_W: (3,) m on the floor; load_n: (N,) N that it carries.
    """

    segment: int
    p_B: np.ndarray
    p_W: np.ndarray
    load_n: np.ndarray


def anchor(targets: Targets, body: Linearised, support: Support, sigma_m: float) -> None:
    """Asks that the support be in its place while it is loaded."""
    p_W, J = body.point(support.segment, support.p_B)
    share = np.clip((support.load_n - LOADED_N) / (FULL_N - LOADED_N), 0.0, 1.0)
    width = np.where(share > 0.0, sigma_m / np.maximum(share, 0.05), np.inf)
    targets.pose(J, support.p_W - p_W, width[:, None])


def _shares(
    draw_delay: float, part: np.ndarray, load_n: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    toe = np.clip(roll_over(part, draw_delay), 0.0, 1.0)
    return (1.0 - toe) * load_n, toe * load_n


def device_supports(
    person: Person, draw: Draw, load_n: np.ndarray, time_s: np.ndarray
) -> list[Support]:
    """The prosthesis's in its stance and in the next, a stride apart; the sole's first rear end at
    x = 0, the middle half a step width to the right; turned out."""
    lever = DEVICE_FOREFOOT_M - person.model.foot.pylon_x_m
    toe_stiffness = 1.0 / (1.0 / FOREFOOT_N_PER_M[draw.condition] + lever**2 / SOCKET_NM_PER_RAD)
    found = []
    turn = np.radians(draw.toe_out_deg)
    for strike_s in (0.0, draw.stride_s):
        on = np.where(
            np.abs(time_s - strike_s - 0.5 * draw.stance_s) < 0.5 * draw.stride_s, load_n, 0.0
        )
        heel_n, toe_n = _shares(draw.roll_over, (time_s - strike_s) / draw.stance_s, on)
        for x, load, stiffness in (
            (DEVICE_HEEL_M, heel_n, HEEL_N_PER_M),
            (DEVICE_FOREFOOT_M, toe_n, toe_stiffness),
        ):
            # less between the two, where the keel is held
            sunk = load**2 / np.maximum(on, 1.0) / stiffness
            p_B = np.column_stack(
                [
                    np.full(len(load), x),
                    np.zeros(len(load)),
                    person.sole_height + sunk + on / SOCKET_N_PER_M,
                ]
            )
            along, ahead = x - DEVICE_REAR_M, x - 0.5 * (DEVICE_HEEL_M + DEVICE_FOREFOOT_M)
            p_W = np.array(
                [
                    draw.speed_m_per_s * strike_s + along * np.cos(turn),
                    -0.5 * draw.step_width_m - ahead * np.sin(turn),
                    0.0,
                ]
            )
            found.append(Support(DEVICE, p_B, p_W, load))
    return found


def intact_supports(
    person: Person, draw: Draw, load_n: np.ndarray, time_s: np.ndarray
) -> list[Support]:
    """The intact foot's in the stance before and after, a stride apart."""
    length, body = person.handles.body.foot_length, person.handles.body
    turn = np.radians(draw.toe_out_deg)
    heel_x = -person.model.intact_foot.ankle_x_ratio * length
    found = []
    for strike_s in (draw.intact_strike_s - draw.stride_s, draw.intact_strike_s):
        part = (time_s - strike_s) / (draw.intact_duty * draw.stride_s)
        on = np.where((part > 0.0) & (part < 1.0), load_n, 0.0)
        heel_n, toe_n = _shares(0.0, part, on)
        for ratio, load, stiffness in (
            (INTACT_HEEL, heel_n, INTACT_HEEL_N_PER_M),
            (INTACT_FOREFOOT, toe_n, INTACT_FOREFOOT_N_PER_M),
        ):
            p_B = np.column_stack(
                [
                    np.full(len(load), heel_x + ratio * length),
                    np.zeros(len(load)),
                    -body.ankle_height + load / stiffness,
                ]
            )
            along, ahead = ratio * length, (ratio - 0.5 * (INTACT_HEEL + INTACT_FOREFOOT)) * length
            p_W = np.array(
                [
                    draw.speed_m_per_s * strike_s + along * np.cos(turn),
                    0.5 * draw.step_width_m + ahead * np.sin(turn),
                    0.0,
                ]
            )
            found.append(Support(INTACT_FOOT, p_B, p_W, load))
    return found


def target_centre(person: Person, draw: Draw, time_s: np.ndarray) -> np.ndarray:
    """(N, 2) m, wished centre of pressure of the prosthesis on the floor; in swing it moves on to
    the next stance."""
    rest = device_supports(person, draw, np.zeros(len(time_s)), time_s)
    paths = []
    for strike_s, heel, toe in ((0.0, *rest[:2]), (draw.stride_s, *rest[2:])):
        along = roll_over((time_s - strike_s) / draw.stance_s, draw.roll_over)
        paths.append(heel.p_W[:2] + np.outer(along, (toe.p_W - heel.p_W)[:2]))
    x = np.clip((time_s - draw.stance_s) / (draw.stride_s - draw.stance_s), 0.0, 1.0)
    share = (x**3 * (10.0 - 15.0 * x + 6.0 * x**2))[:, None]
    return np.asarray((1.0 - share) * paths[0] + share * paths[1])
