"""A person's own strides as a function of the setting: against the walks that they are made of, and
what a stride that is held to them pays."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.model.contact_file import load_contact
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.optimal_control.own import Hold, OwnStrides
from vsf_drake.optimal_control.reference import FEET
from vsf_drake.optimal_control.saved import _worth, stride_table
from vsf_drake.optimal_control.search import StrideSolution, StrideTuning
from vsf_drake.optimal_control.solve import _tell_likeness, solve
from vsf_drake.optimal_control.stride import MM, StrideFunction, StrideOptions
from vsf_drake.report.tuning.chapters import answer
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

TX, KNEE = 1, 4
LATE = 0.5


@pytest.fixture(scope="module")
def trials():
    """At 66, 108 and 151 mm."""
    paths = {path.stem: path for path in embedded_trials(tier="exact")}
    contact = load_contact(embedded_contact("exact"))
    return [
        trial_with(load_trial(paths[name]), contact) for name in ("low_1", "medium_1", "high_1")
    ]


@pytest.fixture(scope="module")
def tuning(trials):
    return StrideTuning(trials, cost="activation", options=StrideOptions(intervals=12))


@pytest.fixture(scope="module")
def own(tuning):
    return tuning.recorded


def reference(own, tuning, fulcrum_m):
    return own.reference(fulcrum_m, tuning.stride.grid, tuning.stride.advance_m, LATE)


def test_at_a_recorded_setting_the_stride_is_that_walk_and_halfway_the_mean_of_two(tuning, own):
    phase = tuning.stride.grid.times_s / tuning.stride.grid.duration_s
    told = [reference(own, tuning, mm * MM) for mm in (66.0, 87.0, 108.0)]
    for one, stride in zip((told[0], told[2]), own.strides[:2], strict=True):
        q, v, a = stride.sample(phase * stride.period_s)
        assert np.delete(one.q, TX, axis=1) == pytest.approx(np.delete(q, TX, axis=1))
        assert np.delete(one.v, TX, axis=1) == pytest.approx(np.delete(v, TX, axis=1))
        assert one.a == pytest.approx(a)
        for foot in FEET:
            force, _ = stride.measured(foot, phase * stride.period_s)
            known = np.isfinite(force[:, :2]).all(axis=1)
            assert np.array_equal(one.known[foot], known)
            assert one.force[foot][known] == pytest.approx(force[known, :2])
    assert told[1].q == pytest.approx(0.5 * (told[0].q + told[2].q))
    assert own.period_s(0.087) == pytest.approx(
        0.5 * (own.strides[0].period_s + own.strides[1].period_s)
    )


def test_every_setting_is_walked_at_one_speed(tuning, own):
    """The pelvis gets on by it whatever the setting and its walk's own speed; the walks themselves
    differ."""
    speeds = [stride.advance_m / stride.period_s for stride in own.strides]
    assert max(speeds) - min(speeds) > 0.01
    for mm in (66.0, 100.0, 151.0):
        rates = reference(own, tuning, mm * MM).v[:, TX]
        assert rates.mean() == pytest.approx(np.mean(speeds), abs=1e-4)


def test_the_centre_of_pressure_stays_under_the_leg(tuning, own):
    """As far from the pelvis as in the walk, at every instant with load."""
    stride = own.strides[2]
    phase = tuning.stride.grid.times_s / tuning.stride.grid.duration_s
    one = reference(own, tuning, 0.151)
    _, cop = stride.measured("prosthetic", phase * stride.period_s)
    pelvis = stride.sample(phase * stride.period_s)[0][:, TX]
    loaded = np.isfinite(cop) & (one.force["prosthetic"][:, 1] > 50.0)
    assert loaded.sum() > 8
    assert (one.cop_x["prosthetic"] - one.q[:, TX])[loaded] == pytest.approx(
        (cop - pelvis)[loaded], abs=1e-9
    )
    assert one.moment["prosthetic"] == pytest.approx(0.0, abs=50.0 * 0.3)


def test_positions_of_a_sweep_hold_the_recorded_settings(own):
    assert own.positions_mm((66.0, 151.0), 9) == pytest.approx(
        [66.0, 76.5, 87.0, 97.5, 108.0, 118.75, 129.5, 140.25, 151.0]
    )
    assert own.positions_mm((90.0, 151.0), 4) == pytest.approx([90.0, 108.0, 129.5, 151.0])


class Shifted:
    """A stride whose knee is more bent, and whose force up is larger, throughout."""

    def __init__(self, stride, angle_rad, force_n):
        self.stride, self.angle_rad, self.force_n = stride, angle_rad, force_n

    def __getattr__(self, name):
        return getattr(self.stride, name)

    def sample(self, times):
        q, v, a = self.stride.sample(times)
        return q + self.angle_rad * np.eye(8)[KNEE], v, a

    def measured(self, foot, times):
        force, cop = self.stride.measured(foot, times)
        return force + self.force_n * np.eye(3)[1], cop


@pytest.mark.parametrize(("degrees", "share"), [(3.0, 0.04), (0.5, 0.004)])
def test_walks_that_differ_by_a_constant_have_its_spread_but_never_less_than_is_seen(
    own, degrees, share
):
    """Two walks 2 d apart: the standard deviation is d sqrt 2, in one setting of three pooled over
    as many as were walked twice; at least one degree and one percent of body weight."""
    off = np.radians(degrees), share * own.weight_n
    pair = [Shifted(own.strides[0], sign * off[0], sign * off[1]) for sign in (1.0, -1.0)]
    soft, medium, _ = own.answer.walks
    answer = dataclasses.replace(own.answer, walks=(soft, soft, medium))
    twice = OwnStrides(answer, (*pair, own.strides[1]), own.weight_n)
    angles = twice.sd.angles_rad
    forces = twice.sd.forces_n
    assert np.degrees(angles[KNEE]) == pytest.approx(max(degrees * np.sqrt(2.0), 1.0))
    assert np.isinf(angles[TX]) and np.degrees(angles[0]) == pytest.approx(1.0)
    assert forces["prosthetic"][1] / own.weight_n == pytest.approx(max(share * np.sqrt(2.0), 0.01))
    assert own.spread is None and own.sd.forces_n["intact"] == pytest.approx(0.01 * own.weight_n)
    assert twice.sd.time == own.sd.time == 0.01, "both walks take the same time"
    assert "no setting was walked twice" in own.notes[1]


def test_a_hold_passes_through_its_strides_and_what_is_held_has_its_derivatives(tuning):
    """By central differences, of instants given twice over too."""
    stride = tuning.stride
    start = stride.start(108.0)
    rng = np.random.default_rng(5)
    names = "q_knee_angle_r", "prosthetic_fz", "stride_time"
    targets = rng.standard_normal((3, stride.grid.instants, 3))
    hold = Hold(np.array([0.066, 0.108, 0.151]), names, targets)
    for at_m, target in zip(hold.at_m, targets, strict=True):
        assert hold.at(at_m, len(target))[0] == pytest.approx(target, abs=1e-12)
    function = StrideFunction(
        stride.model, stride.smoothing, stride.reference.cop_x, stride.speed, hold
    )
    z, p = np.concatenate([start.z, start.z]), np.append(0.09, start.p[1:])
    y, by_z, by_p = function.linearise(z, p)
    off = function.starting_with("off_")
    plain = y[:, function.index(*names)]
    assert y[:, off] == pytest.approx(plain - np.tile(hold.at(0.09, len(start.z))[0], (2, 1)))
    assert np.array_equal(function.evaluate(z, p), y)
    assert np.array_equal(by_z[:, off], by_z[:, function.index(*names)])
    for i in (0, 1, 2, -1):  # fulcrum, heel, alignment, time
        step = 1e-6 * np.eye(len(p))[i]
        ahead, behind = (function.evaluate(z, p + s * step)[:, off] for s in (1.0, -1.0))
        assert by_p[:, off, i] == pytest.approx((ahead - behind) / 2e-6, rel=1e-4, abs=1e-2)


@pytest.mark.parametrize(
    ("cost", "options", "message"),
    [
        ("tracking", {}, "own strides of several settings"),
        ("activation", {"speed_m_per_s": 1.4}, "not the speed of the recordings"),
        ("activation", {"bounds_mm": (70.0, 152.0)}, "out of the carriage's reach|out of the rec"),
    ],
)
def test_what_own_strides_cannot_say_is_refused(trials, cost, options, message):
    with pytest.raises(InputError, match=message):
        StrideTuning(trials[::2], cost=cost, options=StrideOptions(**options))


@pytest.mark.parametrize(
    ("more", "turned_deg", "said"),
    [
        (0.02, 0.5, ""),
        (
            0.2,
            0.5,
            "not to be believed: the stride is {:.1f} % BW off the person's own force (limit 6 %).",
        ),
        (
            0.02,
            3.0,
            "not to be believed: the stride is 3.0° off the person's own angles (limit 2°).",
        ),
    ],
)
def test_own_strides_that_are_not_the_person_s_at_one_position_decide_nothing(
    tuning, more, turned_deg, said
):
    """At the stiffest setting all forces are larger by a share, and the knee is more bent."""

    def possible(mm, more, turned_deg):
        stride = dataclasses.replace(tuning.stride, own_m=mm * MM)
        function = stride.function
        y = np.zeros((stride.grid.instants, len(function.names)))
        y[:, function.starting_with("q_")] = stride.reference.q
        y[:, function.index(f"q_{stride.model.coordinates[KNEE]}")] += np.radians(turned_deg)
        for foot, force in stride.reference.force.items():
            y[:, function.index(f"{foot}_fx", f"{foot}_fz")] = (1.0 + more) * force
        last = SimpleNamespace(p=np.array([mm * MM]))
        return SimpleNamespace(y=lambda: y, last=last, last_cost=1.0, success=True), stride

    own = [possible(mm, 0.0, 0.0)[0] for mm in (66.0, 108.0)]
    off, stride = possible(151.0, more, turned_deg)
    search = SimpleNamespace(stride=SimpleNamespace(own=(*own, off), reach_mm=(66.0, 151.0)))
    result = StrideSolution(tuning, tracked=own[1], search=search)
    result.free = [(108.0, own[1])]
    result.carried_out = own[0]  # as good
    _tell_likeness(result)
    worth = _worth(result, (100.0, 110.0))
    sizes = [
        np.sqrt(np.mean(np.sum(force**2, axis=1)[stride.reference.known[foot]]))
        for foot, force in stride.reference.force.items()
    ]
    percent = 100.0 * more * max(sizes) / stride.model.weight
    assert worth["undecided"] == said.format(percent)
    assert worth["believed"] is not bool(said)
    wide = _worth(result, (66.6, 140.4))["undecided"]
    assert "66 to 141 mm, 87 % of the range" in wide, "no narrower than it is, as where it is told"
    assert [check.value for check in result.checks] == pytest.approx([turned_deg, percent])


@pytest.mark.slow
def test_held_to_own_strides_no_recorded_setting_is_favoured_and_a_firmer_hold_is_kept_closer(
    trials,
):
    """Each own stride is a possible motion at its position, so that its hold costs nothing there;
    what adapts costs no more. Twice the hold: nearer to the person."""
    options = StrideOptions(intervals=16, positions=3, starts=1, confirm=(), draws=0)
    result = solve(StrideTuning(trials[::2], cost="activation", options=options))
    table = stride_table(result)
    stride = result.search.stride
    assert table.optimal and table.own and table.recorded_mm == pytest.approx((66.0, 151.0))
    assert [point.fulcrum_mm for point in table.sweep] == pytest.approx([66.0, 108.5, 151.0])
    for one, point in zip(stride.own, table.sweep, strict=True):
        y = stride.function.evaluate(one.last.z, one.last.p)
        assert stride.value("own", y) == pytest.approx(0.0, abs=1e-12)
        assert point.cost < point.walked
    assert table.sweep[0].outcomes["stride_time"] != table.sweep[2].outcomes["stride_time"]
    off = {
        held.weight: stride.value("own", stride.function.evaluate(held.over[0].z, held.over[0].p))
        for held in result.held
    }
    assert off[2.0 * options.own_weight] < off[0.5 * options.own_weight]
    sentences = answer(table)
    assert any("Walked as recorded, before anything adapts" in sentence for sentence in sentences)
    assert not any("able-bodied" in sentence for sentence in sentences)
    held = next(check for check in table.checks if check.name == "hold")
    moves = [abs(row.fulcrum_mm - table.fulcrum_mm) for row in table.robustness]
    assert held.value == pytest.approx(max(moves))
    assert bool(table.undecided) or held.met
    assert table.believed == all(
        check.met for check in table.checks if check.name.startswith("tracking_")
    )
    assert dataclasses.replace(table, own=False).held_to == "able-bodied walking"
