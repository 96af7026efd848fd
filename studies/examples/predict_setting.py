"""The walk at the middle setting, predicted from walks at the outer ones, beside the plates of
three walks that were recorded there. SYNTHETIC."""

from __future__ import annotations

import numpy as np

import vsf_drake as vsf

FOLDER = "data/reference_subject/laboratory"
MIDDLE_M = 0.108


def main() -> dict[str, float]:
    """Root mean square error of the vertical force and of a null model (the outer plates' curves,
    interpolated), body weights, against the mean of the recorded curves."""
    names = [f"{setting}_{number}" for setting in ("low", "medium", "high") for number in (1, 2, 3)]
    trials = [vsf.load_trial(vsf.resource(f"{FOLDER}/{name}.yaml")) for name in names]
    contact = vsf.load_contact(vsf.resource(f"{FOLDER}/contact.yaml"))
    found = vsf.predict(trials[:3] + trials[6:], contact, fulcrum_m=MIDDLE_M)
    there = vsf.predict(trials, contact, fulcrum_m=MIDDLE_M)
    soft, recorded, stiff = there.arrays["plates"][:, :, 2]
    low, middle, high = there.table.answer.settings_mm
    between = soft + (middle - low) / (high - low) * (stiff - soft)
    predicted = found.arrays["person"][:, 2]
    return {
        "predicted_bw": float(np.sqrt(np.mean((predicted - recorded) ** 2))),
        "null_bw": float(np.sqrt(np.mean((between - recorded) ** 2))),
    }


if __name__ == "__main__":
    print(main())
