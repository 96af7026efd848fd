"""A walk: where it begins, what holds or drives it, its mirror image, and what it withstands or
refuses."""

from __future__ import annotations

import dataclasses
import re
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cut_walks import inputs_of
from drawn_walks import assert_sound, drawn
from made_contact import CURVE, OF_THE_MODEL, OF_THE_TRIAL, OWN, made_contact
from walk_over_ground import walk_over

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.files import resource
from vsf_drake.laws.lanes import WIDTH
from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.fitted_trial import fingerprint, gait_phase, trial_with
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory, periodic_bsplines, window_bsplines
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation import walk as module
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.stepping.stepper import Stepper
from vsf_drake.simulation.variables import MotionPerturbation
from vsf_drake.simulation.walk import (
    MOST_BYTES,
    Walk,
    Walker,
    bytes_a_step,
    simulate_trial,
    trial_request,
    walk_notes,
)
from vsf_drake.walks.embedded import embedded_trials

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


def run(walker, motion, **options):
    chosen = {"fulcrum_m": 0.108, "start_s": 0.0, "end_s": 0.94} | options
    return walker("right").walk(motion("right"), **chosen)


def test_fulcrum_may_move_under_load_in_both_ways_of_advancing(walker, motion):
    def path(t):
        return 0.1 + 0.3 * (t - 0.5)

    span, person = {"start_s": 0.5, "end_s": 0.54}, walker("right")
    reference = walk_over(
        person.subject, person.model, motion("right"), Ground(), fulcrum_m=path, **span
    )
    walk = run(walker, motion, fulcrum_m=path, step_s=2.5e-4, **span)
    np.testing.assert_allclose(walk.prosthetic.grf_W[3::4][10:], reference.grf_W[11:], atol=2.0)


@pytest.mark.parametrize(
    ("mu_static", "mu_kinetic", "threshold"),
    [(0.1, 0.05, 0.1), (1.2, 0.3, 0.01), (0.117, 0.336, 1.18)],
)
def test_every_step_converges_on_slippery_and_on_grippy_ground(
    walker, motion, mu_static, mu_kinetic, threshold
):
    values = {
        "friction.mu_static": mu_static,
        "friction.mu_kinetic": mu_kinetic,
        "friction.threshold_velocity": threshold,
    }
    for step_s in (4e-3, 1e-3):
        walk = run(walker, motion, values=values, step_s=step_s)
        assert np.count_nonzero(~walk.record.converged) <= 1
        forces, most = walk.prosthetic.grf_W, max(mu_static, mu_kinetic)
        assert np.all(np.linalg.norm(forces[:, :2], axis=1) <= most * forces[:, 2] + 1e-9)


def test_divergence_names_time_and_coordinate(walker, stance):
    """Springs that push away instead of back throw the prosthesis off."""
    walk, pushing = (
        stance("right", 1e-3),
        [SPRING_COLUMNS.index(name) for name in ("stiffness", "stiffness_negative")],
    )
    springs = walk.mechanism.springs.copy()
    springs[:, pushing] *= -1.0
    stepper = Stepper(replace(walk.mechanism, springs=springs))
    with pytest.raises(
        SimulationError, match=r"failed at t = [\d.]+ s: coordinate \w+ diverged"
    ) as error:
        stepper.run(inputs_of(walk, walker("right")), walk.record.q0, walk.record.v0)
    assert 0.0 < error.value.time_s < 0.94
    assert error.value.exit_code == 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"step_s": "1e-3"}, "step_s: '1e-3' is not usable"),
        ({"step_s": 0.5}, "not a usable step"),
        ({"end_s": np.inf}, "end_s: inf"),
        ({"end_s": 0.0}, "no time to walk"),
        ({"end_s": 1.5}, "outside the recording"),
        ({"offsets": {"height_m": 0.0}}, "a dict"),
        ({"fulcrum_m": lambda t: "a"}, "fulcrum_m: gives"),
        ({"fulcrum_m": lambda t: [0.1, 0.1]}, "one for each time"),
        ({"fulcrum_m": np.nan}, "finite number"),
        ({"fulcrum_m": lambda t: 0.1 + t}, "out of the carriage's reach"),
        ({"values": "offset.height"}, "no mapping"),
        ({"with_respect_to": "offset.height"}, "no list of names"),
        ({"with_respect_to": [["offset.height"]]}, "there is no variable"),
        ({"with_respect_to": iter(["offset.height"] * 2)}, "stands twice"),
    ],
)
def test_useless_input_is_refused(walker, motion, options, message):
    with pytest.raises(InputError, match=message):
        run(walker, motion, **options)


