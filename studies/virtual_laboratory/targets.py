"""What each trial aims at: random draws of how somebody walks, and the forces that go with them.

Nothing here is measured. Ranges are those usually given for the prosthetic side of people with one
transtibial prosthesis who walk at 1.0 to 1.2 m/s (vertical peaks 1.0 to 1.1 BW, trough 0.78 to
0.88, braking 0.10 to 0.14, propulsion 0.08 to 0.13, step width 0.12 to 0.16 m, stance knee flexion
5 to 12 degrees: textbook knowledge, not traced to one source). Stance times are published (McGeehan
2021, doi 10.1115/1.4050456).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.stats import norm

from vsf_drake.model.parameters import GRAVITY

CONDITIONS: dict[str, float | None] = {"low": 66.0, "medium": 108.0, "high": 151.0, "passive": None}
"""Fulcrum position (mm) by name of the published condition; none of a passive foot."""
SETTINGS = ("low", "medium", "high")
TRIALS_PER_CONDITION = 3
YIELDING = {"low": 0.06, "medium": 0.03, "high": 0.0, "passive": 0.0}
"""Parts of stance by which the centre of pressure passes later along a softer forefoot."""
STANCE_S = {"low": (0.73, 0.02), "medium": (0.79, 0.01), "high": (0.71, 0.02)}
"""Published stance time of the prosthetic foot, mean and standard deviation (s)."""
SPREAD = {
    "speed_m_per_s": (0.0, 0.02),
    "duty": (0.604, 0.008),
    "intact_duty": (0.64, 0.008),
    "intact_step": (0.508, 0.006),
    "step_width_m": (0.137, 0.007),
    "toe_out_deg": (6.0, 1.5),
    "tilt_deg": (0.0, 1.5),
    "list_scale": (1.0, 0.15),
    "rotation_scale": (1.0, 0.2),
    "knee_loading_deg": (7.0, 1.0),
    "first_peak_bw": (1.04, 0.02),
    "trough_bw": (0.83, 0.025),
    "second_peak_bw": (1.04, 0.02),
    "loading": (0.0, 0.008),
    "first_peak_at": (0.25, 0.02),
    "trough_at": (0.48, 0.015),
    "second_peak_at": (0.76, 0.015),
    "unloading": (0.0, 0.006),
    "braking_bw": (0.12, 0.010),
    "propulsion_bw": (0.105, 0.010),
    "lateral_bw": (0.045, 0.006),
    "intact_first_peak_bw": (1.08, 0.05),
    "intact_trough_bw": (0.79, 0.025),
    "intact_second_peak_bw": (1.07, 0.05),
    "roll_over": (0.0, 0.02),
}
"""Mean and standard deviation between trials of one person, per `Draw`'s field: choices, of the
size of what differs from stride to stride in people (a few per cent of body weight, of the cycle
and of a step), not measured ones. The mean of intact_step makes steps of prosthetic / intact length
0.97 (doi 10.1097/PXR.0000000000000079)."""
SHAPING = (
    "duty",
    "intact_duty",
    "intact_step",
    "first_peak_bw",
    "trough_bw",
    "second_peak_bw",
    "loading",
    "first_peak_at",
    "trough_at",
    "second_peak_at",
    "unloading",
    "intact_first_peak_bw",
    "intact_trough_bw",
    "intact_second_peak_bw",
)
"""Of these, what shapes the vertical force over a stride."""
BY_SPEED = {
    "duty": -0.062,
    "intact_duty": -0.062,
    "knee_loading_deg": 6.8,
    "first_peak_bw": 0.286,
    "trough_bw": -0.262,
    "second_peak_bw": 0.119,
    "braking_bw": 0.124,
    "propulsion_bw": 0.097,
    "intact_first_peak_bw": 0.286,
    "intact_trough_bw": -0.262,
    "intact_second_peak_bw": 0.119,
}
"""How these means change per m/s from REFERENCE_SPEED_M_PER_S on: as between the able-bodied groups
slow (0.88 m/s) and free (1.30 m/s with a leg of 0.93 m) of Schwartz 2008 (doi
10.1016/j.jbiomech.2008.03.015); braking, propulsion and knee flexion in proportion to their smaller
means here."""
REFERENCE_SPEED_M_PER_S = 1.1
CADENCE = ((0.172, 0.290, 0.429, 0.560, 0.694), (0.337, 0.455, 0.565, 0.662, 0.758))
"""Speed / sqrt(g L) and steps per s times sqrt(L / g), L the leg's length: groups of Schwartz
2008."""
MORE_STEPS = 1.033
"""Cadence of people with a prosthesis to theirs: 109.8 steps/min at 1.22 m/s (doi
10.1097/PXR.0000000000000079)."""
TIMED_SD = 0.015
"""Standard deviation (parts) of the stance time at a given speed (a choice)."""
LEG_M, REFERENCE_STATURE_M = 0.93, 1.81
"""Leg of the persons whose curves these are, taken for the reference subject's; longer and shorter
ones step in proportion."""
LOADED_BW = 40.0 / (78.0 * 9.81)
"""Vertical force at which a wished stance begins and ends: 40 N of the reference subject's weight,
as a plate that is read from 20 N on sees some milliseconds more of it."""
MEAN_SPEED_M_PER_S, MEAN_STANCE_S, SPEED_PER_STANCE = 1.10, 0.743, 0.8
"""Faster (m/s) by 0.8 per second of shorter stance, about the mean of the published stance times:
1.0 to 1.2 m/s."""
RISE_M, CONDITIONED = (2e-3, 2.5e-3, 3e-3), 6
"""Tolerated amplitudes (m) of the centre of mass's height, once to three times a stride, and steps;
see `lifted`."""
SOONEST_SD = {"loading": -1.6, "first_peak_at": -2.2}
"""`lifted` moves these no farther: the curve through a sooner first peak overshoots it by a fifth
of the weight."""
WIDEST_SD = 1.6
"""No draw lies farther from its mean than this many standard deviations, before `lifted`."""


@dataclass(frozen=True, kw_only=True)
class Draw:
    """How one trial is walked. Times in s from the prosthetic foot's heel strike.

    Attributes:
        leg_m: length that steps scale with.
        duty, intact_duty: stance / stride of either foot; intact_step: instant of the intact foot's
            strike / stride.
        step_width_m, toe_out_deg: of the feet on the floor.
        tilt_deg: added to the published anterior tilt; list_scale, rotation_scale: of the published
            pelvic curves.
        knee_loading_deg: prosthetic knee's flexion under load at the start of the fit.
        first_peak_bw ... intact_second_peak_bw: forces in body weights; ..._at: when, in parts of
            stance.
        loading, unloading: how much later the foot takes over and gives up its load, in parts of
            stance.
        roll_over: how much later the centre of pressure passes along the foot, in parts of stance.
    """

    condition: str
    number: int
    leg_m: float
    stance_s: float
    speed_m_per_s: float
    duty: float
    intact_duty: float
    intact_step: float
    step_width_m: float
    toe_out_deg: float
    tilt_deg: float
    list_scale: float
    rotation_scale: float
    knee_loading_deg: float
    first_peak_bw: float
    trough_bw: float
    second_peak_bw: float
    loading: float
    first_peak_at: float
    trough_at: float
    second_peak_at: float
    unloading: float
    braking_bw: float
    propulsion_bw: float
    lateral_bw: float
    intact_first_peak_bw: float
    intact_trough_bw: float
    intact_second_peak_bw: float
    roll_over: float

    @property
    def name(self) -> str:
        return f"{self.condition}_{self.number}"

    @property
    def fulcrum_m(self) -> float | None:
        """None of a passive foot."""
        fulcrum_mm = CONDITIONS[self.condition]
        return None if fulcrum_mm is None else 1e-3 * fulcrum_mm

    @property
    def stride_s(self) -> float:
        return self.stance_s / self.duty

    @property
    def faster_m_per_s(self) -> float:
        """Speed beyond REFERENCE_SPEED_M_PER_S, of a person with a leg of LEG_M who walks in
        proportion."""
        return self.speed_m_per_s * np.sqrt(LEG_M / self.leg_m) - REFERENCE_SPEED_M_PER_S

    @property
    def intact_strike_s(self) -> float:
        return self.intact_step * self.stride_s

    @property
    def intact_lift_s(self) -> float:
        """End of the intact foot's stance in which the prosthetic foot strikes."""
        return self.intact_strike_s - (1.0 - self.intact_duty) * self.stride_s


