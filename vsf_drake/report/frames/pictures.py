"""Writes the pictures of frames and signs."""

from __future__ import annotations

from pathlib import Path

from vsf_drake.parameters import FootParameters
from vsf_drake.report.frames.foot_frames_drawing import foot_frames_figure
from vsf_drake.report.frames.foot_positions import DrawnFoot
from vsf_drake.report.frames.foot_signs import FULCRUM_M, foot_signs
from vsf_drake.report.frames.foot_signs_drawing import foot_signs_figure
from vsf_drake.report.frames.person_drawing import GROUPS, person_figure
from vsf_drake.report.frames.person_poses import DrawnPerson
from vsf_drake.report.style import save_figure

NAMES = ("foot_frames", "foot_signs", *(f"person_{group}" for group in GROUPS))
"""Of the pictures, each as .png and .svg."""


def write_pictures(folder: str | Path, parameters: FootParameters | None = None) -> tuple[Path, ...]:
    """Writes every picture of NAMES as PNG and SVG; the same model and Matplotlib give the same bytes.

    Args:
        folder: an existing one.
        parameters: of the foot; the nominal one by default. The person has a prosthesis on the left.

    Raises:
        InputError: the folder cannot be written.
    """
    foot = parameters or FootParameters()
    person = DrawnPerson("left")
    figures = [foot_frames_figure(DrawnFoot(foot).positions(FULCRUM_M)), foot_signs_figure(foot_signs(foot)),
               *(person_figure(person, group) for group in GROUPS)]
    return tuple(path for name, figure in zip(NAMES, figures, strict=True)
                 for path in save_figure(figure, Path(folder) / name, letters="path"))
