"""The design variables against the same changes of the walker's own numbers."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel, Smoothing


def same(person, drawn, p, other, p_other):
    _, model = person
    at = drawn(model, 10, seed=30)
    at.p[0], at.p[1:] = 0.108, np.array([1.0, 0.0, 1.0])[:, None]
    mine, theirs = at.p.copy(), at.p.copy()
    mine[DESIGN.index(p[0])], theirs[DESIGN.index(p_other[0])] = p[1], p_other[1]
    found = model.evaluate(*at.all[:5], mine, Smoothing())
    known = other.evaluate(*at.all[:5], theirs, Smoothing())
    np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-9)
    plain = model.evaluate(*at.all, Smoothing())
    assert np.abs(found - plain).max() > 1.0


def changed(person, values=None, **offsets):
    walker, _ = person
    own = {"height_m": 0.004, "fore_aft_m": -0.006, "alignment_rad": 0.03} | offsets
    return SagittalModel(walker, offsets=GeometricOffsets(**own), values=values)


def test_heel_stiffness_is_that_of_all_zones_at_the_heel(person, drawn):
    walker, _ = person
    zones = [name for name in walker.gait.person.foot.sites.zone_names if name.startswith("heel")]
    assert len(zones) == 3
    values = {f"contact.{zone}.stiffness": 1.7 * walker.variables[f"contact.{zone}.stiffness"].default
              for zone in zones}
    same(person, drawn, ("heel_stiffness", 1.7), changed(person, values), ("heel_stiffness", 1.0))


def test_alignment_turns_the_foot_on_its_mount(person, drawn):
    same(person, drawn, ("alignment_rad", -0.05), changed(person, alignment_rad=-0.02), ("alignment_rad", 0.0))


def test_thickness_bends_as_its_cube(person, drawn):
    """As a modulus that is so much higher, with the joints' damping in proportion."""
    walker, _ = person
    values = {"keel.flexural_modulus": 1.25**3 * walker.variables["keel.flexural_modulus"].default}
    same(person, drawn, ("keel_thickness", 1.25), changed(person, values), ("keel_thickness", 1.0))


def test_shift_of_the_fulcrum_adds_to_its_position(person, drawn):
    same(person, drawn, ("fulcrum_m", 0.125), changed(person, {"fulcrum.shift": 0.01}), ("fulcrum_m", 0.115))


@pytest.mark.parametrize(("name", "field"), [
    ("offset.height", "height_m"), ("offset.fore_aft", "fore_aft_m"), ("offset.alignment", "alignment_rad")])
def test_offsets_among_the_values_add_to_the_walks_own(person, drawn, name, field):
    _, model = person
    at = drawn(model, 5, seed=31)
    own = {"height_m": 0.004, "fore_aft_m": -0.006, "alignment_rad": 0.03}[field]
    found = changed(person, {name: 0.01}).evaluate(*at.all, Smoothing())
    known = changed(person, **{field: own + 0.01}).evaluate(*at.all, Smoothing())
    np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-9)
    assert np.abs(found - model.evaluate(*at.all, Smoothing())).max() > 1.0
