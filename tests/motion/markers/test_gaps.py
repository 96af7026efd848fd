"""Gaps: filled where others know the place or where they are short, trimmed at the ends, refused by name elsewhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_calibration import true_calibration
from made_person import markers, recording_of, walking_angles

from vsf_drake.errors import InputError
from vsf_drake.motion.markers.tracking import fill_gaps

TIME = np.arange(300) / 100.0
TRUTH = markers(walking_angles(TIME), label_set="rajagopal", medial=False)
PLUG_IN_GAIT = markers(walking_angles(TIME), label_set="plug_in_gait", medial=False)


def walk(gaps, truth=TRUTH, **changes):
    """The recording with `gaps`, (label, first frame, frame after) each."""
    seen = {label: path.copy() for label, path in truth.items()}
    for label, start, stop in gaps:
        seen[label][start:stop] = np.nan
    return recording_of(seen | changes)


def fill(recording, label_set="rajagopal", **options):
    return fill_gaps(recording, true_calibration(label_set=label_set).segments, **options)


@pytest.mark.parametrize(("start", "stop"), [(100, 105), (100, 110), (100, 180), (0, 60), (250, 300)])
def test_a_rigid_cluster_knows_where_its_lost_marker_is(start, stop):
    """RTH1 is one of four on the thigh: exactly restored, however long the gap, and at either end."""
    filled = fill(walk([("RTH1", start, stop)]))
    np.testing.assert_allclose(filled.markers["RTH1"], TRUTH["RTH1"], atol=1e-12)
    assert np.flatnonzero(~filled.seen["RTH1"]).tolist() == list(range(start, stop))
    (gap,) = filled.gaps
    assert (gap.label, gap.how) == ("RTH1", "rigid cluster")
    assert (gap.start_s, gap.end_s) == pytest.approx((start / 100, (stop - 1) / 100))
    assert len(filled.notes) == (stop - start > 10)
    assert stop - start <= 10 or "RTH1 was not seen" in filled.notes[0]


def test_a_marker_off_its_cluster_enters_and_leaves_the_gap_without_a_step():
    """Skin moves RTH1 by 20 mm over the gap; the fill passes from the one offset to the other."""
    sliding = TRUTH["RTH1"] + np.clip((np.arange(300) - 90) / 100, 0, 1)[:, None] * [0.0, 0.0, 0.02]
    filled = fill(walk([("RTH1", 100, 180)], truth=TRUTH | {"RTH1": sliding}))
    step = np.abs(np.diff(filled.markers["RTH1"] - sliding, axis=0))
    assert step.max() < 3e-4
    assert np.abs(filled.markers["RTH1"] - sliding).max() < 3e-3


@pytest.mark.parametrize("length", [1, 5, 10])
def test_short_gaps_without_a_cluster_are_splined(length):
    """Plug-in Gait has two markers on a foot. A cubic spline errs by at most 5/384 h^4 max|d4x/dt4| (Hall & Meyer)."""
    filled = fill(walk([("RTOE", 100, 100 + length)], PLUG_IN_GAIT), "plug_in_gait")
    fourth = np.abs(np.diff(PLUG_IN_GAIT["RTOE"], 4, axis=0)[90:120]).max(axis=0) * 100.0**4
    error = np.abs(filled.markers["RTOE"] - PLUG_IN_GAIT["RTOE"]).max(axis=0)
    assert (error < 5 / 384 * ((length + 1) / 100) ** 4 * fourth + 1e-9).all()
    assert error.max() < 2e-3
    (gap,) = filled.gaps
    assert gap.how == "spline" and gap.end_s - gap.start_s == pytest.approx((length - 1) / 100)


def test_longer_gaps_are_refused_by_name_and_interval():
    with pytest.raises(InputError, match=r"made\.c3d: marker RTOE is missing from 1\.000 to 1\.100 s") as error:
        fill(walk([("RTOE", 100, 111)], PLUG_IN_GAIT), "plug_in_gait")
    assert "0.1 s" in str(error.value)
    assert fill(walk([("RTOE", 100, 111)], PLUG_IN_GAIT), "plug_in_gait", longest_gap_s=0.11).gaps
    with pytest.raises(InputError, match=r"marker RTOE is missing from 1\.000 to 1\.000 s"):
        fill(walk([("RTOE", 100, 101)], PLUG_IN_GAIT), "plug_in_gait", longest_gap_s=0.0)


@pytest.mark.parametrize(("start", "stop"), [(100, 108), (100, 160), (0, 60)])
def test_two_others_and_the_joint_centre_know_where_a_lost_marker_is(start, stop):
    """Two of four on the thigh; two of three on the foot (LMT2, LMT5), where a spline over the swing errs by 20 mm."""
    filled = fill(walk([("RTH1", start, stop), ("RTH2", start, stop), ("LCAL", start, stop)]))
    assert {gap.how for gap in filled.gaps} == {"rigid cluster and joint centre"}
    for label in ("RTH1", "RTH2", "LCAL"):
        np.testing.assert_allclose(filled.markers[label], TRUTH[label], atol=1e-9)


def test_ends_without_markers_are_trimmed():
    """A person walks into the volume and out of it: everything appears and disappears bit by bit."""
    gaps = [(label, 0, 20 + k) for k, label in enumerate(TRUTH)] + [(label, 250 + k, 300) for k, label in enumerate(
        TRUTH)]
    filled = fill(walk(gaps))
    assert 20 < filled.start_frame <= 20 + len(TRUTH)
    assert all(np.isfinite(path).all() for path in filled.markers.values())
    assert 250 <= filled.start_frame + len(filled.markers["RTH1"]) < 250 + len(TRUTH)
    assert any("is used" in note for note in filled.notes)
    for gap in filled.gaps:
        assert gap.start_s >= filled.start_frame / 100


def test_segments_without_enough_markers_are_refused_by_name():
    with pytest.raises(InputError, match=r"RASI, LASI never appear.*the pelvis \(left: RPSI, LPSI\)"):
        fill(walk([("RASI", 0, 300), ("LASI", 0, 300)]))
    with pytest.raises(InputError, match=r"RTOE never appears.*the foot right \(left: RHEE\)"):
        fill(walk([("RTOE", 0, 300)], PLUG_IN_GAIT), "plug_in_gait")
    with pytest.raises(InputError, match="no markers"):
        fill(recording_of({}))


def test_markers_that_never_appear_together_are_named():
    with pytest.raises(InputError, match=r"no frame shows every needed marker: RHEE in 50% of the frames, RTOE in 50% "
                       "of the frames$"):
        fill(walk([("RTOE", 0, 150), ("RHEE", 150, 300)], PLUG_IN_GAIT), "plug_in_gait")
    with pytest.raises(InputError, match=r"only 4 frames show every needed marker; RTOE"):
        fill(walk([("RTOE", 0, 296)], PLUG_IN_GAIT), "plug_in_gait")


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(sorted(TRUTH)), st.integers(0, 299), st.integers(1, 60)), max_size=12))
def test_any_gaps_are_filled_well_or_refused(gaps):
    """Exactly by clusters; a spline across a quick swing, a tenth of a second long, may be centimetres off."""
    try:
        filled = fill(walk([(label, start, start + length) for label, start, length in gaps]))
    except InputError:
        return
    start, count = filled.start_frame, len(filled.markers["RTH1"])
    exact = all(gap.how != "spline" for gap in filled.gaps)
    for label, path in filled.markers.items():
        truth, seen = TRUTH[label][start:start + count], filled.seen[label]
        np.testing.assert_array_equal(path[seen], truth[seen])
        np.testing.assert_allclose(path, truth, atol=1e-9 if exact else 0.06)
