"""Scenario files for tests: one of everything, and the files that it names."""

from __future__ import annotations

from pathlib import Path

EVERYTHING = """
kind: leg
name: one of everything
model: package://vsf_drake/nominal.yaml
fulcrum_mm: 87
contact: smooth
robot: two_legs.dmd.yaml
directives:
  - add_weld: {parent: world, child: "a::hip", X_PC: {translation: [0, 0.1, 0.845]}}
  - add_weld: {parent: world, child: "b::hip", X_PC: {translation: [0, -0.1, 0.845],
      rotation: !Rpy {deg: [0, 3, 0]}}}
feet:
  - {name: left, parent_frame: "a::pylon_end", side: left, fulcrum_mm: 66}
  - {name: right, parent_frame: "b::pylon_end", side: right, model: foot.yaml, contact: hunt_crossley}
guides:
  - {joint: "a::hip_flexion", stiffness: 2000, damping: 40}
  - {joint: "a::knee_flexion", stiffness: 2000, damping: 40}
  - {joint: "b::hip_flexion", stiffness: 2000, damping: 40}
  - {joint: "b::knee_flexion", stiffness: 2000, damping: 40}
ground:
  patches:
    - {name: floor}
    - {name: mat, from_x_m: 0.5, to_x_m: 1.0, from_y_m: -1, to_y_m: 1, reference_x_m: 0.5, height_m: 0.01,
       slope_deg: 2, bank_deg: 1, mu_static: 0.4, mu_kinetic: 0.3, stiffness_n_per_m: 2.0e+4}
gravity_m_per_s2: 9.81
time_step_s: 0
simulation: {integrator: implicit_euler, accuracy: 1.0e-3, max_step_s: 5.0e-3}
"""  # noqa: E501
TWO_LEGS = """
directives:
  - add_model: {name: a, file: package://vsf_drake/leg.urdf}
  - add_model: {name: b, file: package://vsf_drake/leg.urdf}
"""


def written(folder: Path, text: str, name: str = "scenario.yaml") -> Path:
    """The file `name` in `folder`, with `text` in it."""
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def one_of_everything(folder: Path) -> Path:
    """A scenario with every key that a leg can have, and its files, in `folder`."""
    written(folder, TWO_LEGS, "two_legs.dmd.yaml")
    written(folder, "foot: {mass_kg: 0.7}\n", "foot.yaml")
    return written(folder, EVERYTHING)
