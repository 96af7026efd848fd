"""Asks: the questions of the certificate and the foot's files, in a folder."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import require
from vsf_drake.base.files import write_text
from vsf_drake.base.schema import dump_yaml
from vsf_drake.engines.certificate.asked import (
    CONDENSED,
    CONTINUOUS,
    ELASTIC,
    NOMINAL,
    Asked,
    foot_file,
)
from vsf_drake.engines.condensed import condense
from vsf_drake.engines.condensed_error import CondensedError, error_against_full
from vsf_drake.engines.condensed_osim import condensed_osim
from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.engines.osim import foot_osim
from vsf_drake.engines.sdf import foot_sdf
from vsf_drake.model.model_file import bending_stiffness, check_movable
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.plants.rigid_foot import rigid_foot
from vsf_drake.simulation.options import BenchOptions
from vsf_drake.simulation.roll_over import RollOver, mount_path

LOADS_N = 100.0 * np.arange(1, 9)
POSES = 100
LARGEST_ANGLE_RAD = 0.3
SEED = 0
ROLL_FULCRUM_MM = 108.0
DURATION_S = 0.8
INSTANTS = 801
TILT_RAD = np.radians([-17.0, 20.0])
"""Of the ground against the plane across the pylon, at heel strike and toe off."""
PEAK_N = 1138.0
"""Of the force, half a sine: 1.45 times the weight of 80 kg."""
FOOT = "foot.yaml"


def elastic(parameters: FootParameters) -> FootParameters:
    """The same foot, its spheres without damping."""
    zones = tuple(replace(zone, damping_n_s_per_m=0.0) for zone in parameters.zones)
    return replace(parameters, zones=zones)


def ask(folder: Path, parameters: FootParameters) -> tuple[Asked, CondensedError]:
    """Writes `asked.npz` and the foot's files into `folder`; what is asked, and how far the
    condensed foot is from the full one.

    InputError if a fulcrum position is out of the foot's reach, and as `questions` and `condense`
    have it; SimulationError if the foot cannot be rolled over, or as `condense` has it, and so
    FitError.
    """
    asked = questions(parameters)
    asked.write(folder)
    write_full(folder, parameters)
    condensed = condense(parameters)
    error = error_against_full(condensed)
    (folder / CONDENSED).mkdir()
    write_text(
        foot_file(folder, CONDENSED, ROLL_FULCRUM_MM, "osim"),
        condensed_osim(condensed, error, fulcrum_m=1e-3 * ROLL_FULCRUM_MM),
    )
    return asked, error


def questions(parameters: FootParameters) -> Asked:
    """What is asked of a foot; SimulationError if it cannot be rolled over; InputError if its
    support does not move or its keel thins, for the beam beside it is uniform."""
    check_movable(parameters, "The certificate is of a foot with a fulcrum that moves")
    tip = parameters.keel.tip_stiffness
    require(
        tip == 1.0,
        f"the keel thins: its tip is {tip:g} times as stiff as its rear end",
        "foot.keel.tip_stiffness",
        "The certificate compares the keel with a uniform beam, of 1",
    )
    foot, links = rigid_foot(parameters)
    keel = links[1:-1]
    frame_index = foot.frame.index()
    names = {body.index(): body.name() for body in foot.keel} | {frame_index: foot.frame.name()}
    time_s, mount = _path(parameters)
    return Asked(
        fulcrum_mm=np.array(BenchOptions.fulcrum_mm, dtype=float),
        load_n=LOADS_N,
        load_point_m=parameters.load_point_m,
        hinges=np.array(foot.keel_joint_names),
        bodies=np.array([link["name"] for link in keel]),
        starts_m=foot.keel_starts,
        poses_rad=np.random.default_rng(SEED).uniform(
            -LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD, (POSES, len(keel))
        ),
        gravity=GRAVITY,
        roll_fulcrum_mm=ROLL_FULCRUM_MM,
        time_s=time_s,
        mount=mount,
        beam_ei_nm2=float(bending_stiffness(parameters.keel)[0]),
        keel_length_m=math.fsum(parameters.keel.element_lengths_m),
        support_n_per_m=parameters.fulcrum.stiffness_n_per_m,
        sphere_bodies=np.array([names[index] for index in foot.sites.body_indices]),
        sphere_p_BS=foot.sites.p_BS,
        sphere_radius=foot.sites.radius,
        **{f"sphere_{name}": value for name, value in foot.sites.law.items()},
    )


def write_full(folder: Path, parameters: FootParameters) -> None:
    """Writes the files of the full foot, and its parameters, into `folder`."""
    for law, own in ((NOMINAL, parameters), (ELASTIC, elastic(parameters))):
        (folder / law).mkdir()
        write_text(folder / law / FOOT, dump_yaml(own))
        for mm in BenchOptions.fulcrum_mm if law == NOMINAL else (ROLL_FULCRUM_MM,):
            for ending, text in (
                ("osim", foot_osim(own, fulcrum_m=1e-3 * mm)),
                ("xml", foot_mjcf(own, fulcrum_m=1e-3 * mm)),
                ("sdf", foot_sdf(own, fulcrum_m=1e-3 * mm)),
            ):
                write_text(foot_file(folder, law, mm, ending), text)
    (folder / CONTINUOUS).mkdir()
    write_text(
        foot_file(folder, CONTINUOUS, ROLL_FULCRUM_MM, "sdf"),
        foot_sdf(parameters, fulcrum_m=1e-3 * ROLL_FULCRUM_MM, discrete=False),
    )


def _path(parameters: FootParameters) -> tuple[np.ndarray, np.ndarray]:
    """Instants (T,) s and path (T, 3) of the mount, on which the foot bears about half a sine of
    `PEAK_N`."""
    time_s = np.linspace(0.0, DURATION_S, INSTANTS)
    share = time_s / DURATION_S
    tilt = TILT_RAD[0] + np.ptp(TILT_RAD) * share
    machine = RollOver(parameters, friction=False)
    run, _ = machine.roll(
        fulcrum_m=1e-3 * ROLL_FULCRUM_MM,
        time_s=time_s,
        tilt_rad=tilt,
        force_n=PEAK_N * np.sin(np.pi * share),
    )
    touch = machine.touch_height(-tilt[:1]) / np.cos(tilt[:1])
    return time_s, np.vstack([mount_path(tilt[:1], touch), run.mount])
