"""The floor of the synthetic reference subject's trials: what the true foot itself gets wrong on
noisy kinematics.

The virtual prosthesis that made the plates walks once more with each trial's kinematics and is
scored as a model is: on the exact tier (which must reproduce the plate), on the laboratory tier as
recorded, with the errors taken off that all trials share, and with each trial's height fitted
besides. A fit whose error lies below its floor fitted noise.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import made_by
from make_reference_subject import DATA, SEED
from virtual_laboratory.floor import (
    SCORES,
    floor,
    floor_with_height_fitted,
    floor_with_shared_errors_removed,
    scores,
    virtual_walk,
)

from vsf_drake.base.files import PACKAGE, sha256, write_json
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.walks.embedded import REPEATS, SETTINGS

RESULTS = Path(__file__).resolve().parent / "results"
SHIPPED = "../../models/"
NOMINAL = f"{SHIPPED}nominal.yaml"
"""Of trials that name no model, as the reference subject's; by its path in that folder."""
KINDS = {
    "exact": (
        "the exact tier's kinematics and plate: zero but for the rounding of the files, or the "
        "route is wrong"
    ),
    "plate_noise": "the exact tier's kinematics, the laboratory tier's plate",
    "laboratory": "the laboratory tier's kinematics and plate, as recorded",
    "shared_errors_removed": (
        "the same without the errors that all trials share, for a fit that corrects those"
    ),
    "height_fitted": (
        "the same with the height of the trial fitted besides, for the very trial that a fit was "
        "given"
    ),
}
LARGEST_ERROR_BW = 1e-3
"""In the exact tier, of the resultant: more means that this is not the walk that was recorded."""


def main() -> None:
    """Walks every trial, prints a table and writes floor.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; {RESULTS} unless --quick is given"
    )
    parser.add_argument("--quick", action="store_true", help="one trial; needs --out")
    arguments = parser.parse_args()
    if arguments.quick and not arguments.out:
        parser.error("a part of the trials must not replace them all: give --out")
    out = arguments.out or RESULTS
    out.mkdir(parents=True, exist_ok=True)
    names = [f"{setting}_{i}" for setting in SETTINGS for i in range(1, REPEATS + 1)][
        : 1 if arguments.quick else None
    ]
    trials: dict[str, dict[str, Any]] = {}
    inputs: dict[str, str] = {}
    print(f"resultant error, % BW{'':<6}" + "".join(f"{kind:>24}" for kind in KINDS))
    for name in names:
        exact, noisy = (
            load_trial(DATA / tier / f"{name}.yaml") for tier in ("exact", "laboratory")
        )
        inputs |= hashes(exact) | hashes(noisy)
        walk = virtual_walk(exact)
        found = {
            "exact": scores(walk, exact.prosthetic_plate),
            "plate_noise": scores(walk, noisy.prosthetic_plate),
            "laboratory": floor(noisy),
            "shared_errors_removed": floor_with_shared_errors_removed(noisy, SEED),
            "height_fitted": floor_with_height_fitted(noisy, SEED),
        }
        if found["exact"]["grf_rmse_bw"] > LARGEST_ERROR_BW:
            raise SystemExit(
                f"{name}: the virtual prosthesis does not reproduce its own plate: "
                f"{100 * found['exact']['grf_rmse_bw']:.3g} % BW"
            )
        trials[name] = {"fulcrum_mm": round(1e3 * exact.fulcrum_m, 9), **found}
        print(f"{name:26}" + "".join(f"{100 * found[kind]['grf_rmse_bw']:24.4f}" for kind in KINDS))
    mean = {
        kind: {
            key: float(np.mean([row[kind][key] for row in trials.values()]))
            for key in SCORES
            if "rmse" in key
        }
        for kind in KINDS
    }
    print(f"{'mean':26}" + "".join(f"{100 * mean[kind]['grf_rmse_bw']:24.4f}" for kind in KINDS))
    write_json(
        out / "floor.json",
        {
            "synthetic": True,
            "definitions": KINDS,
            "trials": trials,
            "mean_of_trials": mean,
            "provenance": {
                **provenance(inputs, SEED),
                "sources": made_by("floor_of_the_reference_subject.py"),
            },
        },
    )


def hashes(trial: Trial) -> dict[str, str]:
    """SHA-256 of the trial's files and of the nominal model by their path in the reference
    subject's folder."""
    folder = os.path.relpath(trial.path.parent, DATA)
    return {NOMINAL: sha256(DATA / NOMINAL)} | {
        SHIPPED + name.removeprefix(PACKAGE)
        if name.startswith(PACKAGE)
        else Path(os.path.normpath(os.path.join(folder, name))).as_posix(): sha
        for name, sha in trial.inputs.items()
    }


if __name__ == "__main__":
    main()
