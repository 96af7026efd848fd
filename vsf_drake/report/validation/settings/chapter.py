"""The chapter "Can two settings be told apart?": a function of its saved section."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Bullets, Chapter, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.settings.effect_figure import settings_effect_figure
from vsf_drake.report.validation.settings.grids import (
    inverse_grid,
    outcome_grid,
    pair_grid,
    travel_grid,
    walked_grid,
)
from vsf_drake.report.validation.settings.pairs_figure import settings_pairs_figure, settings_travel_figure
from vsf_drake.report.validation.settings.words import (
    effect_alt,
    energy_words,
    inverse_words,
    method_lines,
    pairs_alt,
    paper_words,
    travel_alt,
)

TITLE = "Can two settings be told apart?"


def settings_chapter(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Chapter:
    """The answer, what the model predicts against what is detectable, and how that was found."""
    pieces: list[Piece] = [Text(table["answer"])]
    if not table["outcomes"]:
        return Chapter(name="settings", title=TITLE, pieces=(*pieces, Missing("There is nothing to show.")))
    pieces += [
        Text(paper_words(table)), Heading("With the motion held"),
        Text("Each recorded motion is walked at every position of the fulcrum, everything else equal. This is what the "
             "model predicts of turning the fulcrum without changing the gait: the foot is bent by the same motion, "
             "and its force follows its stiffness. It asks whether model and recording are good enough to tell which "
             "setting was in the foot."),
        Picture(name="settings_effects", figure=settings_effect_figure(table, arrays), alt=effect_alt(table),
                caption="Six outcomes as differences from the middle position. Coloured: each trial; black: their "
                        "mean. A difference inside a grey band is not detectable at 95 % with one walk at each "
                        "position; the bands are nested, the darkest is of the same recording."),
        outcome_grid(table),
        Picture(name="settings_travel", figure=settings_travel_figure(table), alt=travel_alt(table),
                caption="The travel of the fulcrum, half of it to each side of the middle of its range, from which on "
                        "the predicted difference exceeds what is detectable."),
        travel_grid(table),
        Picture(name="settings_pairs", figure=settings_pairs_figure(table), alt=pairs_alt(table),
                caption="The predicted difference of each pair of positions over the smallest detectable one; dark "
                        "cells (above 1) are told apart. Neighbouring positions stand on the left of each panel."),
        pair_grid(table), *([Text(words)] if (words := energy_words(table)) else [])]
    if table["as_walked"]:
        pieces += [
            Heading("As the settings were walked"),
            Text("At another setting a person also moves otherwise, which can make up for much of the difference. Here "
                 "each setting is walked with the motion that was recorded at it. The error's half width is what the "
                 "model may err by in such a difference, which the plates tell: t times the standard error of "
                 "(simulated less measured), within settings. That of the strides is the same of the simulated strides "
                 "themselves, which differ at one setting too. Energy has no plate; it is held against the strides "
                 "alone."
                 + (" The trials are synthetic: how motion and force change with the setting was chosen by who made "
                    "them." if table["synthetic"] else "")),
            walked_grid(table)]
    pieces += [Heading("The fulcrum from the force alone"), Text(inverse_words(table)), inverse_grid(table),
               Heading("How this was found"), Bullets(method_lines(table))]
    return Chapter(name="settings", title=TITLE, pieces=tuple(pieces))
