"""The picture of walking_over_grounds: the person, the prosthetic foot from near, and forces over
time."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from pydrake.systems.framework import Context
from walk_over_ground import ReferenceWalk

from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.foot_handles import ContactSites
from vsf_drake.plants.gait import GaitDiagram, make_gait
from vsf_drake.report.style import MEASURED, NEUTRAL, drawing, label

SHARES = (0.07, 0.25, 0.55, 0.9)
"""Instants that are drawn, in shares of the time shown."""
PERSON_M_PER_BW, FOOT_M_PER_BW, SHOWN_N = 0.5, 0.08, 20.0


def draw(runs: dict[str, ReferenceWalk], grounds: dict[str, Ground], trial: Trial) -> Figure:
    """The figure of `runs` by ground name."""
    gait = make_gait(trial.subject, trial.model)
    colours = {
        name: colormaps["viridis"](0.9 * i / max(len(grounds) - 1, 1))
        for i, name in enumerate(grounds)
    }
    weight = GRAVITY * trial.subject.mass_kg
    with drawing(2.6 * len(runs), 8.4) as figure:
        figure.set_layout_engine("constrained")
        above, middle, below = figure.subfigures(3, 1, height_ratios=(1.2, 0.55, 1.0))
        people, feet = (
            part.subplots(1, len(runs), sharex=True, sharey=True) for part in (above, middle)
        )
        for person, foot, (name, run) in zip(people, feet, runs.items(), strict=True):
            first = person is people[0]
            for axes in (person, foot):
                _draw_ground(axes, grounds[name])
                axes.set_aspect("equal")
                axes.grid(False)
            _draw_person(person, gait, run, colours[name], weight)
            _draw_foot(foot, gait, run, colours[name], weight)
            person.set(xlim=(-0.15, 1.35), ylim=(-0.1, 1.62))
            foot.set(xlim=(0.44, 0.78), ylim=(-0.03, 0.15))
            label(person, x="", y="z in W (m)" if first else "", title=name)
            label(foot, x="x in W (m)", y="z in W (m)" if first else "")
        _draw_paths(below.subplots(1, 4), runs, colours, trial, weight)
        figure.suptitle(
            "The same prescribed motion on five grounds (synthetic recording); prosthesis dark, "
            "force on both feet",
            fontsize=10,
        )
    return figure


def _draw_ground(axes: Any, ground: Ground) -> None:
    """The ground under the prosthetic foot, on the right of the path."""
    x = np.linspace(-0.3, 1.5, 3601)
    patches = [patch for patch in ground.patches if patch.from_y_m < 0.0]
    planes = [
        np.where(
            (x >= patch.from_x_m) & (x < patch.to_x_m),
            patch.height_m + np.tan(np.radians(patch.slope_deg)) * (x - patch.reference_x_m),
            -np.inf,
        )
        for patch in patches
    ]
    z = np.max(planes, axis=0)
    soft = any(patch.stiffness_n_per_m for patch in patches)
    axes.fill_between(
        x, -1.0, z, color="0.88", hatch="..." if soft else None, edgecolor="0.6", lw=0.0
    )
    axes.plot(x, z, color="0.35", lw=0.8)


def _shown(gait: GaitDiagram, run: ReferenceWalk) -> Any:
    """Index, opacity and plant's Context of each instant that is drawn."""
    context = gait.plant.CreateDefaultContext()
    for share in SHARES:
        i = round(share * (len(run.time_s) - 1))
        gait.plant.SetPositions(context, run.q[i])
        yield i, 0.3 + 0.7 * share, context


