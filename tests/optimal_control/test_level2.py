"""The stride that is solved for: its derivatives, its costs, what it is against the recording and
the full model."""

import dataclasses
import importlib
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from vsf_drake.base.errors import FitError, InputError
from vsf_drake.collocation.solution import Start
from vsf_drake.laws.joint_strength import Muscles
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.optimal_control import normal, saved
from vsf_drake.optimal_control.outcomes import (
    MEASURES,
    muscle_energy,
    outcomes,
    published_signs,
    steady_signs,
    taken_and_given,
)
from vsf_drake.optimal_control.resimulate import resimulate_prescribed
from vsf_drake.optimal_control.saved import as_good, as_little, stride_arrays, stride_table
from vsf_drake.optimal_control.search import (
    FAR,
    Fixed,
    Held,
    StrideSearch,
    StrideSolution,
    StrideTuning,
    swept,
    tracked,
    with_recorded,
)
from vsf_drake.optimal_control.solve import solve
from vsf_drake.optimal_control.stride import MM, STEADY, TYPICAL_ACTIVATION, WORK, StrideOptions
from vsf_drake.optimal_control.trajectory import solved_trajectory
from vsf_drake.tuning.common import FREE_COSTS, least_seen
from vsf_drake.tuning.options import TuningOptions
from vsf_drake.tuning.quantities import FREE_OUTCOMES
from vsf_drake.walks.embedded import embedded_contact, embedded_trials


@pytest.fixture(scope="module")
def trial():
    manifest = next(path for path in embedded_trials(tier="exact") if path.stem == "medium_1")
    return trial_with(load_trial(manifest), load_contact(embedded_contact("exact")))


@pytest.fixture(scope="module")
def tuning(trial):
    return StrideTuning([trial], cost="joint_load", options=StrideOptions(confirm=()))


@pytest.fixture(scope="module")
def stride(tuning):
    return tuning.stride


@pytest.fixture(scope="module")
def tracked_stride(tuning):
    """In one stage: the recorded stride is near enough."""
    return tracked(tuning.stride, warm=tuning.stride.start(tuning.stride.own_m / MM))


def test_a_stride_begins_in_balance_and_its_derivatives_equal_central_differences(stride):
    start = stride.start(stride.own_m / MM)
    y, by_z, by_p = stride.function.linearise(start.z, start.p)
    balance = [
        i
        for i in stride.function.starting_with("balance_")
        if "pelvis" not in stride.function.names[i]
    ]
    assert np.abs(y[:, balance]).max() < 1e-6 * stride.model.weight, "of keel and socket"
    rng = np.random.default_rng(3)
    dz, dp = rng.standard_normal(start.z.shape), np.array([1e-2, 0.3, 0.1, 0.2, 0.3])
    dz[:, stride.function.layout.w] *= 1e-2
    h, p = 1e-6, np.append(start.p[:-1], 1.1)
    y, by_z, by_p = stride.function.linearise(start.z, p)
    ahead, behind = (
        stride.function.evaluate(start.z + s * h * dz, p + s * h * dp) for s in (1.0, -1.0)
    )
    exact = np.einsum("nmz,nz->nm", by_z, dz) + by_p @ dp
    scale = np.abs(exact).max(axis=0) + 1.0
    assert np.abs((ahead - behind) / (2.0 * h) - exact).max(axis=0) / scale == pytest.approx(
        0.0, abs=1e-4
    )


def test_trajectories_one_below_the_other_have_the_derivatives_of_each_alone(stride):
    """To the bit, each instant with its own centre of pressure."""
    start = stride.start(stride.own_m / MM)
    rng = np.random.default_rng(4)
    shape = (3, *start.z.shape)
    each = start.z + 1e-3 * rng.standard_normal(shape)
    together = stride.function.linearise(np.concatenate(each), start.p)
    alone = zip(*(stride.function.linearise(z, start.p) for z in each), strict=True)
    for found, wanted in zip(together, alone, strict=True):
        assert np.array_equal(found, np.concatenate(wanted))


def test_a_stride_that_takes_longer_is_the_same_curve_with_slower_rates_at_the_recorded_speed(
    tuning, stride
):
    """The other way: what is handed over meets the collocation of a grid of the longer time, with
    its advance."""
    pace, grid, layout = 1.1, stride.grid, stride.function.layout
    z, p = np.zeros((grid.instants, layout.size)), np.array([0.1, 1.0, 0.0, 1.0, pace])
    t, T = grid.times_s[:, None], grid.duration_s
    w = 2.0 * np.pi / T * np.arange(1, layout.n + 1)
    z[:, layout.q], z[:, layout.v], z[:, layout.a] = (
        np.sin(w * t),
        w * np.cos(w * t),
        -(w**2) * np.sin(w * t),
    )
    z[:, 1] += stride.speed * t[:, 0]
    z[:, layout.v][:, 1] += stride.speed
    end = SimpleNamespace(
        problem=stride.problem([], (66.0, 151.0)),
        z=z,
        p=p,
        y=lambda: np.zeros((grid.instants, len(stride.function.names))),
    )
    given = solved_trajectory(end, tuning.walker, outputs=stride.function.names)
    assert given.period_s == pytest.approx(pace * T) and given.advance[1] == pytest.approx(
        stride.speed * pace * T
    )
    _, v, a, *_ = stride.function.parts(z, p)
    np.testing.assert_allclose(given.v[:-1], v.T)
    np.testing.assert_allclose(given.a[:-1], a.T)
    spline = CubicSpline(given.time_s, given.q, axis=0)
    inner = slice(4, -4)
    np.testing.assert_allclose(
        spline(given.time_s, 1)[inner, :4], given.v[inner, :4], rtol=1e-3, atol=0.02
    )
    assert given.v[:-1, 1].mean() == pytest.approx(stride.speed, rel=1e-9)