def draw_trials(
    seed: int | Sequence[int],
    speed_m_per_s: float | None = None,
    *,
    leg_m: float = LEG_M,
    conditions: Sequence[str] = SETTINGS,
) -> list[Draw]:
    """Three trials per condition, at a speed; without one at the published stance times of the
    reference subject.

    Every quantity is drawn once from each third of its normal distribution, in random order: three
    such draws (a Latin hypercube) have the stated spread; three independent ones may by chance lie
    together.
    """
    random = np.random.default_rng(seed)
    trials = []
    for condition in conditions:
        drawn = {}
        stance = STANCE_S[condition] if speed_m_per_s is None else (1.0, TIMED_SD)
        for name, (mean, deviation) in {"stance_s": stance, **SPREAD}.items():
            third = random.permutation(TRIALS_PER_CONDITION) + random.uniform(
                size=TRIALS_PER_CONDITION
            )
            size = np.clip(norm.ppf(third / TRIALS_PER_CONDITION), -WIDEST_SD, WIDEST_SD)
            drawn[name] = mean + deviation * size
        drawn["roll_over"] += YIELDING[condition]
        if speed_m_per_s is None:
            drawn["speed_m_per_s"] += MEAN_SPEED_M_PER_S - SPEED_PER_STANCE * (
                drawn["stance_s"] - MEAN_STANCE_S
            )
        else:
            drawn["speed_m_per_s"] += speed_m_per_s
            alike = speed_m_per_s * np.sqrt(LEG_M / leg_m)
            for name, slope in BY_SPEED.items():
                drawn[name] += slope * (alike - REFERENCE_SPEED_M_PER_S)
            froude = speed_m_per_s / np.sqrt(GRAVITY * leg_m)
            steps_per_s = MORE_STEPS * np.interp(froude, *CADENCE) * np.sqrt(GRAVITY / leg_m)
            drawn["stance_s"] *= 2.0 / steps_per_s * drawn["duty"]
        trials += [
            Draw(
                condition=condition,
                number=i + 1,
                leg_m=leg_m,
                **{n: float(v[i]) for n, v in drawn.items()},
            )
            for i in range(TRIALS_PER_CONDITION)
        ]
    return trials


