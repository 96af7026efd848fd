"""Sensitivities are the derivatives of the run: central differences, and identities that hold
exactly.

Two runs on both sides of a value have a force on different branches of its law where a sphere
touches down or lifts off, begins to slip or to come up: an event. Only there may a difference be
anything else than the derivative.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import keel_at_rest
import numpy as np
import pytest
from cut_walks import SETTINGS, cut_walk, hard_walker
from differences import branches, central, errors, exact_series, size

from vsf_drake.base.errors import InputError
from vsf_drake.laws.beam import section_inertia
from vsf_drake.model.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.simulation import walk as walk_module
from vsf_drake.simulation.stepping.stepper import run_side_by_side
from vsf_drake.simulation.variables import MotionPerturbation, perturbation_variables
from vsf_drake.simulation.walk import Walker

END_S, STRIKE_S, MID_STANCE_S = 0.94, 0.1, 0.4
GRID = np.array([0.0, 0.5, 1.0])
COORDINATES = ("pelvis_tx", "pelvis_ty", "hip_flexion_{}", "knee_angle_{}")
VALUES = {
    "offset.height": 2e-3,
    "offset.fore_aft": 4e-3,
    "offset.alignment": 0.02,
    "offset.inversion": -0.06,
    "offset.toe_out": 0.09,
    "contact.forefoot.rise": 1e-3,
    "coordinate.pelvis_list": 0.01,
    "fulcrum.shift": 0.004,
    "fulcrum.stiffness": 8e4,
}
"""Away from the defaults, so that nothing is right at zero only."""
FOOT = FootParameters()
JOINTS_M = np.cumsum(FOOT.keel.element_lengths_m) - 0.5 * np.array(FOOT.keel.element_lengths_m)
WIDTH_M, JOINT_M = 5e-3, float(JOINTS_M[2])
"""Joints are 23.29 mm apart there."""


@dataclass(frozen=True)
class Perturbed:
    """A person whose walks all have these perturbations, for helpers that know a walker."""

    person: Walker
    perturbations: tuple[MotionPerturbation, ...]

    def __getattr__(self, name):
        return getattr(self.person, name)

    @property
    def variables(self):
        return self.person.variables | perturbation_variables(
            self.perturbations, self.person.gait.prescribed, GRID
        )

    def walk(self, motion, **options):
        return self.person.walk(motion, perturbations=self.perturbations, **options)


def wave(time):
    """With a rate wherever a walk begins."""
    return 0.3 + np.sin(7.0 * time)


def perturbed(person):
    """The person with a perturbation on each of COORDINATES, on the prosthetic side."""
    names = [name.format(person.subject.prosthetic_side[0]) for name in COORDINATES]
    return Perturbed(person, tuple(MotionPerturbation(name, name, wave) for name in names))


def moving(time):
    return 0.09 + 0.05 * time


CASES = {
    "whole stance": ("right", {"fulcrum_m": 0.108, "start_s": STRIKE_S, "step_s": 2e-3}),
    "fulcrum moving, from loaded rest": (
        "left",
        {"fulcrum_m": moving, "start_s": MID_STANCE_S, "step_s": 2e-3},
    ),
}
FAMILIES = ("contact", "friction", "keel", "fulcrum", "socket", "offset", "coordinate")


def case(walker, motion, name, prefix=""):
    """The person, the motion and the arguments of a case; exponents above their least, to have two
    sides."""
    side, span = CASES[name]
    person = perturbed(walker(side)) if prefix == "perturbation" else walker(side)
    values = VALUES | {n: 1.05 for n in person.variables if n.endswith(".exponent")}
    if prefix == "perturbation":
        values = dict(zip(family(person, prefix), (4e-3, 5e-4, 0.01, -0.01), strict=True))
    return person, motion(side), {"end_s": END_S, "values": values} | span


def family(person, prefix):
    """Names of it, of coordinates those on which the force on the prosthetic foot depends."""
    other = "_l" if person.subject.prosthetic_side == "right" else "_r"
    return [
        name
        for name in person.variables
        if name.startswith(prefix)
        and (prefix == "perturbation" or not name.endswith(("_tx", "_tz", other)))
    ]


@pytest.mark.parametrize("prefix", [*FAMILIES, "perturbation"])
@pytest.mark.parametrize("name", CASES)
def test_central_differences_lead_to_the_sensitivity(walker, motion, name, prefix):
    """Changes by 3e-6 pass no event. What is left is the tolerance of Newton's method; at a start
    in equilibrium also what settling leaves, some 1e-9 m/s for some 0.1 s: 1e-10 m beside a change
    of the pose by as little as 3e-8 m."""
    person, recording, options = case(walker, motion, name, prefix)
    names = family(person, prefix)
    sensitivity = person.walk(recording, with_respect_to=names, **options).sensitivity
    for variable in names:
        by = central(
            person, recording, variable, 3e-6 * size(person.variables[variable]), **options
        )
        assert by.alike.all(), variable
        for key, error in errors(person, sensitivity, variable, by):
            assert error.max() < (5e-3 if options["start_s"] == MID_STANCE_S else 1e-3), (
                variable,
                key,
            )
            assert np.median(error) < 1e-6, (variable, key)


@pytest.mark.parametrize("name", ["landing", "catching"])
def test_steps_that_are_cut_carry_sensitivities_through_their_pieces(name):
    """Courses without a value, so that the walk is the one that is cut."""
    setting, values, step_s = SETTINGS[name]
    walker, trial = hard_walker(setting)
    person = perturbed(walker)
    options = {
        "values": values,
        "fulcrum_m": trial.fulcrum_m,
        "start_s": trial.start_s,
        "end_s": trial.end_s,
        "step_s": step_s,
    }
    names = (
        "offset.height",
        "contact.forefoot.stiffness",
        "friction.mu_static",
        "socket.ty.stiffness",
        *family(person, "perturbation"),
    )
    walk = person.walk(trial.trajectory, with_respect_to=names, **options)
    assert walk.record.parts.max() > 1 and walk.record.converged.all()
    np.testing.assert_array_equal(walk.record.q, cut_walk(name).record.q)
    for variable in names:
        by = central(
            person, trial.trajectory, variable, 1e-6 * size(person.variables[variable]), **options
        )
        same = np.logical_and.accumulate(by.alike)
        assert same[np.flatnonzero(walk.record.parts > 1)[0]], variable
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert error[same].max() < 3e-3, (variable, key)
            assert np.median(error) < 1e-4, (variable, key)


def test_person_who_walks_elsewhere_loads_the_ground_there_and_not_otherwise(walker, motion):
    """Shifted by a metre forward or to the right: the same force, a metre away (y_W is to the
    left)."""
    walk = walker("right").walk(
        motion("right"),
        fulcrum_m=0.108,
        start_s=MID_STANCE_S,
        end_s=END_S,
        step_s=2e-3,
        with_respect_to=("coordinate.pelvis_tx", "coordinate.pelvis_tz"),
    )
    by, loaded = walk.sensitivity, ~np.isnan(walk.prosthetic.cop_W[:, 0])
    assert np.count_nonzero(loaded) > 200
    assert np.abs(by.grf_W).max() < 1e-8
    np.testing.assert_allclose(
        by.cop_W[loaded], np.tile([[1.0, 0.0], [0.0, -1.0]], (loaded.sum(), 1, 1)), atol=1e-9
    )
    assert np.isnan(by.cop_W[~loaded]).all()
    assert np.abs(by.free_moment_nm).max() < 1e-8


@pytest.mark.parametrize(
    ("free", "settles"),
    [(("hip_rotation_r", "pelvis_list"), ()), (("pelvis_ty", "knee_angle_l"), ("pelvis_ty",))],
)
def test_free_coordinates_respond_too(motion, free, settles):
    """A pelvis that is free to rise and fall and others above and below a perturbation: as recorded
    at the start, or at rest.

    That rest is not quite reached, since a sticking foot creeps: the same share of a percent at any
    change.
    """
    subject = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
    person = Perturbed(
        Walker(subject, ModelParameters(), free=free),
        tuple(
            MotionPerturbation(name, name, wave)
            for name in ("hip_flexion_l", "pelvis_tx", "knee_angle_r")
        ),
    )
    start = dict(
        zip(motion("right").names, motion("right").sample(MID_STANCE_S)[0][0], strict=True)
    )
    options = {
        "fulcrum_m": 0.108,
        "start_s": MID_STANCE_S,
        "end_s": 0.55,
        "step_s": 1e-3,
        "initial": {name: float(start[name]) for name in settles},
    }
    names = (
        "contact.forefoot.stiffness",
        "keel.flexural_modulus",
        "fulcrum.shift",
        "offset.height",
        "coordinate.hip_flexion_l",
        "coordinate.knee_angle_r",
        "socket.ty.stiffness",
        *family(person, "perturbation"),
    )
    walk = person.walk(motion("right"), with_respect_to=names, **options)
    for variable in names:
        by = central(
            person, motion("right"), variable, 1e-5 * size(person.variables[variable]), **options
        )
        for key, error in errors(person, walk.sensitivity, variable, by):
            assert np.abs(exact_series(walk.sensitivity, variable)[key]).max() > 0.0
            assert error.max() < (0.01 if settles else 3e-3), (variable, key)


def test_run_is_the_same_bit_for_bit_whatever_it_is_differentiated_by(walker, motion):
    person, options = (
        walker("right"),
        {"fulcrum_m": 0.108, "start_s": STRIKE_S, "end_s": 0.5, "step_s": 1e-3},
    )
    names = ("offset.height", "fulcrum.shift", "contact.heel.stiffness")
    plain = person.walk(motion("right"), **options)
    assert plain.sensitivity is None
    some, one = (
        person.walk(motion("right"), with_respect_to=n, **options) for n in (names, names[1:2])
    )
    assert some.sensitivity.names == names and one.sensitivity.names == names[1:2]
    for walk in (some, one):
        for key in ("q", "v", "sites", "wrench", "fulcrum", "iterations"):
            np.testing.assert_array_equal(
                getattr(walk.record, key), getattr(plain.record, key), err_msg=key
            )
        # what holds the prescribed coordinates is summed in another order
        load = plain.record.load
        np.testing.assert_allclose(walk.record.load, load, rtol=0, atol=1e-14 * np.abs(load).max())
    # three columns are summed in another order than one on some processors
    alone = one.sensitivity.grf_W
    np.testing.assert_allclose(
        some.sensitivity.grf_W[:, :, 1:2], alone, rtol=1e-12, atol=1e-14 * np.abs(alone).max()
    )


def supported(walker: Walker, motion, fulcrum_m, width_m, **options):
    return walker.walk(
        motion("right"),
        fulcrum_m=fulcrum_m,
        start_s=0.1,
        end_s=0.7,
        step_s=2e-3,
        support_width_m=width_m,
        **options,
    )


def test_away_from_joints_a_width_changes_nothing(walker, motion):
    """108 mm is 7 mm from the nearest joint: bit for bit."""
    plain, wide = (supported(walker("right"), motion, 0.108, width) for width in (0.0, WIDTH_M))
    for key in ("q", "v", "load", "sites", "fulcrum"):
        np.testing.assert_array_equal(getattr(plain.record, key), getattr(wide.record, key))


@pytest.mark.parametrize("place", [-0.8, -0.4, 0.0, 0.4, 0.8])
def test_keel_gives_way_next_to_a_joint_as_castigliano_has_it(place):
    """The rise of the load point under F is the sum of m^2 / (F k) over the joints, m the moment
    about each.

    Only at this joint x does the width change it: m = F (L - x) - share F L / l (l - x), where the
    piece ahead of the joint has the share 0 or 1 without a width. 1 N keeps the keel straight.
    """
    load, fulcrum, share = 1.0, JOINT_M + place * WIDTH_M, 0.5 * (1.0 + place)
    modulus, reach = FOOT.keel.flexural_modulus_pa, FOOT.load_point_m
    sharp, wide = (
        keel_at_rest.rises(FOOT, np.array([load]), fulcrum, width)[0] for width in (0.0, WIDTH_M)
    )
    stiffness = (
        modulus
        * section_inertia(FOOT.keel.width_m, FOOT.keel.thickness_m)
        / FOOT.keel.element_lengths_m[2]
    )
    m_wide, m_sharp = (
        load * (reach - JOINT_M) - s * load * reach / fulcrum * (fulcrum - JOINT_M)
        for s in (share * share * (3.0 - 2.0 * share), float(place >= 0.0))
    )
    assert wide - sharp == pytest.approx(
        (m_wide**2 - m_sharp**2) / (load * stiffness), rel=1e-3, abs=1e-10
    )
    assert 0.0 <= wide - sharp + 1e-10
    assert wide - sharp < 0.175 * WIDTH_M * m_sharp / stiffness * reach / fulcrum * 1.05


@pytest.mark.parametrize("width", [-1e-3, 0.012, float("nan"), "5 mm"])
def test_width_that_reaches_the_next_joint_is_refused(walker, motion, width):
    with pytest.raises(InputError, match="support_width_m"):
        supported(walker("right"), motion, 0.108, width)


NAMES = (
    "fulcrum.shift",
    "fulcrum.stiffness",
    "keel.flexural_modulus",
    "contact.forefoot.stiffness",
    "contact.heel.stiffness",
    "contact.heel.damping",
    "contact.forefoot.rise",
    "friction.mu_static",
    "friction.threshold_velocity",
    "socket.tz.stiffness",
    "socket.flexion.stiffness",
    "socket.tx.stiffness",
    "offset.alignment",
    "offset.height",
    "offset.fore_aft",
)
ROLLED = {"fulcrum_m": 0.1, "start_s": 0.1, "end_s": 0.8, "step_s": 1e-3, "support_width_m": 6e-3}
"""From just before touch-down to toe-off, the support on two pieces of the keel."""


@pytest.fixture
def exact_steps(monkeypatch):
    """Newton's method to the last digits: a difference of loads sees what it leaves, over the
    step's square."""
    monkeypatch.setattr(walk_module, "run_side_by_side", partial(run_side_by_side, tolerance=1e-12))