def _draw_person(
    axes: Any, gait: GaitDiagram, run: ReferenceWalk, colour: Any, body_weight_n: float
) -> None:
    person, plant = gait.person, gait.plant
    body, own = person.body, person.subject.prosthetic_side
    other = "left" if own == "right" else "right"
    for i, fade, context in _shown(gait, run):
        pose = {name: segment.EvalPoseInWorld(context) for name, segment in person.segments.items()}
        trunk = pose["pelvis"] @ np.array(
            [[body.hip_forward] * 2, [0.0, 0.0], [body.hip_up, body.hip_up + body.trunk_length]]
        )
        axes.plot(trunk[0], trunk[2], color="0.7", lw=5.0, alpha=fade, solid_capstyle="round")
        for side, last, sites, shade in (
            (other, pose[f"foot_{other}"].translation(), person.intact_sites, "0.7"),
            (
                own,
                person.foot.mount.CalcPoseInWorld(context).translation(),
                person.foot.sites,
                "0.15",
            ),
        ):
            leg = np.array(
                [pose[f"thigh_{side}"].translation(), pose[f"shank_{side}"].translation(), last]
            )
            axes.plot(leg[:, 0], leg[:, 2], color=shade, lw=2.0, alpha=fade)
            axes.fill(
                *np.vstack([last[[0, 2]], _sole(plant, sites, context)]).T,
                color=shade,
                alpha=fade,
                lw=1.0,
            )
        for force, cop in ((run.grf_W, run.cop_W), (run.intact_grf_W, run.intact_cop_W)):
            _arrow(axes, force[i], cop[i], PERSON_M_PER_BW / body_weight_n, colour, fade)


def _draw_foot(
    axes: Any, gait: GaitDiagram, run: ReferenceWalk, colour: Any, body_weight_n: float
) -> None:
    for i, fade, context in _shown(gait, run):
        sole = _sole(gait.plant, gait.person.foot.sites, context)
        axes.plot(*sole.T, color="0.15", lw=1.2, alpha=fade)
        _arrow(axes, run.grf_W[i], run.cop_W[i], FOOT_M_PER_BW / body_weight_n, colour, fade)
    loaded = run.grf_W[:, 2] > SHOWN_N
    axes.plot(
        run.cop_W[loaded, 0], run.cop_W[loaded, 2], color=colour, lw=3.0, solid_capstyle="round"
    )


def _sole(plant: Any, sites: ContactSites, context: Context) -> np.ndarray:
    """(N, 2) x and z (m) of the lowest points of the spheres, from heel to toe."""
    centres = [
        plant.get_body(index).EvalPoseInWorld(context) @ centre
        for index, centre in zip(sites.body_indices, sites.p_BS, strict=True)
    ]
    points = np.array(centres) - np.outer(sites.radius, [0.0, 0.0, 1.0])
    return points[np.argsort(points[:, 0])][:, [0, 2]]


def _arrow(
    axes: Any, force: np.ndarray, cop: np.ndarray, scale: float, colour: Any, fade: float
) -> None:
    if force[2] > SHOWN_N:
        axes.annotate(
            "",
            xy=(cop + scale * force)[[0, 2]],
            xytext=cop[[0, 2]],
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "alpha": fade,
                "lw": 1.3,
                "shrinkA": 0,
                "shrinkB": 0,
            },
        )


def _draw_paths(
    panels: Any,
    runs: dict[str, ReferenceWalk],
    colours: dict[str, Any],
    trial: Trial,
    body_weight_n: float,
) -> None:
    time = next(iter(runs.values())).time_s
    own = trial.subject.prosthetic_side
    other = "left" if own == "right" else "right"
    shown = (
        (own, "grf_W", 2, "prosthetic foot, vertical"),
        (other, "intact_grf_W", 2, "intact foot, vertical"),
        (own, "grf_W", 0, "prosthetic foot, forward"),
    )
    for axes, (side, force, column, title) in zip(panels[:3], shown, strict=True):
        plate = trial.plates[side]
        recorded = np.interp(time, plate.time_s, plate.force_W[:, column])
        axes.plot(
            time - time[0],
            recorded / body_weight_n,
            color=NEUTRAL,
            label="recorded, level",
            **MEASURED,
        )
        for name, run in runs.items():
            axes.plot(
                time - time[0],
                getattr(run, force)[:, column] / body_weight_n,
                color=colours[name],
                lw=1.3,
                label=name,
            )
        label(axes, x="time (s)", y="force in W (body weights)", title=title)
    for name, run in runs.items():
        loaded = run.grf_W[:, 2] > SHOWN_N
        panels[3].plot(time[loaded] - time[0], run.cop_W[loaded, 0], color=colours[name], lw=1.3)
    label(panels[3], x="time (s)", y="x in W (m)", title="centre of pressure, prosthetic foot")
    panels[1].legend(loc="best")
