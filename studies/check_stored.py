"""Whether the numbers in studies/results and data/validation are those that today's sources and
data give; if so, says so in them.

A stored result carries digests of the files that were read and of the sources that made it,
comments aside (`contact_fit_study.keeping`). Where the sources are others, a small part of the
study is made anew, in seconds, and has to give the stored numbers: then the digest of today's
sources is written beside them, with the words "spot check". Where it does not, a file is another,
or something is `missing` in the result, the study has to run again.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import adaptive_stride as strides
import angle_errors
import contact_fit_study.inputs as contact_fit
import contact_truth_recovery as truth
import device_hypotheses as devices
import foot_from_curves
import keel_torsion
import numpy as np
import own_strides
import published_trends as trends
import recording_faults as faults
import session_fit
import setting_answer
import ship_validation
from contact_fit_study.cases import TIERS
from contact_fit_study.keeping import STUDIES, sources_sha256
from contact_truth_study.making import assuming
from contact_truth_study.recovering import ROUNDS, row
from floor_of_the_reference_subject import DATA, RESULTS, SEED
from shipped_sections.sensitivity import (
    OUTPUTS,
    DesignWalks,
    chosen_walks,
    sensitivity_factors,
)
from shipped_sections.settings import bases_of, walked_rows
from shipped_sections.settings_walks import NAMES, walk_all
from virtual_laboratory.floor import floor, floor_with_shared_errors_removed

from vsf_drake.base.files import read_npz, resource, sha256, write_json
from vsf_drake.fit.assessment import FITTED, HELD_OUT
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solve import search
from vsf_drake.model.model_file import load_model
from vsf_drake.optimal_control.outcomes import outcomes
from vsf_drake.optimal_control.recorded_stride import recorded_stride
from vsf_drake.optimal_control.search import eased
from vsf_drake.validation.options import StudyOptions
from vsf_drake.validation.published_trends import load_evidence
from vsf_drake.validation.roll_over_section import ISO_STEPS, QUICK_POSITIONS_M
from vsf_drake.validation.run import LONG, SHIPPED
from vsf_drake.validation.walking_section import layers_section
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.prediction import LAYERS, PHYSICS
from vsf_drake.walks.published import LOAD

REPEATS = 1e-4
"""Relative: on one machine the numbers come back to the last bit; what moves them by less shows in
no table."""
CHECKED = (
    "made by other sources; the spot check of studies/check_stored.py finds them again with these"
)
Numbers = Iterator[tuple[str, float, float]]
"""What, found, stored."""


def floors(stored: dict[str, Any]) -> Numbers:
    """Two of the softest trial's floors."""
    trial = contact_fit.trial("laboratory", "low_1")
    for kind, found in (
        ("laboratory", floor(trial)),
        ("shared_errors_removed", floor_with_shared_errors_removed(trial, SEED)),
    ):
        for key in ("grf_rmse_bw", "cop_rmse_fl", "stance_model_s"):
            yield f"low_1 {kind} {key}", found[key], stored["trials"]["low_1"][kind][key]


def fitted_pair(stored: dict[str, Any]) -> Numbers:
    """The reported pair's fitted values on a trial that was held out and on the bench, in both
    tiers."""
    for tier in TIERS:
        pair = stored[tier]["transfer"]
        fit = ContactFit(
            [contact_fit.trial(tier, name) for name in pair["fitted"]], bench=contact_fit.bench()
        )
        u = fit.parameters.u(pair["values"])
        held = contact_fit.trial(tier, "medium_2")
        comparison, result = fit.terms_of(held, None).walk(
            u, step_s=ContactFitOptions().report_step_s
        )
        found = vars(walk_metrics(result, held.prosthetic_plate, comparison=comparison))
        for key in ("grf_rmse_bw", "fore_aft_rmse_bw", "cop_rmse_fl", "stance_model_s"):
            yield f"{tier} medium_2 {key}", found[key], pair["trials"]["medium_2"][key]
        yield (
            f"{tier} stiffness at 66 mm",
            1e-3 * fit.bench_stiffness(u)[0],
            pair["bench"]["model_n_per_mm"][0],
        )


def recovered_truth(stored: dict[str, Any]) -> Numbers:
    """The search that begins at the truth of one trial."""
    recording = assuming(truth.made(truth.TRIALS["one_trial"], [truth.SEED, 0, 0], 0.0), ROUNDS[-1])
    found = row(recording, search(recording.fit, recording.truth))
    of = stored["recovery"]["one_trial"]["truths"][0]["from_truth"]
    yield "cost from truth", found["cost"], of["cost"]
    yield "force from truth", found["grf_rmse_bw"][0], of["grf_rmse_bw"][0]


