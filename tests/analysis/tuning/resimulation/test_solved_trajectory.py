"""A solved trajectory problem is handed over column by column, with the device that it found."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from made_sagittal import embedded_walker, loaded_motion

from vsf_drake.analysis.tuning.resimulation.trajectory import design_values, solved_trajectory
from vsf_drake.collocation.problem import Grid, Layout
from vsf_drake.simulation.sagittal.model import DESIGN, SagittalModel, Smoothing


def solution(periodic=True):
    """A solution that says of every output which it is, with the motion of a known stride."""
    whole = loaded_motion(40)
    grid = Grid(method="trapezoidal", intervals=40, duration_s=whole.period_s, periodic=periodic)
    layout = Layout(coordinates=whole.names, quasi_static=("socket_tx",))
    names = ["balance_pelvis_tx", *(f"power_{n}" for n in whole.names[3:]),
             *(f"torque_{n}" for n in reversed(whole.names[3:])), "intact_fx", "intact_fz", "intact_my",
             "prosthetic_fz", "prosthetic_fx"]
    z = np.zeros((grid.instants, layout.size))
    for part in ("q", "v", "a"):
        z[:, getattr(layout, part)] = getattr(whole, part)[: grid.instants]
    y = np.arange(len(names)) + 100.0 * np.arange(grid.instants)[:, None]
    problem = SimpleNamespace(layout=layout, grid=grid, function=SimpleNamespace(names=tuple(names)),
                              advance=whole.advance)
    return whole, names, SimpleNamespace(problem=problem, z=z, p=np.array([0.12, 1.2, 0.01, 0.9]), y=lambda: y)


def test_outputs_and_variables_find_their_columns():
    whole, names, found = solution()
    given = solved_trajectory(found, embedded_walker(), outputs=found.problem.function.names)
    for name in ("time_s", "q", "v", "a"):
        np.testing.assert_allclose(getattr(given, name) - getattr(given, name)[0],
                                   getattr(whole, name) - getattr(whole, name)[0], atol=1e-9)
    expected = [names.index(f"torque_{n}") for n in whole.names[3:]]
    np.testing.assert_array_equal(given.torque[7], np.array(expected) + 700.0)
    np.testing.assert_array_equal(given.torque[-1], given.torque[0])
    for foot in ("prosthetic", "intact"):
        np.testing.assert_array_equal(given.grf[foot][-1], given.grf[foot][0])
        np.testing.assert_array_equal(given.grf[foot][0], [names.index(f"{foot}_fx"), names.index(f"{foot}_fz")])


def test_device_is_the_solution_s():
    _, _, found = solution()
    walker = embedded_walker()
    given = solved_trajectory(found, walker, outputs=found.problem.function.names)
    assert given.fulcrum_m == 0.12
    assert given.values["offset.alignment"] == 0.01
    modulus = walker.variables["keel.flexural_modulus"].default
    assert given.values["keel.flexural_modulus"] == pytest.approx(0.9**3 * modulus)


def test_single_stance_is_not_closed():
    whole, _, found = solution(periodic=False)
    given = solved_trajectory(found, embedded_walker(), outputs=found.problem.function.names)
    assert not given.periodic and len(given.time_s) == 41
    np.testing.assert_allclose(given.q, whole.q)


@pytest.mark.parametrize("design", [{"heel_stiffness": 1.4}, {"alignment_rad": 0.03}, {"keel_thickness": 1.2}])
def test_full_model_s_device_is_the_sagittal_model_s(design):
    """The design variable against a sagittal model that is made with the walk's values: all outputs alike."""
    walker, whole = embedded_walker(), loaded_motion(40)
    here = {part: getattr(whole, part).T for part in ("q", "v", "a")}
    own, other = SagittalModel(walker), SagittalModel(walker, values=design_values(walker, **design))
    w = np.full((len(own.quasi_static), 41), 2e-3)
    p = np.tile(np.array([[0.108], [1.0], [0.0], [1.0]]), 41)
    changed = p.copy()
    changed[DESIGN.index(*design)] = next(iter(design.values()))
    by_design = own.evaluate(**here, w=w, u=0.0 * w, p=changed, smoothing=Smoothing())
    by_value = other.evaluate(**here, w=w, u=0.0 * w, p=p, smoothing=Smoothing())
    np.testing.assert_allclose(by_design, by_value, rtol=1e-6, atol=1e-3)
    assert np.abs(by_design - own.evaluate(**here, w=w, u=0.0 * w, p=p, smoothing=Smoothing())).max() > 1.0
