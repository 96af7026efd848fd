"""The report's chapter on energy storage and return: a function of the saved section."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vsf_drake.report.pieces import Bullets, Chapter, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.energy.grids import (
    conditions_grid,
    convergence_grid,
    ledger_grid,
    moved_grid,
    trials_grid,
)
from vsf_drake.report.validation.energy.ledger_figure import energy_ledger_figure
from vsf_drake.report.validation.energy.position_figure import energy_position_figure
from vsf_drake.report.validation.energy.power_figure import energy_power_figure
from vsf_drake.report.validation.energy.stance_figure import energy_stance_figure
from vsf_drake.report.validation.energy.words import (
    checks,
    closing,
    finding,
    ledger_alt,
    position_alt,
    power_alt,
    softer,
    stance_alt,
)

_DEFINITIONS = (
    "Stored: strain of keel, fulcrum support and foam above that at touch-down, at its largest during stance. "
    "Returned: what the foot gives back of it until toe-off, that is the strain that is released without what keel, "
    "foam, support and friction lose meanwhile. Return ratio: returned over stored. Efficiency: returned over all "
    "that was put into the foot up to the largest strain, stored or lost. Stance is where the model's own vertical "
    "force is above 20 N.")
_BOUNDARY = (
    "The ledger is of the prosthesis: socket bushing, socket, pylon and foot. The residual limb works on it through "
    "the bushing; the ground is at rest and only takes. Strains, kinetic energy and gravity are functions of the "
    "state; losses and the limb's work are integrals of a force law times a velocity, and the limb's force is that of "
    "the bushing's law, not of a balance. So nothing makes the ledger close but the mechanics. What remains is the "
    "numerical dissipation of the implicit steps, which are of first order; it has a line of its own and is in no "
    "other.")
_POWER = (
    "Distal segment power is the power that passes into a segment from all below it, P = F · v_d + M_free · ω with "
    "v_d = v_s + ω × (CoP - CM): force of the ground, its free moment, and the motion of the segment taken as rigid "
    "down to the centre of pressure. The formula is Siegel's (1996), widened by Takahashi (2012) to the unified "
    "deformable segment and derived in the appendix of Zelik and Honert (2018, doi 10.1016/j.jbiomech.2018.04.017), "
    "as a public program of one of these authors has it; the papers' own equations were not read for this report. "
    "From the pylon it is the foot alone; from the residual shank, where markers would see it, the socket's give is "
    "in it.")
_MEASURED = (
    "There is no measured energy to compare with: neither the paper nor the trials have any. Known of the real "
    "device is the direction: human subjects stored and returned more energy with lower stiffness settings (Glanzer "
    "and Adamczyk 2018, PMC6289620, abstract).")


def energy_chapter(table: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Chapter:
    """What the foot stores and returns by fulcrum position, and how well the ledger of it closes."""
    pieces: list[Piece] = [Text(finding(table)), Missing(_MEASURED)]
    if not table["trials"]:
        return Chapter(name="energy", title="Energy storage and return", pieces=tuple(pieces))
    pieces += [
        Text(_DEFINITIONS), conditions_grid(table),
        Picture(name="energy_stance", figure=energy_stance_figure(table, arrays), alt=stance_alt(table),
                caption="Energy in the foot over stance, the first trial at each fulcrum position: strain of keel, "
                        "fulcrum support and foam on top of each other (their sum is the broken line), and what the "
                        "foot has lost so far (dotted)."),
        trials_grid(table),
        Heading("Does a softer setting store and return more?"), Text(softer(table))]
    if table["same_load"] or table["same_motion"]:
        pieces += [
            Picture(name="energy_position", figure=energy_position_figure(table), alt=position_alt(table),
                    caption="Stored (full) and returned (hollow) over the fulcrum's position; soft is left. Left: "
                            "every trial as recorded. Middle: each trial's vertical force kept by raising or lowering "
                            "the pelvis while the fulcrum moves. Right: each trial's motion kept, so that the load "
                            "changes. Each panel has its own scale."),
            moved_grid(table, "same_load"), moved_grid(table, "same_motion")]
    pieces += [
        Heading("Does the ledger close?"), Text(closing(table)), Text(_BOUNDARY),
        Picture(name="energy_ledger", figure=energy_ledger_figure(table), alt=ledger_alt(table),
                caption="Left: from the limb's work, one term after the other is taken off; light: still there, dark: "
                        "lost. Right: largest remainder within stance over stored energy, for each trial."),
        ledger_grid(table), convergence_grid(table), Text("The same by second methods:"), Bullets(checks(table)),
        Heading("Distal segment power"), Text(_POWER),
        Picture(name="energy_power", figure=energy_power_figure(table, arrays), alt=power_alt(table),
                caption="Distal segment power over stance, a line a stance, means over 0.5 % of stance. Positive: "
                        "given back to the limb.")]
    return Chapter(name="energy", title="Energy storage and return", pieces=tuple(pieces))