def test_constant_joint_power_costs_its_work_over_the_efficiencies(stride):
    y = np.zeros((stride.grid.instants, len(stride.function.names)))
    powers = stride.function.starting_with("power_")
    y[:, powers[0]], y[:, powers[1]] = 1000.0, -1000.0
    work = 1000.0 * stride.grid.duration_s / stride.model.subject.mass_kg
    assert stride.value("metabolic", y) == pytest.approx(
        work * (1.0 / 0.25 + 1.0 / 1.2), rel=stride.options.smooth_power_w / 1000.0
    )


def test_work_comes_with_half_a_joint_load_and_no_other_cost_does(stride):
    sizes = dict.fromkeys(FREE_COSTS, 2.0)
    y = np.random.default_rng(5).standard_normal((stride.grid.instants, len(stride.function.names)))

    def total(cost, name):
        return sum(
            float(stride.grid.weights @ part.values(y))
            for part in stride.minimised(cost, sizes)
            if part.name == name
        )

    for cost in WORK:
        assert total(cost, "steady") == pytest.approx(STEADY * stride.value("joint_load", y) / 2.0)
    assert total("metabolic", "metabolic") == pytest.approx(stride.value("metabolic", y) / 2.0)
    for cost in ("joint_load", "activation"):
        assert {part.name for part in stride.minimised(cost, sizes)} == {cost, "normal", "smooth"}


def test_able_bodied_walking_deviates_by_nothing_from_itself_and_by_a_half_one_deviation_off(
    stride,
):
    """Angles and forces count a half each; where the pelvis is does not count."""
    target, function = stride.able_bodied, stride.function
    y = np.zeros((stride.grid.instants, len(function.names)))
    y[:, function.starting_with("q_")] = target.q
    y[:, function.index("q_pelvis_tx")] += 0.3
    for foot, force in target.force.items():
        y[:, function.index(f"{foot}_fx", f"{foot}_fz")] = force
    assert stride.value("normal", y) == pytest.approx(0.0, abs=1e-12)
    sd = stride.gait.angle_sd(stride.model.coordinates)
    angles = np.flatnonzero(np.isfinite(sd))
    y[:, np.array(function.starting_with("q_"))[angles]] += sd[angles]
    assert len(angles) == 6 and stride.value("normal", y) == pytest.approx(0.5)


def test_a_stride_at_another_speed_is_the_same_curves_longer_and_faster(stride):
    """The other way: what is handed over meets the collocation of the new grid, and its rates are
    its derivatives."""
    start = stride.start(stride.own_m / MM)
    other, begun = stride.at_speed(1.44 * stride.speed, start)
    assert other.speed == pytest.approx(1.44 * stride.speed)
    assert other.advance_m == pytest.approx(1.2 * stride.advance_m)
    assert other.grid.duration_s == pytest.approx(stride.grid.duration_s / 1.2)

    def left(one, z):
        """Of the collocation's equations: the recorded curves are finer than the grid."""
        matrix, right = one.grid.collocation(one.function.layout, one.advance_m * np.eye(8)[1])
        return np.abs(matrix @ z.ravel() - right)

    # Those of lengths are 1.2 times as long, those of rates as fast; of the pelvis's way both.
    ratio = left(other, begun.z) / np.maximum(left(stride, start.z), 1e-9)
    assert ratio.max() < 1.2**2 + 1e-6
    assert begun.z[-1, 1] - begun.z[0, 1] == pytest.approx(1.2 * (start.z[-1, 1] - start.z[0, 1]))
    assert begun.z[0, 1] == other.reference.q[0, 1], "where the problem fixes the pelvis at first"


def test_a_recording_that_is_met_deviates_by_nothing(stride):
    reference, function = stride.reference, stride.function
    y = np.zeros((stride.grid.instants, len(function.names)))
    y[:, function.starting_with("q_")], y[:, function.starting_with("a_")] = (
        reference.q,
        reference.a,
    )
    for foot, force in reference.force.items():
        y[:, function.index(f"{foot}_fx", f"{foot}_fz")] = force
    assert stride.value("deviation", y) == pytest.approx(0.0, abs=1e-12)
    y[:, function.starting_with("q_")[3:]] += np.radians(stride.options.angle_deg)
    # Five of eight coordinates off by one scale; coordinates and forces count a half each.
    assert stride.value("deviation", y) == pytest.approx(0.5 * 5 / 8)


@pytest.mark.slow
def test_the_tracked_stride_is_the_recorded_one_and_the_full_model_confirms_its_force(
    tuning, stride, tracked_stride
):
    assert tracked_stride.success and tracked_stride.violation < 1e-6
    y, reference = tracked_stride.y(), stride.reference
    angles = np.degrees(y[:, stride.function.starting_with("q_")] - reference.q)[
        :, [0, 3, 4, 5, 6, 7]
    ]
    assert np.sqrt(np.mean(angles**2, axis=0)).max() < 2.0
    for foot, force in reference.force.items():
        size = np.linalg.norm(y[:, stride.function.index(f"{foot}_fx", f"{foot}_fz")], axis=1)
        assert (
            np.sqrt(np.mean((size - np.linalg.norm(force, axis=1)) ** 2))
            < 0.06 * stride.model.weight
        )
    trajectory = solved_trajectory(
        tracked_stride, tuning.walker, outputs=stride.function.names, offsets=tuning.trial.offsets
    )
    assert resimulate_prescribed(tuning.walker, trajectory).percent_bw < 3.0