def lifted(draw: Draw, rise: np.ndarray) -> Draw:
    """The draw given that its forces let the body rise and fall as its legs do.

    Independent draws of times and peaks do not: 1 % of the weight once a stride lifts the centre of
    mass by 4 mm over one foot. In standard deviations x from the draw, x <- J^T (J J^T +
    RISE_M^2)^-1 (rise + J x - h(x)) leads to the least x whose h(x), what the forces reach, is
    `rise` but for errors of RISE_M: the draw is a prior of its own.

    Args:
        rise: (3,) m, complex amplitudes of the centre of mass's height at one to three times a
            stride's frequency.
    """

    def reached(draw: Draw) -> np.ndarray:
        part = np.arange(400) / 400.0
        vertical = (
            prosthetic_force(draw, part * draw.stride_s) + intact_force(draw, part * draw.stride_s)
        )[:, 2]
        times = np.arange(1, len(rise) + 1)
        height = (
            -GRAVITY * harmonics(vertical, len(rise)) * (draw.stride_s / (2.0 * np.pi * times)) ** 2
        )
        return np.concatenate([height.real, height.imag])

    def moved(x: np.ndarray) -> Draw:
        return replace(
            draw,
            **{
                name: getattr(draw, name) + float(by) * SPREAD[name][1]
                for name, by in zip(SHAPING, x, strict=True)
            },
        )

    x, wished, tolerated = (
        np.zeros(len(SHAPING)),
        np.concatenate([rise.real, rise.imag]),
        np.square([*RISE_M, *RISE_M]),
    )
    for _ in range(CONDITIONED):
        h = reached(moved(x))
        J = np.column_stack([reached(moved(x + row)) - h for row in 0.1 * np.eye(len(x))]) / 0.1
        x = J.T @ np.linalg.solve(J @ J.T + np.diag(tolerated), wished + J @ x - h)
    return moved(np.maximum(x, [SOONEST_SD.get(name, -np.inf) for name in SHAPING]))