def test_missing_coordinate_is_named(walker, motion):
    full = motion("right")
    short = CoordinateTrajectory(full.time_s, full.values[:, 1:], full.names[1:])
    with pytest.raises(InputError, match="pelvis_tx"):
        walker("right").walk(short, fulcrum_m=0.1, start_s=0.0, end_s=0.5)


def test_foot_that_is_deeper_in_the_ground_than_its_foam_is_thick_is_noted(walker, motion, stance):
    """A prosthesis 20 or 50 mm too long on a tenth of its foam."""
    model, own = walker("right").model, stance("right", 1e-3)
    assert own.record.site("depth").max() < model.foot.foam_thickness_m
    assert not any("into the ground" in note for note in walk_notes(own, SUBJECT, model))
    soft = {f"contact.{zone.name}.stiffness": 0.1 * zone.stiffness for zone in model.foot.zones}
    for height, said in ((-0.02, "first at 0."), (-0.05, "already at the start")):
        walk = run(walker, motion, values=soft, offsets=GeometricOffsets(height_m=height))
        deepest = 1e3 * walk.record.site("depth").max()
        [note] = [note for note in walk_notes(walk, SUBJECT, model) if "into the ground" in note]
        assert note.startswith(f"The prosthetic foot goes {deepest:.0f} mm into the ground ({said}")
        assert "30 mm that the foam" in note


@pytest.fixture(scope="module")
def trial():
    return load_trial(embedded_trials("exact")[0])


def walked_from(trial, walker, **options):
    span = {"fulcrum_m": trial.fulcrum_m, "start_s": 0.45, "end_s": 0.46} | options
    return walker.walk(trial.trajectory, **span)


def test_freed_coordinate_starts_as_recorded(trial):
    walker = Walker(trial.subject, trial.model, free=("pelvis_ty", "knee_angle_l"))
    walk = walked_from(trial, walker)
    motion = trial.trajectory.ordered(walker.free)
    q, v, _ = motion.sample(0.45)
    rows = [walk.mechanism.tree.index(name) for name in walker.free]
    np.testing.assert_allclose(walk.record.q0[rows], q[0], atol=1e-12)
    np.testing.assert_allclose(walk.record.v0[rows], v[0], atol=1e-12)


def test_keel_that_folds_up_has_failed(trial):
    """A keel as soft as rubber turns by more than a radian in one joint: a failure, not a
    result."""
    foot = trial.model.foot
    rubber = dataclasses.replace(foot, keel=dataclasses.replace(foot.keel, flexural_modulus_pa=1e6))
    with pytest.raises(SimulationError, match=r"coordinate keel_\w+ (reached|diverged)"):
        walked_from(
            trial, Walker(trial.subject, dataclasses.replace(trial.model, foot=rubber)), end_s=1.2
        )


def test_result_tells_the_numbers_that_were_used(trial):
    walker = Walker(trial.subject, trial.model)
    forces = walker.gait.forces["prosthetic"]
    forces.SetParameters(forces.GetMyContextFromRoot(walker.context), fulcrum_stiffness=5e4)
    walk = walked_from(trial, walker, fulcrum_m=0.151)
    parameters = walker.result(walk, trial, GeometricOffsets()).parameters
    assert parameters["fulcrum_m"] == [0.151, 0.151]
    assert parameters["stepper"]["fulcrum_stiffness_and_damping"][0] == 5e4


def test_walks_side_by_side_are_each_what_they_are_alone_to_the_bit(trial):
    """Other lengths, steps, devices, grounds, motions, supports; one that is differentiated, one
    that diverges and one that cannot be walked among them."""
    walker = Walker(trial.subject, trial.model)
    sag = MotionPerturbation("sag", "pelvis_ty", lambda t: np.cos(3.0 * t))
    part = {"start_s": 0.45, "end_s": 0.5}
    requests = [
        trial_request(trial, **part),
        trial_request(trial, **part, fulcrum_m=0.14, step_s=2e-3),
        trial_request(trial, start_s=0.4, end_s=0.47, offsets=GeometricOffsets(height_m=0.003)),
        trial_request(trial, **part, values={"coordinate.pelvis_ty": -0.6}),
        trial_request(trial, **part, values={"contact.heel.stiffness": 2e5, "offset.toe_out": 0.1}),
        trial_request(trial, **part, perturbations=[sag], values={"perturbation.sag": 0.002}),
        trial_request(trial, **part, fulcrum_m=0.5),
        trial_request(trial, **part, fulcrum_m=0.1005, support_width_m=2e-3),  # beside a joint
        trial_request(trial, **part, with_respect_to=("offset.height", "fulcrum.shift")),
        trial_request(trial, **part, fulcrum_m=lambda t: 0.1 + 0.1 * (t - 0.45)),
    ]
    together = walker.walk_many(requests)
    assert [type(walk).__name__ for walk in together].count("Walk") == 8
    for request, walk in zip(requests, together, strict=True):
        if not isinstance(walk, Walk):
            with pytest.raises(type(walk), match=re.escape(str(walk))):
                walker.walk(**request)
            continue
        alone = walker.walk(**request)
        for name, array in alone.record._asdict().items():
            np.testing.assert_array_equal(getattr(walk.record, name), array, err_msg=name)
        assert walk.cop_W.tobytes() == alone.cop_W.tobytes()
        assert (walk.sensitivity is None) == ("with_respect_to" not in request)
        if walk.sensitivity is not None:
            assert walk.sensitivity.grf_W.tobytes() == alone.sensitivity.grf_W.tobytes()
        assert walk.rest_speed == alone.rest_speed
    assert walker.walk_many([]) == []