def test_a_foot_works_on_the_centre_of_mass_by_its_force_at_the_velocity_that_both_feet_make(
    stride,
):
    """80 sin(w t) N forward and the weight times 1 + 0.2 cos(w t) up, in a stride that takes
    1.1 times as long: the velocity is the speed less 80 / (m w) cos(w t) forward and 0.2 g / w
    sin(w t) up."""
    grid, mass, pace = stride.grid, stride.model.subject.mass_kg, 1.1
    w, phase = 2.0 * np.pi / (pace * grid.duration_s), 2.0 * np.pi * grid.times_s / grid.duration_s
    along, up = 80.0 * np.sin(phase), mass * GRAVITY * (1.0 + 0.2 * np.cos(phase))
    y = np.zeros((grid.instants, len(stride.function.names)))
    y[:, stride.function.index("prosthetic_fx", "prosthetic_fz")] = np.column_stack([along, up])
    start = stride.start(stride.own_m / MM)
    slower = Start(z=start.z, p=np.append(start.p[:-1], pace))
    found = outcomes(SimpleNamespace(last=slower, last_y=lambda: y), stride)
    power = along * (
        stride.speed - 80.0 / (mass * w) * np.cos(phase)
    ) + up * 0.2 * GRAVITY / w * np.sin(phase)
    late = stride.reference.late & stride.reference.stance["prosthetic"]
    by_hand = pace * grid.weights @ (late * np.maximum(power, 0.0)) / mass
    assert by_hand > 0.01 and found["com_push_off_work"] == pytest.approx(by_hand, rel=5e-3)


def test_the_first_peak_is_in_the_first_half_of_a_stance_and_the_second_in_the_second(stride):
    """Two humps of 1.2 and 1.1 body weights under the one foot, of 1.3 and 0.9 under the other,
    whose stance goes over the end of the period."""
    grid, weight = stride.grid, stride.model.subject.mass_kg * GRAVITY
    y = np.zeros((grid.instants, len(stride.function.names)))
    for foot, humps in (("prosthetic", (1.2, 1.1)), ("intact", (1.3, 0.9))):
        stance = stride.reference.stance[foot]
        start = np.flatnonzero(stance & ~np.roll(stance, 1))[0]
        rows = (start + np.arange(stance.sum())) % grid.instants
        assert stance[rows].all() and ((rows[-1] < start) is np.bool_(foot == "intact"))
        part = np.linspace(0.0, 1.0, len(rows))
        y[rows, stride.function.index(f"{foot}_fz")[0]] = (
            weight * np.where(part < 0.5, *humps) * np.sin(2.0 * np.pi * part) ** 2
        )
    start = stride.start(stride.own_m / MM)
    found = outcomes(SimpleNamespace(last=start, last_y=lambda: y), stride)
    for name, peak in (
        ("prosthetic_first", 1.2),
        ("prosthetic_second", 1.1),
        ("intact_first", 1.3),
    ):
        assert found[f"{name}_peak"] == pytest.approx(peak, rel=0.02)


@pytest.fixture(scope="module")
def coarsely(stride):
    """The recorded stride as a possible motion on 20 intervals."""
    return tracked(dataclasses.replace(stride, grid=dataclasses.replace(stride.grid, intervals=20)))


@pytest.mark.slow
def test_a_free_fulcrum_is_at_least_as_good_as_where_it_was_freed(stride, coarsely):
    own = dataclasses.replace(stride, grid=coarsely.problem.grid, consistent=coarsely)
    search = StrideSearch(
        own, "joint_load", {name: own.value(name, coarsely.y()) for name in FREE_COSTS}
    )
    fixed = search.at(120.0, coarsely.last, "fixed")
    free = search.free(fixed.last, "free")
    assert fixed.success and free.success
    assert free.cost <= fixed.cost + 1e-9
    assert 66.0 < free.p[0] / MM < 151.0


def test_outcomes_have_the_signs_of_walking_and_those_of_a_slower_stride_its_time(stride, coarsely):
    """Late in stance the ground bears before the pylon and turns the toe up by more than 0.5 N
    m/kg, and the knee is not straight beyond 5 degrees: no walk does otherwise. Markers on the
    socket show it straighter by what that turns. At the same instants a stride that takes 1.1 times
    as long is as much longer, has the same angles, and at rates 1.1 times smaller less power."""
    own = dataclasses.replace(stride, grid=coarsely.problem.grid, consistent=coarsely)
    found = outcomes(coarsely, own)
    assert 1.0 < found["dorsiflexion"] < 30.0 and 0.5 < found["ankle_moment"] < 2.5
    assert found["push_off_power"] > 0.0 and found["push_off_work"] > 0.0
    assert 0.3 < found["returned_energy"] / found["stored_energy"] < 1.0, "a passive foot"
    assert found["strain_energy"] < found["stored_energy"], "foam and losses take a part"
    assert found["stride_time"] == pytest.approx(stride.recorded.period_s)
    knee = -np.degrees(
        coarsely.last.z[own.reference.late & own.reference.stance["prosthetic"], 4].min()
    )
    assert -40.0 < knee < 5.0 and knee + 1.0 < found["knee_extension"] < knee + 6.0
    start = Start(z=coarsely.last.z, p=np.append(coarsely.last.p[:-1], 1.1))
    slower = outcomes(
        SimpleNamespace(last=start, last_y=lambda: own.function.evaluate(start.z, start.p)), own
    )
    for name in ("stride_time", "stride_length"):
        assert slower[name] == pytest.approx(1.1 * found[name])
    for name in ("dorsiflexion", "knee_extension"):
        assert slower[name] == pytest.approx(found[name])
    assert slower["push_off_power"] < found["push_off_power"]