def harmonics(values: np.ndarray, count: int) -> np.ndarray:
    """(count,) complex amplitudes of the first harmonics of `values` (n,), evenly over one
    stride."""
    part = np.arange(len(values)) / len(values)
    return np.asarray(
        2.0 * np.exp(-2j * np.pi * np.outer(np.arange(1, count + 1), part)) @ values / len(values)
    )


def describe(draw: Draw) -> dict[str, float]:
    """The draw's numbers by name."""
    return {
        f.name: getattr(draw, f.name) for f in fields(draw) if f.name not in ("condition", "number")
    }


def _curve(part: np.ndarray, points: list[tuple[float, float]]) -> np.ndarray:
    """Smooth through `points` from (0, 0) to (1, 0), level at both ends; zero outside. `part` (n,)
    is of stance."""
    x, y = np.array([(0.0, 0.0), *points, (1.0, 0.0)]).T
    level = ([(1, 0.0)], [(1, 0.0)])
    return np.where(
        (part > 0.0) & (part < 1.0),
        make_interp_spline(x, y, bc_type=level)(np.clip(part, 0.0, 1.0)),
        0.0,
    )


def prosthetic_force(draw: Draw, time_s: np.ndarray) -> np.ndarray:
    """(n, 3) in body weights in W: forward, left, up; what the fit aims at, not what comes out.

    Vertically more than LOADED_BW in stance, and so again every stride.
    """
    fine = np.linspace(0.0, 1.0, 4001)
    loaded = fine[_prosthetic_shape(draw, fine)[:, 2] > LOADED_BW]
    part = (time_s[None] - draw.stride_s * np.arange(-1, 3)[:, None]) / draw.stance_s
    return sum(_prosthetic_shape(draw, loaded[0] + row * (loaded[-1] - loaded[0])) for row in part)


def _prosthetic_shape(d: Draw, part: np.ndarray) -> np.ndarray:
    """The same over the parts (n,) of the whole contact."""
    first, middle, second = d.first_peak_at, d.trough_at, d.second_peak_at
    vertical = _curve(
        part,
        [
            (0.04 + 0.5 * d.loading, 0.17),
            (0.25 * first + 0.04 + d.loading, 0.45),
            (0.62 * first + d.loading, 0.83 * d.first_peak_bw),
            (first, d.first_peak_bw),
            (0.5 * (first + middle), 0.48 * d.first_peak_bw + 0.52 * d.trough_bw),
            (middle, d.trough_bw),
            (0.5 * (middle + second), 0.5 * (d.trough_bw + d.second_peak_bw)),
            (second, d.second_peak_bw),
            (0.5 * second + 0.47 + d.unloading, 0.80 * d.second_peak_bw),
            (0.935 + 0.7 * d.unloading, 0.37),
            (0.97 + 0.4 * d.unloading, 0.12),
        ],
    )
    forward = _curve(
        part,
        [
            (0.05, -0.25 * d.braking_bw),
            (0.17, -d.braking_bw),
            (0.33, -0.55 * d.braking_bw),
            (0.52, 0.0),
            (0.70, 0.55 * d.propulsion_bw),
            (0.855, d.propulsion_bw),
            (0.93, 0.5 * d.propulsion_bw),
            (0.97, 0.15 * d.propulsion_bw),
        ],
    )
    left = _curve(
        part,
        [
            (0.05, 0.05 * d.lateral_bw),
            (0.22, d.lateral_bw),
            (0.47, 0.75 * d.lateral_bw),
            (0.76, 0.95 * d.lateral_bw),
            (0.9, 0.4 * d.lateral_bw),
            (0.97, 0.08 * d.lateral_bw),
        ],
    )
    return np.column_stack([forward, left, vertical])


