"""Thirty made feet, pressed on a made bench and fitted: does the fitted foot bear what they bear?

The made feet are another model than that which is fitted. Keel: an elastica of 240 pieces, built in
(not pinned and supported), with a camber, thinning by a power of its length, bent by large angles.
Foam: F = a (exp(d / b) - 1), which no power law is. Heel: k1 d + k2 d^2 + k3 d^3 along the platen's
normal. Bench: noise of load and travel, a load cell's steps, touch-down read up to 0.3 mm wrong,
losses on the way back. Half of the feet are pressed at 0, half at 20 and -15 degrees, every third
at two angles under the forefoot.

    error       root mean square of fitted less true load (no noise) over the travel of a curve,
                over the largest load
    coverage    share of true loads within the 90 % interval, over all points of all curves
    unseen      the error under the forefoot at 15 degrees more than any angle that was recorded
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from contact_fit_study.keeping import STUDIES, made_by

from vsf_drake.base.files import resource, sha256, write_json
from vsf_drake.device.foot_from_curves import FittedFoot, foot_from_curves
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.bench import keel_shape

SEED = 47
NOMINAL = "../../models/nominal.yaml"  # as results name it; its foot is what is assumed
COUNT = 30
PIECES = 240
TURNS = 40  # of the search for the tip's angle
LOADS = 60  # of a true curve
SAMPLES = 300  # of a recorded branch
UNSEEN_DEG = 15.0  # beyond the recorded angles
WITHIN = 0.05  # error that is asked for


@dataclass(frozen=True)
class MadeFoot:
    """A foot that exists nowhere: SYNTHETIC."""

    length_m: float
    mass_kg: float
    body_mass_kg: float  # of whom it is for: 1.2 times that weight is the largest load
    clamp_m: float  # from the keel's rear end, where the keel is built in
    load_point_m: float
    bending: float  # N m^2 at the clamp
    tip_ratio: float  # thickness at the load point over that at the clamp
    power: float  # of how it thins
    camber_per_m: float  # curvature of the unloaded keel
    foam: tuple[float, float]  # a (N), b (m)
    heel: tuple[float, float, float]  # N/m, N/m^2, N/m^3
    loss: float  # share of the load that the way back lacks, at half travel

    def forefoot(self, load_n: np.ndarray, tilt_rad: float) -> np.ndarray:
        """(n,) m, travel of the load point along the platen's normal, foam included."""
        a, b = self.foam
        return self._keel(load_n, tilt_rad) + b * np.log1p(load_n / a)

    def _keel(self, load_n: np.ndarray, tilt_rad: float) -> np.ndarray:
        length = self.load_point_m - self.clamp_m
        step = length / PIECES
        s = (np.arange(PIECES) + 0.5) * step
        thickness = 1.0 - (1.0 - self.tip_ratio) * (s / length) ** self.power
        bending = self.bending * thickness**3
        normal = np.array([-math.sin(tilt_rad), math.cos(tilt_rad)])

        def shape(tip: np.ndarray, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """Angle at the clamp, and (2, n) from there to the tip, of angles of the tip: from the
            tip backwards, where there is no moment."""
            angle = tip.copy()
            arm = np.zeros((2, len(tip)))
            for k in range(PIECES - 1, -1, -1):
                # middle of the piece: half a piece on in angle and place
                middle = angle - 0.5 * step * (self.camber_per_m + load * moment(arm) / bending[k])
                along = np.array([np.cos(middle), np.sin(middle)])
                at = arm + 0.5 * step * along
                angle = angle - step * (self.camber_per_m + load * moment(at) / bending[k])
                arm = arm + step * along
            return angle, arm

        def moment(arm: np.ndarray) -> np.ndarray:
            """Of a unit load on the tip, toe up, about a point that `arm` leads from."""
            return arm[0] * normal[1] - arm[1] * normal[0]

        def built_in(load: np.ndarray) -> np.ndarray:
            low = np.full(len(load), -1.5)
            high = np.full(len(load), 2.5)
            for _ in range(TURNS):
                middle = 0.5 * (low + high)
                over = shape(middle, load)[0] > 0.0
                high = np.where(over, middle, high)
                low = np.where(over, low, middle)
            return shape(0.5 * (low + high), load)[1]

        return normal @ (built_in(load_n) - built_in(np.zeros(1)))

    def heel_travel(self, load_n: np.ndarray) -> np.ndarray:
        """(n,) m, travel of the platen under the heel."""
        depth = np.linspace(0.0, 0.1, 20001)
        k1, k2, k3 = self.heel
        return np.interp(load_n, k1 * depth + k2 * depth**2 + k3 * depth**3, depth)


def made_foot(rng: np.random.Generator) -> MadeFoot:
    """A foot by chance: 22 to 30 cm, for 50 to 110 kg, forefoot 15 to 60 N/mm, heel 25 to 110."""
    length = rng.uniform(0.22, 0.30)
    body = rng.uniform(50.0, 110.0)
    scale = length / 0.245
    clamp = scale * rng.uniform(0.080, 0.130)
    load_point = scale * 0.199
    tip = rng.uniform(0.5, 1.0)
    lever = load_point - clamp
    stiffness = body * rng.uniform(300.0, 600.0)
    largest = 1.2 * 9.81 * body
    b = rng.uniform(2e-3, 8e-3)
    heel = rng.uniform(0.4, 1.2) * 1e3 * body
    depth = largest / heel
    share = rng.dirichlet([2.0, 2.0, 1.0]) * heel
    return MadeFoot(
        length_m=length,
        mass_kg=rng.uniform(0.35, 0.8),
        body_mass_kg=body,
        clamp_m=clamp,
        load_point_m=load_point,
        bending=stiffness * lever**3 / 3.0 / tip,
        tip_ratio=tip,
        power=rng.uniform(0.7, 2.0),
        camber_per_m=rng.uniform(-1.0, 1.0),
        foam=(largest * rng.uniform(0.05, 0.5), b),
        heel=(share[0], share[1] / depth, share[2] / depth**2),
        loss=rng.uniform(0.05, 0.25),
    )


def true_curves(foot: MadeFoot, number: int) -> dict[tuple[str, float], tuple[np.ndarray, ...]]:
    """Displacement (m) and load (N) by part and angle (degrees), as they are."""
    loads = 1.2 * 9.81 * foot.body_mass_kg * np.linspace(0.0, 1.0, LOADS) ** 1.5
    level = number % 2 == 0
    angles = [0.0 if level else 20.0]
    if number % 3 == 2:
        angles.append(10.0 if level else 30.0)
    curves = {
        ("forefoot", angle): (foot.forefoot(loads, math.radians(angle)), loads) for angle in angles
    }
    curves["heel", 0.0 if level else -15.0] = foot.heel_travel(loads), loads
    return curves


def record(
    foot: MadeFoot,
    curves: dict[tuple[str, float], tuple[np.ndarray, ...]],
    rng: np.random.Generator,
) -> tuple[str, dict[tuple[str, float], float]]:
    """The bench's CSV file, and by how much (m) its touch-down is ahead of the true one."""
    rows = ["part,displacement_mm,load_n,angle_deg,branch"]
    shifts = {}
    for (part, angle), (x, load) in curves.items():
        shift = rng.uniform(-3e-4, 3e-4)
        shifts[part, angle] = shift
        way = np.linspace(0.0, x[-1], SAMPLES)
        there = np.interp(way, x, load)
        lost = 4.0 * (way / x[-1]) * (1.0 - way / x[-1]) * foot.loss
        for branch, at, force in (
            ("loading", way, there),
            ("unloading", way[::-1], (there * (1.0 - lost))[::-1]),
        ):
            noisy_x = at + shift + rng.normal(scale=2e-5, size=SAMPLES)
            if branch == "loading":
                noisy_x = np.maximum.accumulate(noisy_x)
            noisy = np.maximum(force * (1.0 + rng.normal(scale=2e-3, size=SAMPLES)), 0.0)
            noisy = np.round(noisy + rng.normal(scale=1.0, size=SAMPLES))
            rows += [
                f"{part},{1e3 * one:.3f},{newton:.0f},{angle:g},{branch}"
                for one, newton in zip(noisy_x, noisy, strict=True)
            ]
    return "\n".join(rows) + "\n", shifts


def judge(number: int, folder: Path) -> dict[str, Any]:
    """One made foot, recorded, fitted and held against its true curves."""
    rng = np.random.default_rng([SEED, number])
    foot = made_foot(rng)
    curves = true_curves(foot, number)
    text, shifts = record(foot, curves, rng)
    path = folder / f"foot_{number}.csv"
    path.write_text(text, encoding="utf-8")
    fitted = foot_from_curves(path, length_m=foot.length_m, mass_kg=foot.mass_kg)
    errors = {}
    held = []
    for each in fitted.curves:
        key = each.curve.part, round(math.degrees(each.curve.tilt_rad), 6)
        x, load = curves[key]
        true = np.interp(each.curve.displacement_m + each.curve.touch_m - shifts[key], x, load)
        difference = each.load_n - true
        errors[f"{key[0]} at {key[1]:g}"] = float(np.sqrt(np.mean(difference**2)) / load[-1])
        held += (np.abs(difference) <= each.half_width_n).tolist()
    unseen = math.radians(UNSEEN_DEG + max(angle for _, angle in curves))
    loads = np.linspace(0.0, 1.2 * 9.81 * foot.body_mass_kg, LOADS)
    travel = fitted_travel(fitted, loads, unseen)
    difference = np.interp(foot.forefoot(loads, unseen), travel, loads) - loads
    return {
        "length_m": foot.length_m,
        "errors": errors,
        "unseen": float(np.sqrt(np.mean(difference**2)) / loads[-1]),
        "coverage": float(np.mean(held)),
        "touch_mm": [1e3 * each.late_m for each in fitted.curves],
        "told": [value.name for value in fitted.values if value.told],
        "lost_share": fitted.lost_share,
    }


def fitted_travel(fitted: FittedFoot, load_n: np.ndarray, tilt_rad: float) -> np.ndarray:
    """(n,) m, travel of the fitted foot's load point, its foam included."""
    foot = fitted.model.foot
    bent = [
        keel_shape(foot, fulcrum_m=fitted.clamp_m, load_n=float(load), tilt_rad=tilt_rad).travel_m
        for load in load_n
    ]
    return bent + (load_n / foot.series_stiffness_n_per_m) ** (1.0 / foot.series_exponent)


def main() -> None:
    """Makes, fits and judges the feet; writes what came out."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=STUDIES / "results")
    parser.add_argument("--quick", action="store_true", help="the first four feet")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        feet = [judge(number, Path(folder)) for number in range(4 if arguments.quick else COUNT)]
    worst = [max(foot["errors"].values()) for foot in feet]
    summary = {
        "synthetic": True,
        "feet": feet,
        "within_5_percent": sum(error <= WITHIN for error in worst),
        "median_worst_error": float(np.median(worst)),
        "largest_error": max(worst),
        "coverage": float(np.mean([foot["coverage"] for foot in feet])),
        "median_unseen": float(np.median([foot["unseen"] for foot in feet])),
        "largest_unseen": max(foot["unseen"] for foot in feet),
        "provenance": {
            **provenance({NOMINAL: sha256(resource("models/nominal.yaml"))}, SEED),
            "sources": made_by("foot_from_curves.py"),
        },
    }
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_json(arguments.out / "foot_from_curves.json", summary)
    for number, foot in enumerate(feet):
        errors = ", ".join(f"{name} {100 * error:.1f} %" for name, error in foot["errors"].items())
        print(
            f"{number:2d}  {1e3 * foot['length_m']:.0f} mm  {errors}, held {foot['coverage']:.0%}"
        )
    print(
        f"{summary['within_5_percent']} of {len(feet)} feet within {WITHIN:.0%} RMS, median "
        f"{summary['median_worst_error']:.1%}, largest {summary['largest_error']:.1%}; intervals "
        f"hold {summary['coverage']:.0%} of the true loads; at an unseen angle median "
        f"{summary['median_unseen']:.1%}, largest {summary['largest_unseen']:.1%}"
    )


if __name__ == "__main__":
    main()
