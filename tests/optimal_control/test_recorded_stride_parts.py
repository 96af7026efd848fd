"""What a recorded stride is made of: geometry, curves, period and forces, each against something
known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.events import Stance
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.optimal_control.recorded_curves import (
    PeriodicCurves,
    closing_weights,
    fit_periodic,
    foot_force,
    one_stride,
)
from vsf_drake.optimal_control.recorded_projection import (
    body_points,
    make_misfit,
    project,
    sagittal_chain,
)
from vsf_drake.optimal_control.recorded_stride import find_period
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walker

OFFSETS = GeometricOffsets(height_m=0.006, fore_aft_m=-0.004, alignment_rad=0.05)
SHIFTED = {
    "prosthetic_thigh_length_m": 0.41,
    "prosthesis_fore_aft_m": 0.02,
    "prosthesis_toe_out_rad": 0.1,
    "prosthesis_alignment_rad": -0.03,
}
FULCRUM_M = 0.1


@pytest.fixture(scope="module", params=["right", "left"])
def walker(request):
    """A person with legs of different lengths and a foot that sits askew."""
    subject = Subject(
        mass_kg=70.0, stature_m=1.72, sex="female", prosthetic_side=request.param, **SHIFTED
    )
    return Walker(subject, load_model(resource("models/nominal.yaml")))


@pytest.fixture(scope="module")
def chain(walker):
    return sagittal_chain(walker, OFFSETS, fulcrum_m=FULCRUM_M)


@pytest.fixture
def poses():
    rng = np.random.default_rng(3)
    q = 0.5 * rng.standard_normal((12, 8))
    q[:, [4, 6]] = np.abs(q[:, [4, 6]]) + 0.1
    return q


def test_planar_chain_is_the_walkers_plant(walker, chain, poses):
    names = sagittal_coordinates(walker.subject.prosthetic_side)
    points = body_points(walker, OFFSETS, names, poses, fulcrum_m=FULCRUM_M)
    np.testing.assert_allclose(chain.points(poses), points.seen(np.array([1.0, 0.0])), atol=1e-12)
    x, _, z = np.einsum("k,nkc->cn", points.mass, points.places) / points.mass.sum()
    center = x + 1j * z
    np.testing.assert_allclose(chain.mass_center(poses), center, atol=1e-12)
    context = walker.gait.plant_context(walker.context)
    person = walker.gait.plant.CalcTotalMass(context)
    assert chain.mass.sum() == pytest.approx(person, rel=1e-12)


def test_first_and_second_derivatives_of_points_are_central_differences(chain, poses):
    rng = np.random.default_rng(4)
    pull = rng.standard_normal((len(poses), len(chain.labels), 2)) @ [1.0, 1j]
    places, J = chain.linearised(poses)
    bent = chain.curvature(J, pull)
    np.testing.assert_array_equal(places, chain.points(poses))

    def slope(q):
        return np.einsum("nk,nkc->nc", pull.conj(), chain.linearised(q)[1]).real

    h = 1e-6
    for c in range(8):
        step = h * np.eye(8)[c]
        numeric = (chain.points(poses + step) - chain.points(poses - step)) / (2 * h)
        np.testing.assert_allclose(J[:, :, c], numeric, atol=1e-8)
        np.testing.assert_allclose(
            bent[:, :, c], (slope(poses + step) - slope(poses - step)) / (2 * h), atol=1e-6
        )


def test_a_sagittal_motion_is_projected_onto_itself(walker, chain):
    t = np.linspace(0.0, 1.0, 30)
    wave = np.cos(6.0 * t)
    q = np.column_stack(
        [
            0.05 + 0.02 * np.sin(t),
            1.1 * t,
            0.95 + 0.02 * np.cos(9 * t),
            0.4 * wave,
            0.4 - 0.3 * wave,
            -0.4 * wave,
            0.4 + 0.3 * wave,
            0.1 * np.sin(6.0 * t),
        ]
    )
    points = body_points(
        walker,
        OFFSETS,
        sagittal_coordinates(walker.subject.prosthetic_side),
        q,
        fulcrum_m=FULCRUM_M,
    )
    projected, shift, converged = project(make_misfit(chain, points.seen(np.array([1.0, 0.0])), q))
    assert converged
    np.testing.assert_allclose(projected, q, atol=1e-10)
    assert abs(shift) < 1e-10


def test_a_constant_by_which_the_body_is_higher_moves_the_pelvis_and_bends_no_knee(walker, chain):
    """Legs that lean outward are shorter from the side; here all hips and masses are told 3 mm too
    high."""
    q = np.tile([0.1, 0.0, 0.93, 0.3, 0.3, -0.2, 0.2, 0.1], (5, 1))
    points = body_points(
        walker,
        OFFSETS,
        sagittal_coordinates(walker.subject.prosthetic_side),
        q,
        fulcrum_m=FULCRUM_M,
    )
    wanted = points.seen(np.array([1.0, 0.0]))
    wanted[:, np.concatenate([chain.rows("hip"), chain.rows("mass")])] += 0.003j
    projected, shift, _ = project(make_misfit(chain, wanted, q))
    np.testing.assert_allclose(projected, q, atol=1e-8)
    assert shift == pytest.approx(-0.003j, abs=1e-8)


def test_offsets_of_the_prosthesis_move_its_spheres_alone(walker):
    """Along the foot's own upright, which the subject's alignment has turned by as much (toe
    up)."""
    turned = SHIFTED["prosthesis_alignment_rad"]
    raised = sagittal_chain(walker, GeometricOffsets(height_m=0.01), fulcrum_m=FULCRUM_M)
    plain = sagittal_chain(walker, GeometricOffsets(), fulcrum_m=FULCRUM_M)
    for label, moved in (
        ("sphere P", 0.01j * np.exp(1j * turned)),
        ("sphere I", 0.0),
        ("knee", 0.0),
        ("hip", 0.0),
    ):
        rows = plain.rows(label)
        np.testing.assert_allclose(raised.local[rows] - plain.local[rows], moved, atol=1e-12)


def test_curves_of_enough_harmonics_are_recovered_from_more_than_a_period():
    truth = PeriodicCurves(1.2, np.array([1.3]), np.array([[0.2], [0.5], [-0.1], [0.3], [0.02]]))
    t = np.arange(-0.4, 1.15, 0.005)
    weights = closing_weights(t, t[0], t[-1], 1.2)
    fitted = fit_periodic(
        t, truth.sample(t)[0], weights, period_s=1.2, advance=truth.advance, order=2
    )
    np.testing.assert_allclose(fitted.coefficients, truth.coefficients, atol=1e-12)
    q, v, a = truth.sample(t)
    np.testing.assert_allclose(truth.sample(t + 1.2)[0], q + 1.3, atol=1e-12)
    before, after = truth.sample(t - 1e-4), truth.sample(t + 1e-4)
    for order, exact in ((0, v), (1, a)):
        np.testing.assert_allclose((after[order] - before[order]) / 2e-4, exact, atol=1e-5)


def test_weights_of_instants_a_period_apart_sum_to_one():
    phase = np.linspace(0.0, 1.2, 100)
    total = sum(closing_weights(phase + k * 1.2, -0.4, 2.7, 1.2) for k in range(-2, 4))
    np.testing.assert_allclose(total, 1.0, atol=1e-12)


def test_one_stride_lies_around_its_middle_and_in_the_recording():
    assert one_stride((0.0, 10.0), 5.0, 1.2) == pytest.approx((4.25, 5.75))
    assert one_stride((0.0, 10.0), 0.2, 1.2) == pytest.approx((0.0, 1.5))
    assert one_stride((0.0, 1.3), 0.2, 1.2) == pytest.approx((0.0, 1.3))


@pytest.mark.parametrize("period", [1.03, 1.2, 1.37])
def test_self_similarity_finds_the_period_of_a_motion_without_events(period):
    t = np.arange(0.0, period + 0.35, 0.005)
    turn = 2 * np.pi * t / period
    motion = np.column_stack(
        [0.3 * np.cos(turn), 0.5 * np.cos(2 * turn + 1.0), 0.2 * np.sin(turn + 0.4)]
    )
    seconds, method = find_period(t, motion, (), {"P": [Stance(0.4, 0.4 + 0.62 * period)]}, {})
    assert seconds == pytest.approx(period, abs=1e-4) and "self-similarity" in method


def test_two_strikes_on_the_plates_are_believed_first_unless_they_are_two_strides_apart():
    t = np.arange(0.0, 2.6, 0.01)
    seconds, method = find_period(
        t,
        np.cos(2 * np.pi * t / 1.21)[:, None],
        (),
        {"I": [Stance(0.3, 1.0), Stance(1.5, 2.25)]},
        {},
    )
    assert (
        seconds == pytest.approx(1.2, abs=1e-9)
        and "2 strikes of the intact foot in the plates" in method
    )
    t = np.arange(0.0, 3.2, 0.01)
    seconds, method = find_period(
        t,
        np.cos(2 * np.pi * t / 1.2)[:, None],
        (),
        {"P": [Stance(0.3, 1.0), Stance(2.7, 3.2, True, False)]},
        {},
    )
    assert seconds == pytest.approx(1.2, abs=1e-3) and "self-similarity" in method


def test_a_motion_that_does_not_repeat_itself_is_refused():
    t = np.arange(0.0, 1.8, 0.01)
    with pytest.raises(InputError, match="does not repeat itself"):
        find_period(t, (t**2)[:, None], (), {"P": [Stance(0.3, 1.0)]}, {})
    strikes = {"P": [Stance(0.1, 0.8), Stance(1.3, 1.7, True, False)]}
    with pytest.raises(
        InputError, match=r"its two ends, 1\.200 s apart \(2 strikes .*\), differ by 27\.5° RMS"
    ):
        find_period(t, 0.4 * t[:, None], (), strikes, {})


def stepping_plate(period, advance, time, start=0.0, length=0.7):
    """A foot that stands every `period` for `length`, a half sine of force, its centre of pressure
    moving 0.2 m."""
    phase = np.mod(time - start, period) / length
    on = phase < 1.0
    up = np.where(on, 800.0 * np.sin(np.pi * np.minimum(phase, 1.0)), 0.0)
    x = np.floor((time - start) / period) * advance + 0.2 * phase
    zero = np.zeros(len(time))
    cop = np.where((up > 20.0)[:, None], np.column_stack([x, zero, zero]), np.nan)
    return PlateRecording(time, np.column_stack([0.1 * up, zero, up]), cop, zero, True)


def test_a_stance_is_pieced_together_from_two_parts():
    time = np.arange(0.0, 1.5, 0.001)
    plate = stepping_plate(1.2, 1.4, time, start=0.9)
    known = {
        "record": (0.0, 1.5),
        "span": (0.0, 1.5),
        "start_s": 0.1,
        "period_s": 1.2,
        "advance_m": 1.4,
    }
    force = foot_force(plate, np.array([1.0, 0.0]), **known)
    t = np.linspace(0.0, 1.2, 500)
    whole = stepping_plate(1.2, 1.4, t + 0.1, start=0.9)
    forces, cop = force.sample(t)
    np.testing.assert_allclose(forces[:, 1], whole.force_W[:, 2], atol=0.1)
    loaded = whole.force_W[:, 2] > 40.0
    np.testing.assert_allclose(cop[loaded], whole.cop_W[loaded, 0], atol=1e-3)
    np.testing.assert_allclose(force.sample(t + 1.2)[1][loaded] - cop[loaded], 1.4, atol=1e-9)
    hidden = foot_force(plate, np.array([1.0, 0.0]), unknown=[(0.85, 1.5)], **known)
    t = np.array([0.1, 0.5, 0.78, 1.05])
    assert np.isfinite(hidden.sample(t)[0][:, 1]).tolist() == [True, True, False, False], (
        "what no plate measured"
    )


def test_a_force_that_is_measured_beyond_the_motion_does_not_count():
    time = np.arange(0.0, 3.0, 0.001)
    plate = stepping_plate(1.2, 1.4, time)
    silent = dataclasses.replace(plate, force_W=np.where((time > 1.3)[:, None], 0.0, plate.force_W))
    force = foot_force(
        silent,
        np.array([1.0, 0.0]),
        record=(0.0, 1.3),
        span=(0.0, 1.3),
        start_s=0.0,
        period_s=1.2,
        advance_m=1.4,
    )
    np.testing.assert_allclose(force.sample(0.35)[0][0, 1], 800.0, rtol=1e-3)