def intact_force(draw: Draw, time_s: np.ndarray) -> np.ndarray:
    """(n, 3) in body weights in W: of the intact foot, so that both feet carry the person over a
    stride.

    Vertical and lateral impulses over one stride balance weight and the other foot exactly; the
    forward one likewise.
    """
    d = draw
    first, middle, second = d.intact_first_peak_bw, d.intact_trough_bw, d.intact_second_peak_bw
    brake, push = 1.0 + 1.03 * d.faster_m_per_s, 1.0 + 0.92 * d.faster_m_per_s
    length = d.intact_duty * d.stride_s
    fine = np.linspace(-0.1, d.stride_s - 0.1, 2001)
    means = np.trapezoid(prosthetic_force(d, fine), fine, axis=0) / d.stride_s
    part = np.linspace(0.0, 1.0, 1001)

    def shape(x: np.ndarray) -> np.ndarray:
        vertical = _curve(
            x,
            [
                (0.04, 0.17),
                (0.10, 0.5),
                (0.15, 0.31 + 0.5 * first),
                (0.23, first),
                (0.35, 0.5 * (first + middle) - 0.01),
                (0.47, middle),
                (0.60, 0.5 * (middle + second) - 0.025),
                (0.76, second),
                (0.87, 0.245 + 0.5 * second),
                (0.94, 0.35),
                (0.97, 0.12),
            ],
        )
        forward = _curve(
            x,
            [
                (0.05, -0.035 * brake),
                (0.17, -0.145 * brake),
                (0.33, -0.07 * brake),
                (0.52, 0.0),
                (0.70, 0.08 * push),
                (0.86, 0.16 * push),
                (0.93, 0.08 * push),
                (0.97, 0.025 * push),
            ],
        )
        lateral = _curve(
            x, [(0.05, 0.05), (0.22, 1.0), (0.47, 0.75), (0.76, 0.95), (0.9, 0.4), (0.97, 0.08)]
        )
        return np.column_stack([forward, lateral, vertical])

    reached = np.trapezoid(shape(part), part, axis=0) * d.intact_duty
    lateral_scale, vertical_scale = -means[1] / reached[1], (1.0 - means[2]) / reached[2]
    level = (-means[0] - reached[0]) / (np.trapezoid(shape(part)[:, 2], part) * d.intact_duty)

    def one(start_s: float) -> np.ndarray:
        force = shape((time_s - start_s) / length)
        vertical = force[:, 2]
        return np.column_stack(
            [force[:, 0] + level * vertical, lateral_scale * force[:, 1], vertical_scale * vertical]
        )

    return sum(one(d.intact_strike_s + k * d.stride_s) for k in (-1, 0, 1))


def roll_over(part: np.ndarray, delay: float = 0.0) -> np.ndarray:
    """Centre of pressure along a foot, 0 at its heel's and 1 at its forefoot's support, over parts
    of stance (n,).

    It begins behind the support, at the edge of the heel.
    """
    at = np.array([0.0, 0.10, 0.20, 0.30, 0.42, 0.55, 0.68, 0.82, 1.0])
    at[1:-1] += delay
    along = np.array([-0.16, 0.0, 0.15, 0.34, 0.54, 0.70, 0.83, 0.94, 1.03])
    return np.asarray(make_interp_spline(at, along, k=3)(np.clip(part, 0.0, 1.0)))