def test_bad_input_ends_its_own_walk_alone_and_what_is_no_request_all(trial):
    """Times that are none, a start that has no derivative: whether asked for together or each."""
    walker = Walker(trial.subject, trial.model, free=("pelvis_tx",))
    part = {"start_s": 0.05, "end_s": 0.052}
    loose = {"initial": {"pelvis_tx": 0.0}, "with_respect_to": ("offset.height",)}
    requests = [
        trial_request(trial, **part),
        trial_request(trial, **part | {"end_s": 0.04}),
        trial_request(trial, **part, step_s="a millisecond"),
        trial_request(trial, **part, **loose),
        trial_request(trial, **part),
    ]
    words = (None, "no time to walk", "step_s", "no force holds pelvis_tx at rest", None)
    for walks in (walker.walk_many(requests), [*walker.walk_each(requests)]):
        for walk, word in zip(walks, words, strict=True):
            assert isinstance(walk, Walk if word is None else InputError)
            assert word is None or word in str(walk)
    with pytest.raises(InputError, match=words[3]):
        walker.walk(**requests[3])
    for lacking in ("end_s", "fulcrum_m"):
        broken = {name: value for name, value in requests[0].items() if name != lacking}
        for ask in (walker.walk_many, lambda asked: [*walker.walk_each(asked)]):
            with pytest.raises(TypeError, match=lacking):
                ask([requests[0], broken])


@pytest.mark.parametrize("forces", ["wrench", "load"])
def test_a_walk_with_a_force_that_is_no_number_has_failed_and_no_other(monkeypatch, trial, forces):
    real = module.run_side_by_side

    def spoilt(runs, **more):
        records = real(runs, **more)
        getattr(records[0], forces)[3, 0] = np.nan
        return records

    monkeypatch.setattr(module, "run_side_by_side", spoilt)
    walker = Walker(trial.subject, trial.model)
    request = trial_request(trial, start_s=0.45, end_s=0.46)
    failed, sound = walker.walk_many([request] * 2)
    assert isinstance(failed, SimulationError) and isinstance(sound, Walk)
    assert "is not a finite number" in str(failed) and failed.time_s == pytest.approx(0.454)


def test_walks_side_by_side_see_what_was_changed_in_the_Context(trial):
    walker = Walker(trial.subject, trial.model)
    requests = [trial_request(trial, start_s=0.45, end_s=0.46)] * 2
    before = walker.walk_many(requests)
    forces = walker.gait.forces["prosthetic"]
    forces.SetParameters(forces.GetMyContextFromRoot(walker.context), fulcrum_stiffness=5e4)
    after = walker.walk_many(requests)
    assert {float(walk.mechanism.fulcrum[0]) for walk in after} == {5e4}
    assert all(
        not np.array_equal(old.record.q, new.record.q)
        for old, new in zip(before, after, strict=True)
    )


