"""What happens at the edges: moving fulcrum, hard stops, sliding, bad input, divergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference_runs import simulate_reference

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import FrictionParameters, ModelParameters, Subject
from vsf_drake.simulation.mechanism import gait_mechanism
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.stepping.stepper import Inputs, Stepper
from vsf_drake.simulation.walk import Walker, walk_notes

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")


def run(walker, motion, **options):
    chosen = {"fulcrum_m": 0.108, "start_s": 0.0, "end_s": 0.94} | options
    return walker("right").walk(motion("right"), **chosen)


def test_fulcrum_may_move_during_a_run(walker, motion, stance):
    """It moves in swing from the soft to the stiff setting: the stance is that of the stiff setting."""
    def path(t):
        return np.interp(t, [0.0, 0.08], [0.066, 0.151])

    moved = run(walker, motion, fulcrum_m=path)
    stiff, soft = run(walker, motion, fulcrum_m=0.151), run(walker, motion, fulcrum_m=0.066)
    late = slice(200, None)
    scale = np.abs(stiff.prosthetic.grf_W - soft.prosthetic.grf_W)[late].max()
    assert scale > 50.0
    assert np.abs(moved.prosthetic.grf_W - stiff.prosthetic.grf_W)[late].max() < 0.01 * scale
    carriage = moved.mechanism.tree.index("fulcrum")
    np.testing.assert_allclose(moved.record.q[:, carriage], path(moved.record.time_s), atol=1e-12)
    assert moved.record.converged.all()


def test_fulcrum_may_move_under_load_in_both_ways_of_advancing(walker, motion):
    def path(t):
        return 0.1 + 0.3 * (t - 0.5)

    span = {"start_s": 0.5, "end_s": 0.56}
    reference = simulate_reference(walker("right"), motion("right"), fulcrum_m=path, **span)
    walk = run(walker, motion, fulcrum_m=path, step_s=2.5e-4, **span)
    np.testing.assert_allclose(walk.prosthetic.grf_W[3::4][10:], reference.grf_W[11:], atol=2.0)


def test_alignment_and_height_reach_the_foot(walker, motion, stance):
    usual = stance("right", 1e-3).prosthetic.grf_W[:, 2].sum()
    higher = run(walker, motion, offsets=GeometricOffsets(height_m=0.005)).prosthetic.grf_W[:, 2].sum()
    assert higher < 0.9 * usual
    shifted = run(walker, motion, offsets=GeometricOffsets(fore_aft_m=0.01)).prosthetic
    straight = stance("right", 1e-3).prosthetic
    both = ~np.isnan(shifted.cop_W[:, 0]) & ~np.isnan(straight.cop_W[:, 0])
    assert np.median((shifted.cop_W - straight.cop_W)[both, 0]) == pytest.approx(0.01, abs=2e-3)
    again = run(walker, motion)
    np.testing.assert_array_equal(again.record.q, stance("right", 1e-3).record.q)


def test_every_step_converges_from_stick_to_slip(stance, walker, motion):
    for step_s in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        assert stance("right", step_s).record.converged.all()
    for height in np.linspace(-0.01, 0.01, 5):
        for step_s in (4e-3, 2e-3, 1e-3):
            walk = run(walker, motion, step_s=step_s, offsets=GeometricOffsets(height_m=float(height)))
            assert walk.record.converged.all()


def test_every_step_converges_on_slippery_and_on_grippy_ground(motion):
    for friction in (FrictionParameters(mu_static=0.1, mu_kinetic=0.05),
                     FrictionParameters(mu_static=1.2, mu_kinetic=0.3, threshold_velocity_m_per_s=0.01),
                     FrictionParameters(mu_static=0.117, mu_kinetic=0.336, threshold_velocity_m_per_s=1.18)):
        model = ModelParameters()
        model = replace(model, foot=replace(model.foot, friction=friction))
        walk = Walker(SUBJECT, model).walk(motion("right"), fulcrum_m=0.108, start_s=0.0, end_s=0.94)
        assert np.count_nonzero(~walk.record.converged) <= 1
        forces = walk.prosthetic.grf_W
        most = max(friction.mu_static, friction.mu_kinetic)
        assert np.all(np.linalg.norm(forces[:, :2], axis=1) <= most * forces[:, 2] + 1e-9)


def hanging(walker, **socket_tz):
    """(stepper, inputs, q0) of the person held in the air for 0.4 s, the socket's axial spring changed."""
    mechanism = gait_mechanism(walker.gait, walker.context)
    tree, springs = mechanism.tree, np.array(mechanism.springs)
    row = list(mechanism.spring_index).index(tree.index("socket_tz"))
    for name, value in socket_tz.items():
        springs[row, SPRING_COLUMNS.index(name)] = value
    prescribed = np.array([tree.index(name) for name in (*walker.gait.prescribed, "fulcrum")])
    held = np.zeros((401, len(prescribed)))
    held[:, 1], held[:, -1] = 1000.0, 0.1
    inputs = Inputs(time_s=1e-3 * np.arange(401), prescribed=prescribed, prescribed_q=held, fulcrum=held[:, -1],
                    ground=np.zeros(401))
    q0 = np.zeros(tree.num_coordinates)
    q0[prescribed] = held[0]
    return Stepper(replace(mechanism, springs=springs)), inputs, q0


