"""A study of the embedded trials as the tests of the validation take it; made once a session."""

from __future__ import annotations

from functools import cache

from vsf_drake.analysis.validation import Study, StudyOptions, embedded_contact, embedded_trials, make_study


@cache
def embedded_study(*, quick: bool = True, tier: str = "laboratory", with_contact: bool = True) -> Study:
    """One walk a setting (all nine if not `quick`), with the stored contact or with fitted offsets; no bench file."""
    return make_study(embedded_trials(tier, quick=quick), contact=embedded_contact(tier) if with_contact else None,
                      options=StudyOptions(quick=quick, workers=1))
