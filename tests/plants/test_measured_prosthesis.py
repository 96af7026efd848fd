"""What a standing trial measures of a prosthesis is what the model is built with: there and back."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.motion.markers.calibration import prosthesis_of
from vsf_drake.motion.markers.joints import Anatomy
from vsf_drake.motion.markers.segments import FootPoints
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.plants.foot import sole_height
from vsf_drake.plants.person import add_person

MEASURED = {"prosthesis_length_m": 0.521, "prosthesis_fore_aft_m": 0.013, "prosthesis_lateral_m": -0.008,
            "prosthesis_alignment_rad": 0.05, "prosthesis_inversion_rad": -0.04, "prosthesis_toe_out_rad": 0.14}


@pytest.mark.parametrize("side", ["right", "left"])
def test_measuring_the_built_prosthesis_gives_back_its_numbers(side):
    """The measurement reads frames and the heel's place on the sole; the plant knows only lengths and angles."""
    model = ModelParameters()
    plant = MultibodyPlant(0.0)
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side=side, **MEASURED)
    person = add_person(plant, subject, model)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    bodies = {name: plant.GetBodyByName(name) for name in (f"thigh_{side}", f"shank_{side}")}
    bodies[f"foot_{side}"] = person.foot.frame
    poses = {name: body.EvalPoseInWorld(context) for name, body in bodies.items()}
    anatomy = Anatomy(R_W={name: pose.rotation().matrix()[None] for name, pose in poses.items()},
                      p_W={name: pose.translation()[None] for name, pose in poses.items()},
                      lengths_m={}, method=(), notes=())
    sole = sole_height(model.foot)
    points = FootPoints(p_FHeel=np.array([0.0, 0.0, sole]), p_FToe=np.array([model.foot.length_m, 0.0, sole]))
    found = prosthesis_of(side, anatomy, points)
    assert set(found) == set(MEASURED)
    for name, value in MEASURED.items():
        assert found[name] == pytest.approx(value, abs=1e-12), name