@pytest.mark.parametrize("c", [0.0, 40.0])
def test_a_pressed_spring_and_damper_returns_what_it_stored_less_what_the_damper_took(c):
    """x = X sin^2(pi t / T): the spring stores k X^2 / 2, the damper takes c X^2 pi^2 / (2 T).
    Either way round: what presses it takes the same power with the other sign."""
    k, X, T = 2e4, 0.02, 0.7
    t = np.linspace(0.0, T, 2001)[:-1]
    x, v = X * np.sin(np.pi * t / T) ** 2, X * np.pi / T * np.sin(2.0 * np.pi * t / T)
    weights = np.full(t.shape, T / len(t))
    power = -(k * x + c * v) * v
    taken, given = taken_and_given(power, weights)
    assert taken - given == pytest.approx(0.5 * c * (X * np.pi) ** 2 / T, abs=1e-9)
    assert given <= taken + 1e-12 and taken >= 0.5 * k * X**2 * (1.0 - 1e-6)
    if c == 0.0:
        assert given == pytest.approx(0.5 * k * X**2, rel=1e-6)
    assert taken_and_given(-power, weights) == pytest.approx((given, taken))


def test_energy_of_the_muscles_is_their_power_over_real_time_and_length(stride, coarsely):
    """The other way: rates from the angles over the time of a stride that takes 1.1 times as long.
    It is more than the joints' positive work, a part of which passive tissue gives back."""
    own, subject = dataclasses.replace(stride, grid=coarsely.problem.grid), stride.model.subject
    start = Start(z=coarsely.last.z, p=np.append(coarsely.last.p[:-1], 1.1))
    y = own.function.evaluate(start.z, start.p)
    joints = stride.model.coordinates[3:]
    time_s = 1.1 * np.append(own.grid.times_s, own.grid.duration_s)
    angle = CubicSpline(
        time_s, np.vstack([start.z, start.z[:1]])[:, 3 : 3 + len(joints)], bc_type="periodic"
    )
    active = y[:, own.function.index(*(f"activation_{joint}" for joint in joints))].T
    power = (
        Muscles(
            [joint.split("_")[0] for joint in joints],
            subject.sex,
            subject.mass_kg * 9.81 * subject.stature_m,
        )
        .metabolic_power(active, angle(time_s[:-1]).T, angle(time_s[:-1], 1).T)
        .sum(0)
    )
    mass_length = subject.mass_kg * 1.1 * own.advance_m
    found = muscle_energy(SimpleNamespace(last=start, last_y=lambda: y), own)
    assert found == pytest.approx(
        np.trapezoid(np.append(power, power[0]), time_s) / mass_length, rel=0.03
    )
    work = np.maximum(y[:, own.function.starting_with("power_")], 0.0).sum(1)
    assert found > np.trapezoid(np.append(work, work[0]), time_s) / mass_length