def both_devices(stored: dict[str, Any]) -> Numbers:
    """Bench of both at the ends, and where the energy of a stiff walk sits."""
    for name, of in stored["devices"].items():
        model = load_model(resource(f"models/{name}.yaml"))
        rows = {row["fulcrum_mm"]: row for row in of["bench"]["settings"]}
        for setting in devices.bench(model, quick=True)["settings"]:
            mm = setting["fulcrum_mm"]
            yield f"{name} at {mm:g} mm", setting["simulated"], rows[mm]["simulated"]
        trial = devices.on(contact_fit.trial(devices.TIER, devices.WALKED[-1]), model, quick=False)
        found, was = devices.by_part(trial, devices.FINE_S), of["energy"]["walks"][-1]
        for key in ("stored_j", "support_share"):
            yield f"{name} {devices.WALKED[-1]} {key}", found[key], was[key]


def fitted_session(stored: dict[str, Any]) -> Numbers:
    """The first person's true values, the fitted ones on a trial of the same day that was held
    out."""
    case = session_fit.CASES[0]
    pair, fit = stored["cases"][case.name], session_fit.fit_of(case, session_fit.DATA)
    held = session_fit.read(session_fit.DATA, case, "medium_2")
    u, known = fit.parameters.u(pair["values"]), pair["end"]["parameters"]
    comparison, result = fit.terms_of(held, None).walk(u, step_s=ContactFitOptions().report_step_s)
    found = vars(walk_metrics(result, held.prosthetic_plate, comparison=comparison))
    for key, was in pair["walked"]["medium_2"].items():
        yield f"{case.name} medium_2 {key}", found[key], was
    for name, true in session_fit.truths(case, session_fit.DATA).items():
        yield f"{case.name} true {name}", true, known[name]["truth"]


def foot_under_load(stored: dict[str, Any]) -> Numbers:
    """What the foot alone does under an equal load; strides that adapt are `strides_of_one_walk`'s
    to tell."""
    study = trends.embedded(quick=True)
    found, stiffness = load_evidence(
        study.walks[0].recorded.subject, study.model, QUICK_POSITIONS_M, steps=ISO_STEPS
    )
    was = {one["measure"]: one["values"] for one in stored["evidence"] if one["way"] == LOAD}
    for one in found:
        for setting, (value,) in enumerate(one.values):
            yield f"{one.measure} at setting {setting + 1}", value, was[one.measure][setting][0]
    for setting, value in enumerate(stiffness):
        yield f"stiffness at setting {setting + 1}", value, stored["stiffness"][LOAD][setting]


def strides_of_one_walk(stored: dict[str, Any]) -> Numbers:
    """A recorded stride, made consistent, and what comes out of one that adapts to the softest
    setting: of the first row whose best stride there is that of its sweep's first search."""
    rows = [
        each
        for each in stored["signs"]
        if each["tried"][0]["from softer contact"]
        == min(cost for cost in each["tried"][0].values() if cost is not None)
    ]
    if not rows:
        yield (
            "rows whose best stride at the softest setting is that of its sweep's first search",
            0.0,
            1.0,
        )
        return
    told = rows[0]
    (name,) = (
        name for name in stored["costs"] if stored["found"][name]["own_mm"] == told["recorded_mm"]
    )
    one, was = (
        strides.Recorded(DATA / "exact" / f"{name}.yaml", strides.COARSE),
        stored["found"][name],
    )
    yield f"{name} deviation", one.recording.value("deviation", one.solution.y()), was["deviation"]
    for key, value in was["errors"].items():
        yield f"{name} {key}", one.recording.recorded.errors[key], value
    mm, search = strides.STARTS_MM[0], one.search("activation", normal_weight=told["weight"])
    _, begin = eased(search, mm, one.solution.last)
    found = outcomes(search.at(mm, begin, "from softer contact"), search.stride)
    for key, values in told["outcomes"].items():
        yield f"{name} {key} at {mm:g} mm, weight {told['weight']:g}", found[key], values[0]


def disturbed_walks(stored: dict[str, Any]) -> Numbers:
    """The fitted walks and one that was held out with errors of their own, by the physics; those
    held out without, in layers."""
    study = angle_errors.embedded()
    fitted = [walk.label for walk in study.walks if walk.role == FITTED]
    was = {
        (each["role"], each["layer"], each["sd_deg"]): each["grf_rmse_bw"]
        for each in stored["rows"]
    }
    for one in angle_errors.disturbed(study, fitted):
        assert one.grf_rmse_bw is not None
        yield (
            f"fitted with {one.sd_deg:g} degrees",
            one.grf_rmse_bw,
            was[FITTED, PHYSICS, one.sd_deg],
        )
    for one, alone in zip(
        angle_errors.disturbed(study, (angle_errors.ONE,)), stored["one"], strict=True
    ):
        assert one.grf_rmse_bw is not None
        yield (
            f"{angle_errors.ONE} with {one.sd_deg:g} degrees",
            one.grf_rmse_bw,
            alone["grf_rmse_bw"],
        )
    held_out = [walk for walk in layers_section(study).table.rows if walk.role == HELD_OUT]
    for layer in LAYERS:
        error = float(np.mean([walk.number(f"{layer}_grf_rmse_bw") for walk in held_out]))
        yield f"held out by {layer}", error, was[HELD_OUT, layer, 0.0]


