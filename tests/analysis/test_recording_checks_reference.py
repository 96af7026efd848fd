"""The checks on walks whose truth is known: right ones are good, ones with misplaced markers are not."""

from __future__ import annotations

import pytest

from vsf_drake.analysis.recording.examine import examine
from vsf_drake.motion.trial import load_trial
from vsf_drake.resources import resource

SETTINGS = ("low", "medium", "high")


def examined(tier: str, setting: str):
    return examine(load_trial(resource(f"data/reference_subject/{tier}/{setting}_1.yaml")))


@pytest.mark.parametrize("setting", SETTINGS)
def test_walk_consistent_to_the_time_step_is_good_in_every_check(setting):
    item = examined("exact", setting)
    assert [check.sentence for check in item.checks if check.mark != "good"] == []
    found = {check.name: check.value for check in item.checks}
    assert found["lag of the forces"] == pytest.approx(0.0, abs=0.010)
    assert found["mass from the forces"] == pytest.approx(78.0, rel=0.01)


@pytest.mark.parametrize("setting", SETTINGS)
def test_walk_with_markers_a_degree_off_is_doubtful_and_not_unusable(setting):
    item = examined("laboratory", setting)
    assert item.mark == "doubtful"
    assert any(check.name in ("slip at foot-flat", "height drift through foot-flat") for check in item.checks
               if check.mark == "doubtful")
