"""What a reader of a tuning has to know before believing it."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.tuning.level1.combination import CONSISTENCY, TRACKING
from vsf_drake.analysis.tuning.level1.problem import Evaluation, StiffnessTuning
from vsf_drake.analysis.tuning.level1.sweep import Sweep
from vsf_drake.motion.fitted_trial import APPLIED

_APART_MM = 1.0


def notes(
    tuning: StiffnessTuning, best: Evaluation, found: Sweep | None, draw_failures: tuple[str, ...], *, success: bool
) -> tuple[str, ...]:
    """Sentences; the first says so if the result is not optimal."""
    options, told = tuning.options, []
    if not success:
        told.append("NOT OPTIMAL: the tuning ended before its end, and these are the numbers where it stopped.")
    told += [
        "The motion is given: the person does not adapt. Under the same motion a stiffer foot is pressed as far and "
        "bears and stores more; under the same load, as experiments have it, a softer one stores and returns more. "
        "Which of the two a person would do, the tuning with free motion asks.",
        "With the motion given the intact leg is the recording's at every setting: no cost counts it.",
        f"Walks are in steps of {1e3 * options.step_s:g} ms, those that look for starts and those of drawn contacts in "
        f"steps of {1e3 * options.search_step_s:g} ms."]
    if options.support_width_m > 0.0:
        width = 1e3 * tuning.parts[0].support_width_m
        told.append(f"The support passes a joint of the keel over {width:.3g} mm on either side, so that the cost has "
                    "a derivative there.")
    if CONSISTENCY in tuning.combination.factors:
        told.append(_share(tuning, best))
    if found is not None:
        told.append(_believable(found, options.consistency_bw))
    if "keel_thickness" in options.design:
        told.append("A thicker keel is stiffer by the cube of its thickness; that it is heavier too is left out.")
    own = [part.own[0] for part in tuning.parts]
    if np.ptp(own) > _APART_MM and tuning.cost_name != TRACKING:
        told.append(f"The trials were walked with the fulcrum from {min(own):.0f} to {max(own):.0f} mm. Each motion "
                    "belongs to its own setting, and one setting for all is a compromise between them.")
    if tuning.cost_name == TRACKING:
        told.append("Tracking is a test, no aim: its optimum tells where the model believes the fulcrum to have stood. "
                    "It stood at " + ", ".join(f"{value:.0f}" for value in sorted(set(own))) + " mm.")
    general = [part.label for part in tuning.parts
               if not any(note.startswith(APPLIED) for note in part.trial.notes)]
    if general:
        told.append(f"No contact was fitted for {', '.join(general)}: the forces are those of a foot and a fit to the "
                    "limb in general.")
    if found is not None and found.failures:
        told.append(f"{len(found.failures)} walks of the sweep failed, the first of {found.failures[0]}")
    if found is not None and found.unconverged:
        told.append(f"{found.unconverged} walks of the sweep have steps that did not converge.")
    if draw_failures:
        told.append(f"{len(draw_failures)} draws of the contact could not be walked: {draw_failures[0]}")
    synthetic = sum(trial.synthetic for trial in tuning.trials)
    if synthetic:
        told.append(f"{synthetic} of {len(tuning.trials)} trials are synthetic: nobody walked them.")
    return tuple(told)


def _believable(found: Sweep, allowed_bw: float) -> str:
    near = found.believable(allowed_bw)
    most = f"over the whole range it changes by up to {np.nanmax(found.force_change):.0%}"
    if not near.any():
        return (f"Nowhere does the ground reaction force stay within {allowed_bw:.0%} body weight of that at the "
                f"recorded settings ({most}): these motions do not go together.")
    low, high = found.fulcrum_mm[near][[0, -1]]
    return (f"From {low:.0f} to {high:.0f} mm the ground reaction force stays within {allowed_bw:.0%} body weight of "
            f"that at the recorded setting; {most}. Farther away the given motion is none that anybody would walk, and "
            "the numbers there say no more than that.")


def _share(tuning: StiffnessTuning, best: Evaluation) -> str:
    options = tuning.options
    part = next(term.value for term in best.terms if term.name == CONSISTENCY)
    return (f"A change of the ground reaction force by {options.consistency_bw:.0%} body weight (root mean square over "
            f"stance, against the recorded setting) adds {options.consistency_weight:.0%} of the cost's size: nothing "
            f"in the given motion pays for it. At the optimum that part is {part / tuning.combination.size:.1%} of the "
            "size. The weight is a choice, and with the motion given it decides how far the optimum may go from the "
            "recorded setting: see what other weights would choose.")
