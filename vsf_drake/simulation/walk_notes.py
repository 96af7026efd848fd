"""What a reader of a walk's numbers has to know about the run."""

from __future__ import annotations

import numpy as np

from vsf_drake.model_file import FOAM_LOADS_N, foam_under_load, secant_stiffness
from vsf_drake.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.walk_run import Walk

PLAUSIBLE_PEAK_BW = (0.6, 2.5)
"""Peak vertical force of walking, in body weights, with a wide margin."""
FOAM_AGREEMENT = 0.05
"""Share by which the foam may differ between bench and walk before a note says so (a choice)."""
AT_REST = 1e-5
"""Speed (m/s, rad/s) below which free coordinates count as at rest at the start."""


def walk_notes(walk: Walk, subject: Subject, model: ModelParameters) -> list[str]:
    """Sentences on convergence, plausibility and the start of `walk`."""
    notes, record = [], walk.record
    unconverged, refined = np.count_nonzero(~record.converged), np.count_nonzero(record.parts > 1)
    if unconverged:
        notes.append(f"{unconverged} of {len(record.time_s)} steps did not converge")
    if refined:
        notes.append(f"{refined} of {len(record.time_s)} steps were cut into up to {record.parts.max()} pieces")
    notes += implausible_load(walk.prosthetic.grf_W[:, 2], subject.mass_kg)
    notes += _too_deep(walk, model)
    if walk.prosthetic.grf_W[0, 2] > LOADED_N:
        notes.append(f"The run starts with {walk.prosthetic.grf_W[0, 2]:.0f} N on the prosthetic foot, at rest in "
                     "equilibrium and without shear: its first hundredths of a second are not the recording's.")
    foam = foam_under_load(model.foot)
    bench = model.foot.series_stiffness_n_per_m, model.foot.series_exponent
    walk_k, bench_k = (secant_stiffness(*law, FOAM_LOADS_N[1]) for law in (foam or bench, bench))
    if abs(walk_k / bench_k - 1) > FOAM_AGREEMENT:
        notes.append(f"The forefoot's spheres have {1e-3 * walk_k:.1f} N/mm where the bench's foam has "
                     f"{1e-3 * bench_k:.1f}: this model walks on another foam than it is tested with.")
    if walk.rest_speed > AT_REST:
        notes.append(f"The free coordinates did not come to rest before the start (speed {walk.rest_speed:.2g}).")
    return notes


def _too_deep(walk: Walk, model: ModelParameters) -> list[str]:
    """A sentence for each foot that goes deeper into the ground than what its contact stands for is thick."""
    count, depth = sum(len(zone.x_mm) for zone in model.foot.zones), walk.record.site("depth")
    notes = []
    for foot, own, limit, what in (
            ("prosthetic", depth[:, :count], model.foot.foam_thickness_m, "the foam under the keel is thick"),
            ("intact", depth[:, count:], float(walk.mechanism.sites[count:, 3].max(initial=0.0)),
             "the radius of its largest contact sphere is")):
        deepest = own.max(axis=1, initial=0.0)
        if deepest.max() > limit:
            at = "already at the start" if deepest[0] > limit else (
                f"first at {walk.record.time_s[int(np.argmax(deepest > limit))]:.3f} s")
            notes.append(
                f"The {foot} foot goes {1e3 * deepest.max():.0f} mm into the ground ({at}), more than the "
                f"{1e3 * limit:.0f} mm that {what}: its forces there mean nothing. The recorded path of the pelvis, "
                "the subject's lengths and the ground do not fit together.")
    return notes


def implausible_load(vertical_n: np.ndarray, mass_kg: float) -> list[str]:
    """A sentence if the vertical force (n,) N is not one of a person of `mass_kg` walking, else nothing."""
    peak = float(vertical_n.max()) / (mass_kg * GRAVITY)
    if PLAUSIBLE_PEAK_BW[0] < peak < PLAUSIBLE_PEAK_BW[1]:
        return []
    return [f"The largest vertical force on the prosthetic foot is {peak:.2f} body weights: the recorded path of the "
            "pelvis, the subject's lengths and the ground do not fit together. Fitting the offsets may help."]
