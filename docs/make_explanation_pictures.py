"""Makes the pictures of docs/explanation, docs/pictures/explained_NAME.png.

python docs/make_explanation_pictures.py              all of them, some ten seconds
python docs/make_explanation_pictures.py keel         one
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from make_example_pictures import DOCS, keep
from matplotlib.figure import Figure

import vsf_drake as vsf
from vsf_drake.device.bench_metrics import closed_form_stiffness, published_stiffness
from vsf_drake.laws.contact import LAWS
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.laws.hunt_crossley import matched_dissipation
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trajectory import low_pass
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.foot import keel_joint_positions
from vsf_drake.report.layer_curves import LOOKS
from vsf_drake.report.style import (
    FULCRUM,
    MEASURED,
    PANEL,
    SIMULATED,
    colour_of,
    drawing,
    label,
    save_figure,
    say_synthetic,
    tag,
)
from vsf_drake.simulation.bench import keel_shape, run_bench
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import Walker, trial_request
from vsf_drake.walks.embedded import embedded_contact, embedded_trials
from vsf_drake.walks.prediction import layer_curves, predict

PICTURES_OF = DOCS / "pictures"
COLOURS = ("#2b5c8a", "#b3541e", "#4f7a28")
SETTINGS_MM = (66.0, 108.0, 151.0)
CONSTANTS = LawConstants(
    stiffness=1e4,
    damping=120.0,
    full_damping_depth=1e-3,
    mu_static=0.5,
    mu_kinetic=0.3,
    threshold_velocity=0.1,
    depth_width=0.5e-3,
    rate_width=0.02,
)
"""N/m, N s/m, m, 1, 1, m/s: a sphere of the foam with the nominal damping of 12 ms."""


def drawn(foot: vsf.FootParameters, angles: np.ndarray) -> np.ndarray:
    """(P, 2) m in K: the keel from A over its joints to its end, turned by `angles` at these."""
    places = [0.0, *keel_joint_positions(foot.keel), sum(foot.keel.element_lengths_m)]
    turned = np.cumsum(angles)
    pieces = np.diff(places)[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
    return np.vstack([np.zeros(2), np.cumsum(pieces, axis=0)])


def keel(figure: Figure) -> None:
    """The keel under 600 N at three positions of the fulcrum."""
    foot = vsf.FootParameters()
    bent = figure.subplots()
    for mm in SETTINGS_MM:
        points = 1e3 * drawn(foot, keel_shape(foot, fulcrum_m=1e-3 * mm, load_n=600.0).angles)
        bent.plot(*points.T, color=colour_of(mm), linewidth=2.4)
        bent.plot(mm, 4.0, marker="v", color=colour_of(mm))
        tag(bent, f"{mm:.0f} mm", tuple(points[-1]), colour_of(mm), offset=(4, -2))
    bent.plot(0.0, 0.0, marker="o", color="0.2")
    tag(bent, "A, the pin", (0.0, 0.0), "0.2", offset=(-4, -18))
    label(bent, x="along the keel (mm)", y="up (mm)", title="Under 600 N at the load point")
    bent.set(xlim=(-8.0, 270.0), ylim=(-14.0, 72.0))


def keel_stiffness(figure: Figure) -> None:
    """On the bench and by the closed form, with what is published."""
    foot = vsf.FootParameters()
    stiff = figure.subplots()
    at_mm = np.arange(66.0, 152.0, 5.0)
    pressed = run_bench(vsf.ModelParameters(), fulcrums_m=tuple(1e-3 * at_mm), heel=False)
    rows = vsf.bench_table(pressed).settings
    beam = 1e-3 * closed_form_stiffness(asdict(foot), 1e-3 * at_mm)
    stiff.plot(at_mm, beam, color=COLOURS[1], linewidth=1.4)
    stiff.plot(at_mm, [row.stiffness_n_per_mm for row in rows], color=COLOURS[0], linewidth=2.2)
    ends = [1e-3 * published_stiffness(1e-3 * mm) for mm in (66.0, 151.0)]
    stiff.plot((66.0, 151.0), ends, "o", color="0.1", zorder=5)
    tag(stiff, "pressed on the bench", (70.0, 20.0), COLOURS[0])
    tag(stiff, "closed form of the beam", (105.0, 13.5), COLOURS[1], offset=(6, -12))
    tag(stiff, "published", (151.0, ends[1]), "0.1", offset=(-8, 4), ha="right")
    label(stiff, x=FULCRUM, y="forefoot stiffness (N/mm)")
    stiff.set_ylim(0.0, 36.0)


def contact(figure: Figure) -> None:
    """A stroke of half a sine to 6 mm under each law."""
    axes = figure.subplots()
    time = np.linspace(0.0, np.pi, 400)
    depth = 6e-3 * np.sin(time)
    rate = 6e-3 * np.cos(time) * np.pi / 0.1
    lost = matched_dissipation(
        stiffness=CONSTANTS.stiffness, exponent=1.0, damping=CONSTANTS.damping, depth=6e-3
    )[0]
    constants = CONSTANTS._replace(dissipation=lost)
    thin = {"linewidth": 1.4}
    looks = {"kelvin_voigt": MEASURED, "smooth": thin, "hunt_crossley": thin}
    for name, law, colour in zip(CONTACT_LAWS, LAWS, COLOURS, strict=True):
        forces = law.force(law.penetration(depth, constants)[0], rate, constants)[0]
        axes.plot(1e3 * depth, forces, color=colour, **looks[name])
        place = {"kelvin_voigt": 25, "smooth": 60, "hunt_crossley": 330}[name]
        offset = {"kelvin_voigt": (-6, 8), "smooth": (10, -16), "hunt_crossley": (8, -12)}[name]
        side = "right" if name == "kelvin_voigt" else "left"
        tag(axes, name, (1e3 * depth[place], forces[place]), colour, offset=offset, ha=side)
    label(axes, x="penetration depth (mm)", y="normal force (N)", title="One stroke in 0.1 s")
    axes.set_xlim(-1.2, 6.3)


def friction(figure: Figure) -> None:
    """The coefficient over the slip speed."""
    axes = figure.subplots()
    speed = np.linspace(1e-4, 0.3, 600)
    for name, colour, at, offset in (
        ("kelvin_voigt", COLOURS[0], 205, (6, 4)),
        ("smooth", COLOURS[1], 100, (-36, 8)),
    ):
        law = LAWS[list(CONTACT_LAWS).index(name)]
        mu = law.friction.per_speed(speed, CONSTANTS)[0] * speed
        axes.plot(speed, mu, color=colour, linewidth=1.8)
        words = "stick-slip of the paper" if name == "kelvin_voigt" else name
        tag(axes, words, (speed[at], mu[at]), colour, offset=offset)
    axes.axhline(0.2, color="0.5", linewidth=0.8, linestyle="--")
    tag(axes, "a pull of 0.2 creeps at 0.04 m/s", (0.12, 0.2), "0.35", offset=(0, -12))
    axes.plot(0.04, 0.2, "o", color="0.2")
    label(axes, x="slip speed (m/s)", y="friction over normal force")
    axes.set(xlim=(-0.01, 0.33), ylim=(0.0, 0.56))


def resultant(walk: WalkResult) -> np.ndarray:
    """N, low-passed at 40 Hz, every half of a millisecond."""
    at = np.arange(0.0, 1.44, 0.5e-3)
    force = np.column_stack([np.interp(at, walk.time_s, own) for own in walk.grf_W.T])
    return np.linalg.norm(low_pass(force, rate_hz=2000.0, cutoff_hz=40.0), axis=1)


def implicit_step(figure: Figure) -> None:
    """What longer steps cost in accuracy: nine SYNTHETIC walks against steps of 0.125 ms."""
    axes = figure.subplots()
    steps_ms = np.array([0.25, 0.5, 1.0, 2.0])
    for trial in map(recorded, embedded_trials("laboratory")):
        mm = 1e3 * trial.fulcrum_m
        exact = resultant(vsf.simulate_trial(trial, step_s=0.125e-3))
        loaded = exact > 20.0
        weight = GRAVITY * trial.subject.mass_kg
        off = [resultant(vsf.simulate_trial(trial, step_s=1e-3 * ms)) - exact for ms in steps_ms]
        errors = [100.0 * np.sqrt(np.mean(each[loaded] ** 2)) / weight for each in off]
        axes.plot(steps_ms, errors, "o-", color=colour_of(mm), linewidth=1.2, markersize=4.0)
    for row, mm in enumerate(SETTINGS_MM):
        tag(axes, f"fulcrum {mm:.0f} mm", (0.1, 0.19 - 0.016 * row), colour_of(mm))
    label(axes, x="step (ms)", y="off steps of 0.125 ms (% body weight)")
    axes.set(xlim=(0.0, 2.15), ylim=(0.0, 0.21))
    say_synthetic(figure, True, "walks")


def recorded(path: Path) -> Trial:
    """An embedded SYNTHETIC walk with its fitted contact."""
    return vsf.trial_with(vsf.load_trial(path), vsf.load_contact(embedded_contact("laboratory")))


def sensitivities(figure: Figure) -> None:
    """Exact derivatives of the vertical force, and differences of two walks each."""
    axes = figure.subplots()
    trial = recorded(embedded_trials("laboratory")[4])
    walker = Walker(trial.subject, trial.model)
    weight = GRAVITY * trial.subject.mass_kg
    changes = {"offset.height": 1e-3, "fulcrum.shift": 5e-3, "contact.heel.stiffness": None}
    words = (
        ("1 mm of height", (0.75, -9.0)),
        ("5 mm of the fulcrum", (1.06, 8.0)),
        ("10 % heel stiffness", (0.3, 4.2)),
    )
    walk = walker.walk(**trial_request(trial), with_respect_to=list(changes))
    time_s = walk.record.time_s
    for column, (name, colour) in enumerate(zip(changes, COLOURS, strict=True)):
        size = changes[name] or 0.1 * walker.variables[name].default
        by = 100.0 * size * walk.sensitivity.grf_W[:, 2, column] / weight
        start = walker.variables[name].default
        sides = [
            walker.walk(**trial_request(trial), values={name: start + sign * 1e-3 * size})
            for sign in (1.0, -1.0)
        ]
        moved = 1e5 * (sides[0].prosthetic.grf_W - sides[1].prosthetic.grf_W)[:, 2] / 2.0 / weight
        axes.plot(time_s, by, color=colour, linewidth=1.6)
        axes.plot(time_s[::40], moved[::40], ".", color=colour, markersize=5.0)
        tag(axes, *words[column], colour)
    label(axes, x="time (s)", y="vertical force by it (% body weight)")
    axes.set(xlim=(0.28, 1.5), ylim=(-12.0, 10.0))
    say_synthetic(figure, True, "walk")


def person_curve(figure: Figure) -> None:
    """A held-out walk in three layers beside its plate and the null model."""
    axes = figure.subplots()
    contact = vsf.load_contact(embedded_contact("laboratory"))
    trial = recorded(embedded_trials("laboratory")[3])
    walker = Walker(trial.subject, trial.model)
    curves = layer_curves(predict(trial, contact, walker=walker, step_s=1e-3), trial, contact)
    time_s = curves["time_s"]
    axes.plot(time_s, curves["plate"][:, 2], color=COLOURS[0], label="plate", **MEASURED)
    for name, colour in (("physics", COLOURS[1]), ("momentum", COLOURS[2])):
        axes.plot(time_s, curves[name][:, 2], color=colour, label=name, **SIMULATED)
    axes.plot(time_s, curves["person"][:, 2], label=LOOKS["person"][0], **LOOKS["person"][1])
    label(axes, x="time (s)", y="vertical force (body weights)")
    shown = time_s[curves["plate"][:, 2] > 0.05]
    axes.set_xlim(shown[0] - 0.05, shown[-1] + 0.05)
    axes.legend(loc="lower center")
    say_synthetic(figure, True, "walk that the fit has not seen")


def level_2(figure: Figure) -> None:
    """Stored: the cost of strides that adapt, by speed."""
    axes = figure.subplots()
    speeds = adaptive_strides()["speeds"]
    at_mm = speeds["positions_mm"]
    for (speed, row), colour in zip(speeds["speeds"].items(), COLOURS, strict=True):
        axes.plot(at_mm, row["cost"], "o-", color=colour, markersize=4.0)
        axes.plot(row["fulcrum_mm"], row["least"], "v", color=colour, markersize=8.0)
        tag(axes, f"{speed} m/s", (at_mm[0], row["cost"][0]), colour, offset=(6, 6))
    label(axes, x=FULCRUM, y="activation and hold")
    axes.set_ylim(0.6, 1.95)
    say_synthetic(figure, True, "walks")


def level_2_alone(figure: Figure) -> None:
    """Stored: squared activations of strides at the chosen weight of the hold."""
    axes = figure.subplots()
    stored = adaptive_strides()
    chosen = stored["able_bodied"]["least_that_meets_all"]
    for row in stored["signs"]:
        if row["weight"] == chosen:
            squares = row["outcomes"]["activation"]
            recorded_mm = row["recorded_mm"]
            below = -9 if recorded_mm == SETTINGS_MM[0] else 2
            at = (SETTINGS_MM[-1], squares[-1])
            axes.plot(SETTINGS_MM, squares, "o-", color=colour_of(recorded_mm))
            words = f"recorded at {recorded_mm:.0f}"
            tag(axes, words, at, colour_of(recorded_mm), offset=(6, below))
    label(axes, x=FULCRUM, y="squared activations")
    axes.set(xlim=(60.0, 205.0), xticks=SETTINGS_MM)
    say_synthetic(figure, True, "walks")


def adaptive_strides() -> dict[str, Any]:
    path = DOCS.parent / "studies" / "results" / "adaptive_stride.json"
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


PICTURES = {
    draw.__name__: draw
    for draw in (
        keel,
        keel_stiffness,
        contact,
        friction,
        implicit_step,
        sensitivities,
        person_curve,
        level_2,
        level_2_alone,
    )
}


def main(names: list[str]) -> None:
    """Makes the pictures `names`."""
    for name in names:
        with drawing(*PANEL) as figure:
            PICTURES[name](figure)
        with tempfile.TemporaryDirectory() as folder:
            save_figure(figure, Path(folder) / name, svg=False)
            keep(Path(folder) / f"{name}.png", PICTURES_OF / f"explained_{name}.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "names", nargs="*", default=list(PICTURES), metavar="NAME", help=", ".join(PICTURES)
    )
    main(list(parser.parse_args().names))