def test_unconverged_steps_are_counted(walker):
    """Against a stop so stiff that rounding alone leaves newtons no step can converge: each says so."""
    stepper, inputs, q0 = hanging(walker("right"), limit=1e-3, stop_ratio=1e16)
    record = stepper.run(inputs, q0, np.zeros_like(q0))
    assert np.count_nonzero(~record.converged) > 100
    assert np.isfinite(record.q).all()
    stepper, inputs, q0 = hanging(walker("right"))
    assert stepper.run(inputs, q0, np.zeros_like(q0)).converged.all()


def test_divergence_names_time_and_coordinate(walker):
    """A spring that pushes away instead of back throws the prosthesis off."""
    stepper, inputs, q0 = hanging(walker("right"), stiffness=-1e4, stiffness_negative=-1e4, damping=0.0)
    with pytest.raises(SimulationError, match=r"failed at t = [\d.]+ s: coordinate \w+ diverged") as error:
        stepper.run(inputs, q0, np.zeros_like(q0))
    assert 0.0 < error.value.time_s < 0.4
    assert error.value.exit_code == 3


@pytest.mark.parametrize(("options", "message"), [
    ({"step_s": "1e-3"}, "step_s: '1e-3' is not usable"), ({"step_s": 1e-12}, "no time to walk"),
    ({"end_s": np.inf}, "end_s: inf"), ({"start_s": None}, "start_s: None"), ({"offsets": {"height_m": 0.0}}, "a dict"),
    ({"fulcrum_m": lambda t: "a"}, "fulcrum_m: gives"), ({"fulcrum_m": lambda t: [0.1, 0.1]}, "one for each time"),
    ({"fulcrum_m": "0.1"}, "fulcrum_m: gives"), ({"fulcrum_m": np.nan}, "finite number"),
    ({"values": "offset.height"}, "no mapping"), ({"values": {"offset.height": 5.0}}, "from -0.2 to 0.2 m"),
    ({"values": {"coordinate.knee_angle_r": 100.0}}, "from -1 to 1 rad"),
    ({"values": {"contact.heel.exponent": 50.0}}, "from 1 to 20"),
    ({"with_respect_to": "offset.height"}, "no list of names"), ({"with_respect_to": None}, "no list of names"),
    ({"with_respect_to": [["offset.height"]]}, "there is no variable"),
    ({"with_respect_to": iter(["offset.height"] * 2)}, "stands twice"),
    ({"step_s": 0.0}, "not a usable step"), ({"step_s": 0.5}, "not a usable step"),
    ({"fulcrum_m": 0.2}, "out of the carriage's reach"), ({"end_s": 1.5}, "outside the recording"),
    ({"fulcrum_m": lambda t: 0.1 + t}, "out of the carriage's reach")])
def test_useless_input_is_refused(walker, motion, options, message):
    with pytest.raises(InputError, match=message):
        run(walker, motion, **options)


def test_missing_coordinate_is_named(walker, motion):
    full = motion("right")
    short = CoordinateTrajectory(full.time_s, full.values[:, 1:], full.names[1:])
    with pytest.raises(InputError, match="pelvis_tx"):
        walker("right").walk(short, fulcrum_m=0.1, start_s=0.0, end_s=0.5)


def test_free_joints_move_under_their_load(motion):
    """The intact knee let go hangs and swings; everything else stays prescribed."""
    walker = Walker(SUBJECT, ModelParameters(), free=("knee_angle_l",))
    walk = walker.walk(motion("right"), fulcrum_m=0.108, start_s=0.0, end_s=0.94, initial={"knee_angle_l": 0.5})
    i = walk.mechanism.tree.index("knee_angle_l")
    assert "knee_angle_l" not in walker.gait.prescribed
    assert np.abs(walk.record.load[:, i]).max() < 1e-2
    assert np.ptp(walk.record.q[:, i]) > 0.05
    assert walk.record.converged.all()


def test_same_input_gives_the_same_bits(walker, motion):
    first, second = run(walker, motion, end_s=0.3), run(walker, motion, end_s=0.3)
    np.testing.assert_array_equal(first.record.q, second.record.q)
    np.testing.assert_array_equal(first.record.load, second.record.load)


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