def series(walk):
    """name -> (n, k) what a `LoadSensitivity` differentiates."""
    return {
        "load": walk.record.load,
        "socket": walk.socket_wrench,
        "q": walk.record.q,
        "v": walk.record.v,
    }


def driven(person, walk):
    """Coordinates that have a load."""
    names = (*person.gait.prescribed, "fulcrum")
    return [walk.mechanism.tree.index(name) for name in names]


def assert_differences_agree(person, recording, names, options, *, change=3e-5):
    """Each column within 2e-5 of its largest, where both ends are on the same branches of all laws.

    A column that hardly depends on the variable, by less than a 1e-3rd of the one that does most
    (of the state, a 1e-2nd), is held against that: differences end at what two runs leave of
    sixteen digits.
    """
    base = person.walk(recording, with_respect_to=names, with_loads=True, **options)
    found = base.load_sensitivity
    assert found.names == tuple(names)
    loaded = np.isin(np.arange(base.record.q.shape[1]), driven(person, base))
    assert not found.load[:, ~loaded].any()
    for p, name in enumerate(names):
        step = change * size(person.variables[name])
        ends = [
            person.walk(
                recording, values={name: person.variables[name].default + sign * step}, **options
            )
            for sign in (-1.0, 1.0)
        ]
        alike = np.all(branches(ends[0]) == branches(ends[1]), axis=1)
        assert alike.mean() > 0.9, name
        low, high = (series(walk) for walk in ends)
        for key, one in low.items():
            by = ((high[key] - one) / (2.0 * step))[alike]
            exact = getattr(found, key)[alike, :, p]
            if key == "load":
                by, exact = by[:, loaded], exact[:, loaded]
            largest = np.abs(exact).max(axis=0)
            assert largest.max() > 0.0, (name, key)
            scale = np.maximum(largest, (1e-2 if key in "qv" else 1e-3) * largest.max())
            assert (np.abs(exact - by) / scale).max() < 2e-5, (name, key)
    return base