def settings_as_walked(stored: dict[str, Any]) -> Numbers:
    """Settings as they were walked, and one trial at every position without noise."""
    table = stored["table"]
    bases, _, _ = bases_of(ship_validation.embedded(StudyOptions()))
    was = {(row["outcome"], row["from_mm"], row["to_mm"]): row for row in table["as_walked"]}
    for pair in walked_rows(bases):
        place = pair.outcome, pair.from_mm, pair.to_mm
        for key in ("simulated", "measured", "stride_half_width"):
            if (found := getattr(pair, key)) is not None:
                yield f"{place} {key}", found, was[place][key]
    positions_m = [1e-3 * mm for mm in table["positions_mm"]]
    (walked,) = walk_all(bases[:1], positions_m, draws=0, seed=0, workers=1)
    effects = read_npz(resource(f"{SHIPPED}/settings.npz"))["effects"][0]
    for mm, found, own in zip(table["positions_mm"], walked.alone, effects, strict=True):
        for name, value, known in zip(NAMES, found, own, strict=True):
            yield f"{name} at {mm:g} mm", value, known


def sensitivity_before_changes(stored: dict[str, Any]) -> Numbers:
    """The factors' ranges, and the outputs where nothing is changed."""
    walks = chosen_walks(ship_validation.embedded(StudyOptions()))
    design = DesignWalks(walks)
    means = design.baseline().mean(axis=0)
    for name, mean in zip(OUTPUTS, means, strict=True):
        yield name, mean, stored["table"]["outputs"][name]["baseline"]
    side = walks[0].trial.subject.prosthetic_side
    factors = sensitivity_factors(design.trials[0].variables, side)
    for factor, was in zip(factors, stored["table"]["factors"], strict=True):
        yield f"lowest {factor.name}", factor.low, was["low"]
        yield f"highest {factor.name}", factor.high, was["high"]


def answered_setting(stored: dict[str, Any]) -> Numbers:
    """How far the middle setting's motion is off in the embedded sessions, and what is true of one
    draw at the softest setting, walked again by two of the answers."""
    for person, was in stored["embedded"].items():
        found = setting_answer.middle_of_session(person.upper())
        for key in ("mean_deg", "answer_deg", "spread_deg"):
            yield f"{person} {key}", found[key], was[key]
    person = setting_answer.persons()["A"]
    draw = setting_answer.draws("A", 1, setting_answer.EMBEDDED)[0]
    body = setting_answer.moving("A")
    made = setting_answer.walks(body, person, draw, setting_answer.STEPS)
    for answer, trial, _, prosthesis in islice(made, 2):
        was = stored["persons"][f"a_{answer}"]["truth"][draw.name]
        for name, value in setting_answer.true_costs(body, prosthesis, trial).items():
            yield f"a {answer} {draw.name} {name}", value, was[name]


def recorded_strides(stored: dict[str, Any]) -> Numbers:
    """What the sagittal plane leaves out of one person's recorded strides."""
    recorded = [recorded_stride(trial) for trial in own_strides.fitted_walks("a")]
    for name, found in own_strides.left_out(recorded).items():
        yield name, found, stored["persons"]["a"]["left_out"][name]


def spoiled_walk(stored: dict[str, Any]) -> Numbers:
    """What the checks say of one walk with two of its faults, and what these do to the force."""
    rows = {(row["walk"], row["fault"]): row for row in stored["rows"]}
    person, name = faults.JUDGED[0], faults.WALKS[0]
    labels = [faults.CLEAN, *faults.PAIRS[0]]
    found = faults.true_errors((person, name), labels)
    for label in labels:
        was = rows[f"{person}/{name}", label]
        now = found[label] | faults.judged(person, name, label)
        for key in ("true_bw", "effect_bw", "expected_bw", "share_bw"):
            yield f"{label} {key}", now[key], was[key]


def made_feet(stored: dict[str, Any]) -> Numbers:
    """Two made feet, recorded and fitted again."""
    with tempfile.TemporaryDirectory() as folder:
        for number, was in enumerate(stored["feet"][:2]):
            found = foot_from_curves.judge(number, Path(folder))
            for name, error in found["errors"].items():
                yield f"foot {number} {name}", error, was["errors"][name]
            for key in ("unseen", "coverage", "lost_share"):
                yield f"foot {number} {key}", found[key], was[key]


