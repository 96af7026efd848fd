"""Which recordings make one fit, and which do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit import ContactFit, assess
from vsf_drake.analysis.contact_fit.problem import check_recordings, labels_of
from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import PlateRecording

SERIES = ("vertical", "cop_fore_aft")


def refused(trials, match, held_out=(), series=SERIES):
    with pytest.raises(InputError, match=match) as caught:
        check_recordings(trials, held_out, series=series)
    return caught.value


def with_plate(trial, **fields):
    return replace(trial, plates=trial.plates | {"right": replace(trial.prosthetic_plate, **fields)})


def unloaded(trial, rows):
    """The trial with a plate that saw nothing at `rows`."""
    plate = trial.prosthetic_plate
    return with_plate(trial, force_W=np.where(rows[:, None], 0.0, plate.force_W),
                      cop_W=np.where(rows[:, None], np.nan, plate.cop_W))


def test_recordings_of_one_person_and_model_go_together(soft, stiff):
    check_recordings([soft, stiff], series=SERIES)
    check_recordings([soft], [stiff], series=SERIES)


def test_nothing_to_fit_is_refused(stiff):
    refused([], "no trial to fit")
    refused([], "no trial to fit", [stiff])


def test_a_held_out_trial_that_is_fitted_is_refused_whatever_its_name(soft, stiff):
    """A copy under another name, path and fulcrum is the same recording."""
    copy = replace(soft, path=Path("elsewhere/copy.yaml"), name="copy", fulcrum_m=0.1, notes=("copied",))
    error = refused([soft, stiff], "fitted and held out", [copy])
    assert error.file == copy.path and str(soft.path) in str(error)


def test_the_same_recording_twice_is_refused(soft, stiff):
    copy = replace(soft, path=Path("copy.yaml"))
    refused([soft, stiff, copy], "is the same recording as .*low_1.yaml. Give it once")
    refused([soft], "Give it once", [stiff, replace(stiff, path=Path("copy.yaml"))])


def test_one_trial_object_given_twice_is_refused_too(soft, stiff):
    refused([soft, stiff, soft], "Give it once")
    refused([soft], "fitted and held out", [stiff, soft])


@pytest.mark.parametrize("out", [False, True])
def test_another_person_is_refused_by_what_differs(soft, stiff, out):
    heavier = replace(stiff, subject=replace(stiff.subject, mass_kg=91.0))
    trials, held = ([soft], [heavier]) if out else ([soft, heavier], [])
    error = refused(trials, f"another subject than .*mass_kg 91.0 and {soft.subject.mass_kg}", held)
    assert error.where == "subject" and error.file == stiff.path


def test_another_side_is_refused(soft, stiff):
    left = replace(stiff, subject=replace(stiff.subject, prosthetic_side="left"))
    refused([soft, left], "prosthesis is on the left, that of .*low_1.yaml on the right")
    refused([soft], "on the left", [left])


def test_another_model_is_refused(soft, stiff):
    foot = replace(stiff.model.foot, mass_kg=1.1 * stiff.model.foot.mass_kg)
    other = replace(stiff, model=replace(stiff.model, foot=foot))
    refused([soft, other], "another model than .*low_1.yaml")
    refused([soft], "another model", [other])


@pytest.mark.parametrize("cut", ["start", "end"])
def test_a_window_that_cuts_a_stance_is_refused(soft, stiff, cut):
    middle = {"start_s": 0.6} if cut == "start" else {"end_s": 0.9}
    error = refused([stiff, replace(soft, **middle)], "saw only part of the stance at 0.42 to 1.12 s")
    assert error.where == "window" and error.file == soft.path
    refused([stiff], "saw only part", [replace(soft, **middle)])


def test_a_plate_that_begins_or_ends_under_load_is_refused(soft):
    plate = soft.prosthetic_plate
    for rows in (plate.time_s > 0.8, plate.time_s < 0.8):
        cut = PlateRecording(*(getattr(plate, name)[rows] for name in ("time_s", "force_W", "cop_W", "free_moment_nm")),
                             plate.has_cop)
        refused([replace(soft, plates=soft.plates | {"right": cut})], "saw only part of the stance")


def test_a_plate_that_was_stepped_on_outside_of_the_window_only_is_refused(soft):
    refused([replace(soft, start_s=0.0, end_s=0.3)], "no stance of the prosthetic foot in the trial's window")
    refused([unloaded(soft, np.ones(len(soft.prosthetic_plate.time_s), dtype=bool))], "saw no stance")


def test_a_trial_without_centre_of_pressure_is_refused_where_it_is_compared(soft, stiff):
    blind = with_plate(stiff, has_cop=False, cop_W=np.full_like(stiff.prosthetic_plate.cop_W, np.nan))
    error = refused([soft, blind], "no centre of pressure, which is to be compared")
    assert error.file == stiff.path
    refused([soft], "no centre of pressure", [blind])
    check_recordings([soft, blind], series=("vertical",))


def test_a_fit_refuses_what_cannot_be_fitted_before_it_begins(soft, stiff, fit_walker):
    heavier = replace(stiff, subject=replace(stiff.subject, mass_kg=91.0))
    with pytest.raises(InputError, match="another subject"):
        ContactFit([soft, heavier], walker=fit_walker)
    with pytest.raises(InputError, match="no trial to fit"):
        ContactFit([])


def test_a_held_out_trial_is_checked_before_a_fit_is_judged(soft):
    class Done:
        fit = SimpleNamespace(trials=(soft,), labels=("low_1",), options=SimpleNamespace(series=SERIES))

        def check(self):
            pass

    with pytest.raises(InputError, match="fitted and held out"):
        assess(Done(), [replace(soft, path=Path("copy.yaml"))])


def test_labels_are_file_names_with_their_folder_where_two_are_the_same(soft, stiff):
    there = replace(stiff, path=Path("/a/monday/walk.yaml")), replace(stiff, path=Path("/a/tuesday/walk.yaml"))
    assert labels_of([soft, stiff]) == ("low_1", "high_1")
    assert labels_of([soft, *there]) == ("low_1", "monday/walk", "tuesday/walk")


def test_a_trial_that_has_a_fitted_contact_is_refused(soft):
    applied = replace(soft, notes=(*soft.notes, "A fitted contact was applied from contact.yaml."))
    refused([applied], "has a fitted contact already")


def test_as_many_folders_as_needed_tell_trials_apart(soft):
    def at(path):
        return replace(soft, path=Path(path))

    trials = [at("monday/soft/walk.yaml"), at("tuesday/soft/walk.yaml"), at("tuesday/soft/run.yaml")]
    assert labels_of(trials) == ("monday/soft/walk", "tuesday/soft/walk", "run")
