"""Derivatives of all that acts on a foot, compiled, against AutoDiffXd through the same lines."""

from __future__ import annotations

import numpy as np
import pytest
from made_feet import EVERY_BRANCH, loose_foot, some_state
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue

from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.systems import _foot_kernel as kernel

UNEVEN = Ground(
    patches=(
        GroundPatch(slope_deg=2.0, bank_deg=-1.0, belt_m_per_s=-0.3),
        GroundPatch(name="mat", from_x_m=0.0, height_m=1e-3, slope_deg=2.0, stiffness_n_per_m=3e4),
    )
)


def packed(contact: str):
    """numbers, table, work of a foot on the ground, some of its spheres on each patch."""
    foot = loose_foot(contact=contact, ground=UNEVEN)
    forces = foot.wired.forces
    forces.SetParameters(foot.forces_context, **EVERY_BRANCH)
    X_WK, V_WM, q, v = some_state(6, depth=5e-3)
    foot.place(X_WK, 0.4 * V_WM, q, v)
    assert (foot.output("normal_force") > 0).sum() > 8
    return (
        forces._numbers,
        forces._table(foot.forces_context)[0],
        forces._values(foot.forces_context),
    )


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize("directions", [1, 7, 17])
def test_compiled_derivatives_are_those_of_autodiff_by_all_inputs_and_constants(
    contact, directions
):
    numbers, table, work = packed(contact)
    rng = np.random.default_rng(directions)
    inputs = 21 + 2 * int(numbers[1])
    work_by = np.zeros((len(work), directions))
    work_by[:inputs] = rng.normal(size=(inputs, directions))
    table_by = rng.normal(size=(*table.shape, directions)) * np.abs(table)[..., None]
    made = []
    for way in (kernel.differentiate, kernel.differentiate_in_python):
        result, by = work.copy(), work_by.copy()
        way(numbers, table, table_by, result, by)
        made.append((result, by))
    (value, by), (expected, expected_by) = made
    np.testing.assert_allclose(value, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(value, work, atol=1e-12 * np.abs(expected).max())
    size = np.maximum(np.abs(expected_by).max(axis=1), 1.0)[:, None]
    np.testing.assert_allclose(by / size, expected_by / size, atol=1e-12)
    assert np.abs(by[inputs:]).max() > 1e3


def test_without_derivatives_that_come_in_none_go_out_and_of_two_sizes_none_are_made():
    foot = loose_foot()
    foot.place(*some_state(6))
    general = foot.diagram.ToAutoDiffXd()
    context = general.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(foot.context)
    forces = general.GetSubsystemByName("vsf_forces")
    own = forces.GetMyMutableContextFromRoot(context)
    grf = forces.GetOutputPort("grf").Eval(own)
    assert ExtractGradient(grf).size == 0
    np.testing.assert_allclose(ExtractValue(grf).ravel(), foot.output("grf"), rtol=1e-10)
    forces.SetParameters(own, mu_static=AutoDiffXd(0.5, np.ones(2)))
    forces.GetInputPort("fulcrum_position").FixValue(own, [AutoDiffXd(0.108, np.ones(3))])
    with pytest.raises(ValueError, match="in 3 directions, parameters in 2"):
        forces.GetOutputPort("grf").Eval(own)