def twisting_keel(stored: dict[str, Any]) -> Numbers:
    """What twisting does to the reference subject's foot in one walk, and what the model of a
    person whose foot twists misses in one."""
    name = keel_torsion.WALKS[0]
    foot = keel_torsion.true_foot(keel_torsion.REFERENCE_SUBJECT, name)
    contact = keel_torsion.fitted_contact("a")
    model = keel_torsion.model_curves(keel_torsion.recorded("a", name), contact)
    twisting = keel_torsion.stance_curves(
        foot.walk(twists=keel_torsion.TWISTS), foot.walk(twists=0).plate
    )
    for person, key, curves in (
        (keel_torsion.REFERENCE_SUBJECT, "twisting", twisting),
        ("a", "error", model),
    ):
        was = stored["persons"][person]["walks"][name][key]
        for quantity, found in keel_torsion.differences(curves).items():
            yield f"{person} {name} {key} {quantity}", found, was[quantity]


CHECKS: dict[str, tuple[str, Callable[[dict[str, Any]], Numbers]]] = {
    "floor": ("floor_of_the_reference_subject.py", floors),
    "contact_fit": ("contact_fit.py", fitted_pair),
    "contact_truth_recovery": ("contact_truth_recovery.py", recovered_truth),
    "device_hypotheses": ("device_hypotheses.py", both_devices),
    "session_fit": ("session_fit.py", fitted_session),
    "setting_answer": ("setting_answer.py", answered_setting),
    "own_strides": ("own_strides.py", recorded_strides),
    "adaptive_stride": ("adaptive_stride.py", strides_of_one_walk),
    "published_trends": ("published_trends.py", foot_under_load),
    "angle_errors": ("angle_errors.py", disturbed_walks),
    "recording_faults": ("recording_faults.py", spoiled_walk),
    "foot_from_curves": ("foot_from_curves.py", made_feet),
    "keel_torsion": ("keel_torsion.py", twisting_keel),
    "settings": ("ship_validation.py", settings_as_walked),
    "sensitivity": ("ship_validation.py", sensitivity_before_changes),
}
"""By result: the script that makes it and its spot check. `contact_fit` reads the floors."""


def read(name: str) -> dict[str, Any]:
    """A stored result."""
    content: dict[str, Any] = json.loads(file_of(name).read_text(encoding="utf-8"))
    return content


def file_of(name: str) -> Path:
    """Where it is stored."""
    return (resource(SHIPPED) if name in LONG else RESULTS) / f"{name}.json"


def changed_files(name: str, stored: dict[str, Any]) -> list[str]:
    """Files that were read and are others now."""
    now = contact_fit.input_hashes()
    return [
        file
        for file, sha in stored["provenance"]["inputs_sha256"].items()
        if sha != now.get(file)
        and (file in now or not (DATA / file).is_file() or sha != sha256(DATA / file))
    ]


def same_sources(name: str, stored: dict[str, Any]) -> bool:
    """Whether the sources say what those said which made the result, or reproduced it last."""
    return bool(
        stored["provenance"].get("sources", {}).get("sha256")
        == sources_sha256(STUDIES / CHECKS[name][0])
    )


def differences(name: str, stored: dict[str, Any]) -> list[str]:
    """What the spot check finds otherwise than it is stored."""
    return [
        f"{what}: {found:.6g}, stored {was:.6g}"
        for what, found, was in CHECKS[name][1](stored)
        if not abs(found - was) <= REPEATS * abs(was)
    ]


def main() -> None:
    """Checks every stored result whose sources are others now, and notes that they give the same
    numbers."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    stale = False
    for name, (script, _) in CHECKS.items():
        stored = read(name)
        # What a section of the page calls missing is what it cannot tell.
        lacks = () if name in LONG else stored.get("missing", ())
        wrong = [
            *(f"it lacks something: {why}" for why in lacks),
            *(f"{file} is another" for file in changed_files(name, stored)),
        ]
        if not wrong and same_sources(name, stored):
            print(f"{name}.json: {stored['provenance']['sources']['numbers']}")
        elif wrong := wrong or differences(name, stored):
            stale = True
            print(f"{name}.json is stale, run studies/{script} again: {'; '.join(wrong)}")
        else:
            stored["provenance"]["sources"] = {
                "sha256": sources_sha256(STUDIES / script),
                "numbers": CHECKED,
            }
            write_json(file_of(name), stored, sort=name not in LONG)
            print(f"{name}.json: {CHECKED}")
    sys.exit(stale)


if __name__ == "__main__":
    main()