@pytest.mark.parametrize(("count", "steps"), [(1, 10), (8, 1000), (9, 1000), (25, 1000), (0, 1)])
def test_walks_are_asked_for_in_even_parts_that_fill_the_lanes(walker, count, steps):
    parts = walker("right").parts([steps] * count)
    assert [i for part in parts for i in part] == [*range(count)]
    sizes = [len(part) for part in parts]
    assert len(sizes) == -(-count // WIDTH)
    assert max(sizes, default=0) - min(sizes, default=0) <= 1


def test_long_walks_are_made_fewer_at_a_time(walker, motion):
    """All that are made at a time take half of the memory that one may take at most."""
    step_bytes = bytes_a_step(run(walker, motion, end_s=0.01).mechanism)
    parts = walker("right").parts([int(0.24 * MOST_BYTES / step_bytes)] * 4)
    assert [len(part) for part in parts] == [2, 2]


def test_a_trial_is_simulated_at_another_setting(trial):
    short = dataclasses.replace(trial, start_s=0.45, end_s=0.46)
    assert (simulate_trial(short, fulcrum_m=0.151).fulcrum_m == 0.151).all()
    assert (simulate_trial(short).fulcrum_m == trial.fulcrum_m).all()


MIRROR = np.array([1.0, -1.0, 1.0])


UNEQUAL = Subject(
    mass_kg=71.0,
    stature_m=1.78,
    sex="male",
    prosthetic_side="right",
    thigh_length_m=0.44,
    shank_length_m=0.45,
    prosthetic_thigh_length_m=0.43,
    prosthesis_length_m=0.535,
    prosthesis_fore_aft_m=0.012,
    prosthesis_lateral_m=0.009,
    prosthesis_alignment_rad=0.04,
    prosthesis_inversion_rad=-0.03,
    prosthesis_toe_out_rad=0.12,
)
START_S, END_S = 0.15, 0.40
"""Part of the motion in which the prosthetic foot comes down and rolls to flat."""


def test_unequal_legs_walk_as_their_mirror_image(motion):
    """Coordinates are clinical: equal on both sides but for the pelvis's lateral ones."""
    walkers = [
        Walker(replace(UNEQUAL, prosthetic_side=side), ModelParameters())
        for side in ("right", "left")
    ]
    right, left = (
        walker.walk(
            motion(walker.subject.prosthetic_side), fulcrum_m=0.1, start_s=START_S, end_s=END_S
        )
        for walker in walkers
    )
    weight = UNEQUAL.mass_kg * 9.81
    assert right.prosthetic.grf_W[:, 2].max() > 0.3 * weight
    assert np.abs(right.prosthetic.grf_W[:, 1]).max() > 0.02 * weight, (
        "a planar walk would show nothing"
    )
    np.testing.assert_allclose(
        left.prosthetic.grf_W * MIRROR, right.prosthetic.grf_W, atol=1e-8 * weight
    )
    np.testing.assert_allclose(left.prosthetic.cop_W * MIRROR, right.prosthetic.cop_W, atol=1e-9)
    np.testing.assert_allclose(
        -left.prosthetic.free_moment_nm, right.prosthetic.free_moment_nm, atol=1e-7
    )
    other = {"_r": "_l", "_l": "_r"}
    for name in walkers[0].gait.prescribed:
        sign = -1.0 if name in ("pelvis_tz", "pelvis_list", "pelvis_rotation") else 1.0
        mirrored = name if name.startswith("pelvis") else name[:-2] + other[name[-2:]]
        load = right.record.load[:, right.mechanism.tree.index(name)]
        np.testing.assert_allclose(
            sign * left.record.load[:, left.mechanism.tree.index(mirrored)],
            load,
            atol=1e-9 * max(1.0, np.abs(load).max()),
            err_msg=name,
        )


@pytest.fixture(scope="module")
def hung_walker():
    return Walker(
        Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right"),
        ModelParameters(),
    )


def high_above(hung_walker, end_s):
    """A person high above the ground who moves no joint, sampled ten times a second."""
    names = hung_walker.gait.prescribed
    time = np.arange(0.0, end_s + 1.0, 0.1)
    values = np.tile([3.0 if name == "pelvis_ty" else 0.0 for name in names], (len(time), 1))
    return CoordinateTrajectory(time, values, names)


def hung(hung_walker, end_s):
    return hung_walker.walk(
        high_above(hung_walker, end_s), fulcrum_m=0.108, start_s=0.0, end_s=end_s
    )


def test_ten_minutes_are_refused_before_they_start_with_what_would_do(hung_walker, monkeypatch):
    monkeypatch.setattr(module, "Stepper", None)
    with pytest.raises(InputError, match="GB of memory") as refused:
        hung(hung_walker, 600.0)
    assert 60.0 < float(re.search(r"at most (\d+) s", str(refused.value))[1]) < 120.0


def test_a_step_takes_what_was_reckoned_at_most_and_half_of_it_at_least(hung_walker):
    trial = SimpleNamespace(name="", notes=(), synthetic=False, inputs={})
    walk = hung(hung_walker, 0.1)
    peaks = []
    for end_s in (1.2, 2.4):
        tracemalloc.start()
        hung_walker.result(hung(hung_walker, end_s), trial, GeometricOffsets())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert 0.5 < (peaks[1] - peaks[0]) / 1200 / bytes_a_step(walk.mechanism) <= 1.0


STEP_S = 2e-3


@pytest.fixture(scope="module")
def source():
    return load_trial(resource("data/reference_subject/exact/medium_1.yaml"))


@pytest.fixture(scope="module")
def referred(source):
    return Walker(source.subject, source.model)


def through(walker, source, **options):
    return walker.walk(
        source.trajectory,
        fulcrum_m=source.fulcrum_m,
        start_s=source.start_s,
        end_s=source.end_s,
        step_s=STEP_S,
        offsets=source.offsets,
        **options,
    )


def assert_same_walk(a, b, tolerance):
    """Forces to `tolerance` of the largest, coordinates to `tolerance` (m, rad)."""
    largest = np.abs(a.prosthetic.grf_W).max()
    np.testing.assert_allclose(
        b.prosthetic.grf_W, a.prosthetic.grf_W, rtol=0.0, atol=tolerance * largest
    )
    np.testing.assert_allclose(b.record.q, a.record.q, rtol=0.0, atol=tolerance)


def test_a_fitted_trial_walks_as_the_fit_did_with_courses(source, referred):
    """The samples carry curve and path to the spline's accuracy: fourth order in a hundredth of a
    second."""
    contact = made_contact(trials=(replace(OWN, fingerprint=fingerprint(source)),))
    phase, splines = gait_phase(source), periodic_bsplines(len(CURVE.coefficients))
    values = {**OF_THE_MODEL, **OF_THE_TRIAL}
    values["offset.height"] += OWN.height_m
    perturbations = []

    def perturbation(name, coordinate, shape, value):
        perturbations.append(MotionPerturbation(name=name, coordinate=coordinate, shape=shape))
        values[f"perturbation.{name}"] = value

    for i, value in enumerate(CURVE.coefficients):
        perturbation(f"curve.{i}", CURVE.coordinate, lambda t, i=i: splines(phase(t))[:, i], value)
    for name, coefficients in {**OWN.path, **OWN.curves}.items():
        basis = window_bsplines(source.start_s, source.end_s, len(coefficients))
        for i, value in enumerate(coefficients):
            perturbation(f"{name}.{i}", name, lambda t, i=i, basis=basis: basis(t)[:, i], value)
    wanted = through(referred, source, values=values, perturbations=perturbations)
    fitted = trial_with(source, contact)
    found = through(Walker(fitted.subject, fitted.model), fitted)
    assert_same_walk(wanted, found, 1e-5)
    plain = {name: value for name, value in values.items() if not name.startswith("perturbation.")}
    without = through(referred, source, values=plain)
    assert np.abs(without.prosthetic.grf_W - wanted.prosthetic.grf_W).max() > 20.0


MOST_FAILED = 0.05
"""Share of the walks that may end in an error (a choice): a search can do without these."""


@pytest.mark.parametrize("setting", [0, 1, 2])
def test_walks_stay_sound_with_any_parameters(setting):
    assert_sound(drawn(setting, 12, seed=setting, step_s=2e-3))


def test_a_foot_far_above_or_within_the_ground_stays_sound():
    found = drawn(0, 20, seed=4, step_s=2e-3, **{"offset.height": (-0.1, 0.1)})
    assert_sound(found)
    peaks = [one.peak_bw for one in found if one.failure is None]
    assert min(peaks) == 0.0
    assert max(peaks) > 5.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "count", "step_s"), [(0, 200, 1e-3), (1, 100, 2e-3), (2, 100, 2e-3)]
)
def test_hundreds_of_walks_stay_sound_with_any_parameters(setting, count, step_s):
    found = drawn(setting, count, seed=1, step_s=step_s)
    assert_sound(found)
    assert sum(one.failure is not None for one in found) <= MOST_FAILED * len(found)


def test_walks_of_as_many_steps_between_the_same_ends_have_their_own_motion(walker, motion):
    """Two steps whose last one is cut short: the second walk is what it is with a walker that never
    made the first."""
    person = walker("right")
    options = {"fulcrum_m": 0.108, "start_s": 0.0, "end_s": 0.3}
    person.walk(motion("right"), step_s=5e-3, **options)
    second = person.walk(motion("right"), step_s=5.01e-3, **options)
    fresh = Walker(person.subject, person.model).walk(motion("right"), step_s=5.01e-3, **options)
    assert second.record.q.tobytes() == fresh.record.q.tobytes()
