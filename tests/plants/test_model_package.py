"""package://vsf_drake: the shipped models load by Drake's Parser and are what their comments say."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.files import resource
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.station import add_model_package


@pytest.fixture
def parser():
    """A strict one that knows the package; its plant, which it does not keep alive itself, is kept."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetStrictParsing()
    add_model_package(parser)
    add_model_package(parser)  # twice does no harm
    assert parser.package_map().GetPath("vsf_drake") == str(resource("models"))
    yield parser
    del plant


def test_leg_has_the_masses_and_lengths_of_its_comment(parser):
    parser.AddModels(url="package://vsf_drake/leg.urdf")
    plant = parser.plant()
    plant.Finalize()
    masses = [plant.GetBodyByName(name).default_mass() for name in ("hip", "thigh", "shank", "pylon_end")]
    assert masses == [10.0, 5.0, 2.0, 0.0]
    X_HP = plant.CalcRelativeTransform(
        plant.CreateDefaultContext(), plant.GetFrameByName("hip"), plant.GetFrameByName("pylon_end"))
    np.testing.assert_allclose(X_HP.translation(), [0, 0, -0.76], atol=1e-12)


MOMENTS = (
    ("hip", 10 * np.full(3, 2 * 0.14**2 / 12)),
    ("thigh", 5 * np.array([(3 * 0.06**2 + 0.40**2) / 12, (3 * 0.06**2 + 0.40**2) / 12, 0.06**2 / 2])),
    ("shank", 2 * np.array([(3 * 0.03**2 + 0.36**2) / 12, (3 * 0.03**2 + 0.36**2) / 12, 0.03**2 / 2])))


def test_leg_has_the_inertias_of_solid_shapes_and_bends_as_its_comment_says(parser):
    parser.AddModels(url="package://vsf_drake/leg.urdf")
    plant = parser.plant()
    plant.Finalize()
    for name, moments in MOMENTS:
        inertia = plant.GetBodyByName(name).default_spatial_inertia()
        central = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
        np.testing.assert_allclose(central.get_moments(), moments, rtol=1e-12)
    for joint, body, forward in (("hip_flexion", "shank", 1.0), ("knee_flexion", "pylon_end", -1.0)):
        context = plant.CreateDefaultContext()
        plant.GetJointByName(joint).set_angle(context, 0.1)
        x = plant.CalcRelativeTransform(
            context, plant.GetFrameByName("hip"), plant.GetFrameByName(body)).translation()[0]
        assert forward * x > 0.03


def test_directives_put_the_foot_under_the_leg(parser):
    parser.AddModels(url="package://vsf_drake/foot_under_leg.dmd.yaml")
    plant = parser.plant()
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert plant.CalcTotalMass(context) == pytest.approx(17.0 + FootParameters().mass_kg, rel=1e-11)
    assert plant.GetJointByName("fulcrum").get_translation(context) == 0.108
    X = plant.CalcRelativeTransform(context, plant.GetFrameByName("pylon_end"), plant.GetFrameByName("vsf_mount"))
    assert X.IsExactlyIdentity()