@pytest.mark.usefixtures("exact_steps")
def test_differences_of_walks_lead_to_the_derivatives(walker, motion):
    walk = assert_differences_agree(walker("left"), motion("left"), NAMES, ROLLED)
    assert walk.prosthetic.grf_W[:, 2].max() > 500.0
    knee, other = (walk.mechanism.tree.index(name) for name in ("knee_angle_l", "knee_angle_r"))
    assert np.abs(walk.load_sensitivity.load[:, knee, 0]).max() > 100.0
    assert not walk.load_sensitivity.load[:, other].any()


@pytest.mark.usefixtures("exact_steps")
@pytest.mark.parametrize("name", ["landing", "catching"])
def test_load_of_a_step_that_was_cut_is_the_mean_of_its_pieces_derivatives_too(name):
    setting, values, step_s = SETTINGS[name]
    person, trial = hard_walker(setting)
    options = {
        "values": values,
        "fulcrum_m": trial.fulcrum_m,
        "start_s": trial.start_s,
        "end_s": trial.end_s,
        "step_s": step_s,
    }
    variable, change = "socket.ty.stiffness", 1e-6 * person.variables["socket.ty.stiffness"].default
    walk = person.walk(trial.trajectory, with_respect_to=(variable,), with_loads=True, **options)
    at = values.get(variable, person.variables[variable].default)
    low, high = (
        person.walk(
            trial.trajectory, **options | {"values": values | {variable: at + sign * change}}
        )
        for sign in (-1.0, 1.0)
    )
    same = np.logical_and.accumulate(np.all(branches(low) == branches(high), axis=1))
    cut = same & (walk.record.parts > 1)
    assert cut.any()
    rows = driven(person, walk)
    by, exact = (
        (high.record.load - low.record.load)[:, rows] / (2.0 * change),
        walk.load_sensitivity.load[:, rows, 0],
    )
    assert np.abs(by - exact)[cut].max() < 1e-4 * np.abs(exact[same]).max()


def test_variables_that_move_prescribed_coordinates_are_refused(walker, motion):
    perturbation = MotionPerturbation("bend", "knee_angle_r", lambda t: t)
    for name in ("coordinate.knee_angle_r", "perturbation.bend"):
        with pytest.raises(InputError, match=f"not differentiated by {name}"):
            walker("right").walk(
                motion("right"),
                perturbations=(perturbation,),
                with_respect_to=(name,),
                with_loads=True,
                **ROLLED,
            )