def test_a_consistent_stride_is_what_it_was_made_of_and_both_feet_s_forces_are_known(
    stride, coarsely
):
    """The other way: its motion and forces are the solution's, on its own grid and, between
    strikes, on a finer one."""
    solution = coarsely
    coarse = dataclasses.replace(stride, grid=solution.problem.grid, consistent=solution)
    y = coarse.function.evaluate(solution.z, solution.p)
    assert coarse.value("deviation", y) == pytest.approx(0.0, abs=1e-9)
    reference, fine = coarse.reference, dataclasses.replace(stride, consistent=solution).reference
    np.testing.assert_allclose(fine.q[::2], reference.q, atol=1e-9)
    for foot in reference.force:
        assert reference.known[foot].all() and fine.known[foot].all()
        np.testing.assert_allclose(fine.force[foot][::2], reference.force[foot], atol=1e-6)
        loaded = reference.force[foot][:, 1] > 50.0
        np.testing.assert_allclose(reference.moment[foot][loaded], 0.0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("stem", ["low_1", "high_1"])
def test_a_consistent_stride_that_is_tracked_finds_its_own_fulcrum(stem):
    """Its cost is least there but for the moments that make the tracking unique: 1 mm. Both
    settings are ends of the reach, and the search begins at the other."""
    manifest = next(path for path in embedded_trials(tier="exact") if path.stem == stem)
    trial = trial_with(load_trial(manifest), load_contact(embedded_contact("exact")))
    stride = StrideTuning([trial], cost="tracking", options=StrideOptions(intervals=20)).stride
    search = StrideSearch(stride, "tracking")
    solution = tracked(stride)
    search.stride = dataclasses.replace(stride, consistent=solution)
    other = min(stride.reach_mm, key=lambda mm: -abs(mm - stride.own_m / MM))
    found = search.free(search.at(other, solution.last, "fixed").last, "free")
    assert found.success and abs(found.p[0] / MM - stride.own_m / MM) < 1.5


def ended(mm, cost, success=True):
    """The end of a search: position and cost, no stride."""
    return SimpleNamespace(
        last=Start(z=np.zeros(0), p=np.array([mm * MM])), last_cost=cost, success=success
    )


def test_the_interval_holds_what_is_as_good_and_the_end_of_every_search_that_converged():
    result = StrideSolution(tuning=None, tracked=ended(108.0, 1.0), search=None)
    result.sweep = [
        Fixed(mm, ended(mm, cost)) for mm, cost in ((66.0, 1.2), (108.0, 1.005), (151.0, 1.3))
    ]
    assert as_good(result) is None, "no search with the fulcrum free converged"
    result.free = [(66.0, ended(100.0, 1.0)), (151.0, ended(140.0, 1.2, success=False))]
    # 1 % above 1.0 is reached on the parabola from the optimum to 1.2 and on the line from 1.005 to
    # 1.3.
    assert as_good(result) == pytest.approx(
        (100.0 - 34.0 * np.sqrt(0.01 / 0.2), 108.0 + 43.0 * 0.005 / 0.295)
    )
    result.drawn, result.held = [(ended(120.0, 1.0), None)], [Held(0.1, (), ended(90.0, 0.5))]
    assert as_good(result) == pytest.approx((90.0, 120.0))


def test_the_interval_reaches_to_where_the_cost_is_known_to_be_more():
    """From the optimum, where no fixed position is as good: of a parabola with its least there 1 %
    is reached after the square root of a tenth of the way to 10 % more. Over a position without a
    stride to the next one that has one, at the end of the range to that position itself."""
    result = StrideSolution(tuning=None, tracked=ended(108.0, 1.0), search=None)
    result.free = [(110.0, ended(110.0, 1.0))]
    result.sweep = [Fixed(mm, ended(mm, 1.1)) for mm in (60.0, 100.0, 120.0, 150.0)]
    root = 10.0 * np.sqrt(0.1)
    assert as_good(result) == pytest.approx((110.0 - root, 110.0 + root))
    result.sweep[2].solution = None
    assert as_good(result) == pytest.approx((110.0 - root, 150.0))
    result.sweep[3].solution = None
    assert as_good(result) == pytest.approx((110.0 - root, 150.0))


def test_no_interval_is_finer_than_what_a_finer_grid_moves():
    """The cost moves by 2.7 % on twice as many intervals: what is within 2.7 % of it is not told
    from the least, and where the finer stride ended is in the interval too. One that did not
    converge leaves that unknown."""
    result = StrideSolution(tuning=None, tracked=ended(108.0, 1.0), search=None)
    result.free = [(110.0, ended(110.0, 1.0))]
    result.sweep = [Fixed(mm, ended(mm, 1.1)) for mm in (60.0, 100.0, 120.0, 150.0)]
    assert result.grid_share is None and as_little(result) == 0.01
    result.carried_out = ended(111.0, 0.973)
    root = 10.0 * np.sqrt(0.27)
    assert result.grid_share == pytest.approx(0.027)
    assert as_good(result) == pytest.approx((110.0 - root, 110.0 + root))
    result.carried_out = ended(116.0, 1.004)
    assert as_good(result) == pytest.approx((110.0 - 10.0 * np.sqrt(0.1), 116.0)), (
        "1 % is more than 0.4 %"
    )
    result.carried_out = result.best
    assert result.grid_share is None, "it is the coarse one that was carried out"


@dataclasses.dataclass(frozen=True)
class OnlyGrid:
    """A stride that is nothing but its grid."""

    grid: str


def test_outcomes_of_the_recorded_setting_are_of_the_best_stride_there(monkeypatch):
    """Not of the recorded motion: their difference would be that of the motion. What changes by no
    more than on a finer grid, or than a laboratory sees, is not said to change."""
    monkeypatch.setattr(
        saved, "outcomes", lambda solution, stride: dict.fromkeys(FREE_OUTCOMES, solution.last_cost)
    )
    stride, fine = OnlyGrid("coarse"), OnlyGrid("fine")
    result = StrideSolution(
        tuning=SimpleNamespace(stride=SimpleNamespace(own_m=0.108)),
        tracked=ended(108.0, 4.89),
        search=SimpleNamespace(stride=stride),
    )
    monkeypatch.setattr(StrideSolution, "consistent", stride)
    result.sweep = [
        Fixed(66.0, ended(66.0, 3.2)),
        Fixed(108.0, ended(108.0, 2.83)),
        Fixed(151.0, ended(151.0, 3.0)),
    ]
    result.free = [(108.0, ended(110.0, 2.82))]
    result.carried_out = ended(110.0, 2.9)
    result.carried_out.problem = SimpleNamespace(grid=fine.grid)
    result.drawn = [(ended(110.0, cost), stride) for cost in (2.80, 2.84)]
    rows = {row.name: row for row in saved._outcomes(result)}
    assert (rows["metabolic"].recorded, rows["metabolic"].tracked) == (2.83, 4.89)
    assert rows["metabolic"].uncertainty == pytest.approx(
        np.hypot(np.std([2.80, 2.84], ddof=1), 0.08)
    )
    assert rows["metabolic"].matters is True, "0.37 is more than twice that"
    result.sweep[0].solution.last_cost, result.sweep[2].solution.last_cost = 2.95, 2.9
    assert {row.matters for row in saved._outcomes(result)} == {False}, (
        "0.12 is less than twice the uncertainty"
    )
    result.drawn = []
    result.sweep[0].solution.last_cost, result.sweep[2].solution.last_cost = 2.85, 2.86
    assert {row.matters for row in saved._outcomes(result)} == {False}, (
        "0.03 is less than the grid's 0.08"
    )
    result.sweep[1] = Fixed(108.0)
    assert saved._outcomes(result)[0].recorded is None, "no stride was found there"


@pytest.mark.parametrize(
    ("at", "unit", "least"),
    [
        ((1.0, 1.001), "BW", 0.01001),
        ((0.001, 0.0), "BW", 0.01),
        ((0.5,), "deg", 1.0),
        ((4.0, -5.0), "J", 0.05),
    ],
)
def test_less_than_a_laboratory_sees_is_no_change(at, unit, least):
    """1 % of it; of a plate's force 1 % of body weight, of an angle 1 degree, however small the
    outcome."""
    assert least_seen(at, unit) == pytest.approx(least)


def test_published_signs_of_the_foot_itself_turn_with_the_order_of_stiffness():
    """Seven, of which those of dorsiflexion, push-off and energy are negative (Nichols 2023); what
    changes by less than 1 % has none, nor has what is not known. A middle beyond both ends does not
    turn what they say, but it is known."""
    falls = {"dorsiflexion", "push_off_power", "stored_energy", "returned_energy"}
    rows = [
        {name: 10.0 + (-step if name in falls else step) for name in MEASURES.values()}
        for step in (0.0, 1.0, 2.0)
    ]
    assert len(MEASURES) == 7 and all(published_signs(rows).values())
    assert set(published_signs(rows[::-1]).values()) == {False}
    assert set(published_signs([rows[0], rows[0], rows[0]]).values()) == {None}
    assert all(steady_signs(rows).values())
    bent = [rows[0], {name: value + 5.0 for name, value in rows[1].items()}, rows[2]]
    assert published_signs(bent) == published_signs(rows) and not any(steady_signs(bent).values())
    assert published_signs(rows, every_step=True) == published_signs(rows)
    assert set(published_signs(bent, every_step=True).values()) == {None}
    unknown = [rows[0], dict.fromkeys(rows[0], float("nan"))]
    assert set(published_signs(unknown).values()) == {None}


SETTINGS_MM = 66.0, 108.5, 151.0


@pytest.mark.parametrize(
    ("extension", "beyond"), [((1.0, 2.0, 3.0), 1), ((1.0, 0.5, 3.0), 0), ((3.0, 2.0, 1.0), 0)]
)
def test_a_tuning_counts_the_signs_that_the_foot_alone_lacks(monkeypatch, extension, beyond):
    """Under an equal load nobody extends a knee; all others are the load's, whatever strides do.
    Seven at the ends, of which one goes back in between, are no more than the load has."""
    module = importlib.import_module("vsf_drake.optimal_control.solve")
    falls = {"dorsiflexion", "push_off_power", "stored_energy", "returned_energy"}
    rows = [
        {name: 10.0 + (-step if name in falls else step) for name in MEASURES.values()}
        for step in (0.0, 1.0, 2.0)
    ]
    load = [
        SimpleNamespace(
            outcomes=dict(row, knee_extension=float("nan")),
            row=SimpleNamespace(follows=mm < 151.0, residual_n=9.2, fulcrum_mm=mm),
        )
        for row, mm in zip(rows, SETTINGS_MM, strict=True)
    ]
    walked = [dict(row, knee_extension=value) for row, value in zip(rows, extension, strict=True)]
    monkeypatch.setattr(module, "at_equal_load", lambda subject, model, settings_m: load)
    monkeypatch.setattr(module, "outcomes", lambda solution, stride: walked[solution.setting])
    options = SimpleNamespace(hold_factors=())
    result = StrideSolution(
        tuning=SimpleNamespace(
            cost="activation", options=options, trial=SimpleNamespace(subject=None, model=None)
        ),
        tracked=None,
        search=SimpleNamespace(stride=SimpleNamespace(own=(), hold_weight=2.0)),
    )
    result.sweep = [Fixed(mm, SimpleNamespace(setting=i)) for i, mm in enumerate(SETTINGS_MM)]
    module._hold(result, None)
    (check,) = result.checks
    assert (check.value, check.unit, check.met) == (beyond, "of 1", beyond == 1)
    assert (
        "the foot alone has 6 under an equal load at every step, with nobody on it (the force "
        "misses the equal load by up to 9 N (fulcrum at 151 mm), more than the 1 % that a "
        "roll-over is allowed)"
    ) in check.sentence
    assert f"(knee extension) {beyond} hold at every step" in check.sentence
    assert f"{7 - (extension[0] > extension[-1])} of 7 hold at weight 2" in check.sentence


def test_a_tuning_that_was_interrupted_keeps_its_stride_and_cannot_be_read_as_an_optimum(trial):
    tuning = StrideTuning(
        [trial], cost="metabolic", options=StrideOptions(confirm=(), intervals=20)
    )

    def stop(what, share):
        if "iteration 2" in what:
            raise KeyboardInterrupt

    solution = solve(tuning, progress=stop)
    table = stride_table(solution)
    assert not table.optimal and "interrupted" in table.status
    assert np.isfinite(stride_arrays(solution)["q"]).all()
    with pytest.raises(FitError, match="interrupted"):
        _ = solution.fulcrum_mm


def test_no_trials_two_of_one_setting_an_unknown_cost_and_a_range_out_of_reach_are_refused(trial):
    for trials, cost, options, message in (
        ([], "metabolic", None, "there are none"),
        ([trial, trial], "metabolic", None, "all walks are of one setting"),
        ([trial], "comfort", None, "no 'comfort'"),
        ([trial], "metabolic", StrideOptions(bounds_mm=(10.0, 300.0)), "reach"),
        ([trial], "metabolic", StrideOptions(speed_m_per_s=9.0), "able-bodied walking"),
        ([trial], "tracking", StrideOptions(speed_m_per_s=1.3), "to be tracked"),
        (
            [trial],
            "weighted",
            StrideOptions(speed_m_per_s=1.3, weights={"tracking": 0.1, "metabolic": 1.0}),
            "to be tracked",
        ),
    ):
        with pytest.raises(InputError, match=message):
            StrideTuning(trials, cost=cost, options=options)


def test_a_recording_slower_than_what_was_published_can_be_tracked_or_solved_for_faster(
    trial, stride, monkeypatch
):
    """The recorded speed is 1.0 m/s; as if nothing were known of able-bodied walking below
    1.5 m/s."""
    monkeypatch.setattr(normal, "REACH", (0.5, 0.56))
    tuning = StrideTuning([trial], cost="tracking")
    tuning.stride.problem(tuning.stride.minimised("tracking", {}), tuning.stride.reach_mm)
    assert (
        StrideTuning(
            [trial], cost="activation", options=StrideOptions(speed_m_per_s=1.6)
        ).speed_m_per_s
        == 1.6
    )
    with pytest.raises(InputError, match="able-bodied walking") as refused:
        StrideTuning([trial], cost="activation")
    assert refused.value.where == "the recorded speed"


def test_the_recorded_speed_as_it_is_printed_is_the_recorded_speed(trial, stride):
    options = StrideOptions(speed_m_per_s=round(stride.speed, 2))
    assert StrideTuning([trial], cost="activation", options=options).speed_m_per_s is None


def test_activation_has_a_weight_where_the_motion_adapts_and_none_where_it_does_not(stride):
    weights = {"activation": 1.0, "joint_load": 3.0}
    mixed = dataclasses.replace(stride, options=StrideOptions(weights=weights))
    y = np.random.default_rng(11).standard_normal(
        (stride.grid.instants, len(stride.function.names))
    )
    terms = mixed.minimised("weighted", dict.fromkeys(FREE_COSTS, 2.0))
    by_name = {
        name: sum(
            float(stride.grid.weights @ part.values(y)) for part in terms if part.name == name
        )
        for name in weights
    }
    assert by_name == pytest.approx(
        {
            "activation": 0.25 * stride.value("activation", y) / TYPICAL_ACTIVATION,
            "joint_load": 0.75 * stride.value("joint_load", y) / 2.0,
        }
    )
    with pytest.raises(InputError, match="activation"):
        TuningOptions(weights=weights)


@pytest.mark.slow
def test_a_stride_at_another_speed_is_solved_for_there_and_the_recorded_one_stays_what_it_was(
    trial, stride
):
    """Speed is length over time. A larger weight of able-bodied walking brings the stride nearer to
    it."""
    options = StrideOptions(
        intervals=12,
        positions=2,
        starts=1,
        confirm=(),
        draws=2,
        hold_factors=(4.0,),
        speed_m_per_s=1.3,
    )
    result = solve(StrideTuning([trial], cost="activation", options=options))
    table, (held,), best = stride_table(result), result.held, result.best
    rows = {row.name: row for row in table.outcomes}
    for setting in ("softest", "optimum", "stiffest", "recorded"):
        length, time = (getattr(rows[name], setting) for name in ("stride_length", "stride_time"))
        assert length / time == pytest.approx(1.3)
    assert rows["stride_time"].tracked == pytest.approx(stride.recorded.period_s)
    assert rows["stride_length"].tracked == pytest.approx(stride.recorded.advance_m)
    assert rows["motion_change"].optimum is None and rows["motion_change"].tracked == pytest.approx(
        0.0, abs=1e-9
    )
    assert rows["cost"].recorded == result.at_recorded.last_cost == table.cost_at(stride.own_m / MM)
    assert "1.30 m/s" in table.notes[0] and f"{stride.speed:.2f} m/s" in table.notes[0]
    assert rows["motion_change"].matters is None, "of nothing recorded"
    assert all(drawn.success and other.speed == pytest.approx(1.3) for drawn, other in result.drawn)
    costs = [drawn.last_cost for drawn, _ in result.drawn]
    finer = result.carried_out.last_cost - best.last_cost
    assert table.cost_outcome.uncertainty == pytest.approx(np.hypot(np.std(costs, ddof=1), finer))
    (term,) = (term for term in table.terms if term.name == "activation")
    assert term.value == pytest.approx(rows["activation"].optimum / TYPICAL_ACTIVATION)
    assert term.label == "squared activations of the muscles / 0.5" != rows["activation"].label
    arrays = stride_arrays(result)
    # the full model carries out a stride on twice as many intervals
    for foot in ("prosthetic", "intact"):
        off = arrays[f"grf_{foot}_resimulated_prescribed"] - arrays[f"grf_{foot}"]
        assert np.sqrt(np.nanmean(off**2)) < 0.05 * stride.model.weight
    off = [
        result.search.stride.value("normal", solution.last_y()) for solution in (best, held.free)
    ]
    assert held.weight == 4.0 * options.normal_weight and off[1] < off[0]


def fake_search(reach_mm, own_m, positions, asked, converges=lambda mm: True, cost="activation"):
    """Of which each search ends with its position, and those of an easier problem with "easy"
    before it."""

    def at(mm, start, what, fraction=0.0, easier=""):
        asked.append((f"{easier}{mm:g}", start))
        return SimpleNamespace(
            success=converges(mm), status="optimal", last_cost=1.0, last=f"{easier}{mm:g}"
        )

    def changed(**changes):
        return SimpleNamespace(
            at=lambda mm, start, what: at(
                mm, start, what, easier="easy " if "bend_rad" in changes else "stage "
            )
        )

    options = SimpleNamespace(stages=("soft", "last"))
    positions_mm = np.linspace(*reach_mm, positions).tolist()
    stride = SimpleNamespace(positions_mm=positions_mm, own_m=own_m, options=options, own=())
    return SimpleNamespace(at=at, changed=changed, cost=cost, stride=stride)


@pytest.mark.parametrize("chains", [False, True])
def test_a_sweep_comes_to_every_position_from_easier_problems_outward_and_from_all_sides(chains):
    """Recorded at 71 mm; each search begins where that of the neighbour ended."""
    asked, rows = [], []
    swept(fake_search((60.0, 80.0), 0.071, 3, asked), "tracked", rows, chains=chains)
    easier = [
        ("easy 60", "tracked"),
        ("stage 60", "easy 60"),
        ("60", "stage 60"),
        ("easy 70", "easy 60"),
        ("stage 70", "easy 70"),
        ("70", "stage 70"),
        ("easy 80", "easy 70"),
        ("stage 80", "easy 80"),
        ("80", "stage 80"),
    ]
    sides = [("70", "60"), ("80", "70"), ("70", "80"), ("60", "70")]
    assert asked == [
        *easier,
        ("70", "tracked"),
        ("80", "70"),
        ("60", "70"),
        *(sides if chains else []),
    ]
    assert all(row.solution.last == f"{row.fulcrum_mm:g}" for row in rows)


def test_a_recording_is_tracked_from_itself_and_a_sweep_goes_on_over_a_position_without_a_stride():
    asked, rows = [], []
    search = fake_search(
        (60.0, 80.0), 0.08, 3, asked, converges=lambda mm: mm != 70.0, cost="tracking"
    )
    swept(search, "tracked", rows, chains=False)
    assert asked == [("80", "tracked"), ("70", "80"), ("60", "80")]
    assert rows[1].solution is None and np.isnan(rows[1].tried["outward"])


@pytest.mark.parametrize(
    ("costs", "least", "begun"), [((0.5,), 0.5, 1), ((30.0, 0.8), 0.8, 2), ((30.0, 40.0), 30.0, 2)]
)
def test_a_stride_that_is_tracked_to_another_one_is_begun_again_on_a_softer_ground(
    monkeypatch, costs, least, begun
):
    asked = []

    def ended(stride, stages, progress, warm=None):
        asked.append(tuple(stages))
        return SimpleNamespace(success=True, status="optimal", last_cost=costs[len(asked) - 1])

    monkeypatch.setattr("vsf_drake.optimal_control.search._tracked", ended)
    stages = StrideOptions().stages
    found = tracked(SimpleNamespace(options=SimpleNamespace(stages=stages)))
    assert found.last_cost == least
    assert asked == [stages, (*FAR, stages[-1])][:begun]
    assert FAR[0].depth_m > FAR[1].depth_m > stages[-1].depth_m


def test_the_recorded_position_joins_the_sweep_from_both_its_neighbours():
    """Where it is none of its positions; 71 mm lies between 70 and 80."""
    asked, rows = [], [Fixed(mm, SimpleNamespace(last=f"{mm:g}")) for mm in (60.0, 70.0, 80.0)]
    search = fake_search((60.0, 80.0), 0.071, 3, asked)
    with_recorded(search, rows)
    assert asked == [("71", "70"), ("71", "80")] and [row.fulcrum_mm for row in rows] == [
        60.0,
        70.0,
        71.0,
        80.0,
    ]
    assert rows[2].solution.last == "71"
    with_recorded(search, rows)
    search.stride.own_m = 0.09
    with_recorded(search, rows)
    assert len(asked) == 2 and len(rows) == 4, "it has one already; out of the range there is none"


def test_a_more_bent_knee_is_asked_of_the_prosthetic_side_alone(stride):
    """By 10 degrees: of a stride that is able-bodied but for that, nothing deviates."""
    y = np.zeros((stride.grid.instants, len(stride.function.names)))
    y[:, stride.function.starting_with("q_")] = stride.able_bodied.q
    for foot, force in stride.able_bodied.force.items():
        y[:, stride.function.index(f"{foot}_fx", f"{foot}_fz")] = force
    y[:, stride.function.index("q_knee_angle_r")] += np.radians(10.0)
    bent = dataclasses.replace(stride, bend_rad=np.radians(10.0))
    assert stride.model.subject.prosthetic_side == "right"
    assert stride.value("normal", y) > 0.01 and bent.value("normal", y) == pytest.approx(
        0.0, abs=1e-12
    )


def test_activation_counts_alike_for_all_and_other_costs_by_what_they_are_in_the_tracked_stride(
    stride,
):
    y = np.random.default_rng(7).standard_normal((stride.grid.instants, len(stride.function.names)))
    for cost, size in (("activation", TYPICAL_ACTIVATION), ("joint_load", 3.0)):
        sizes = dict.fromkeys(FREE_COSTS, 3.0)
        own = sum(
            float(stride.grid.weights @ part.values(y))
            for part in stride.minimised(cost, sizes)
            if part.name == cost
        )
        assert own == pytest.approx(stride.value(cost, y) / size)
