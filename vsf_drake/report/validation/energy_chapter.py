"""The report's chapter on energy storage and return: a function of the saved section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsf_drake.report.page import Bullets, Chapter, Column, Grid, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.energy_figures import (
    WORDS,
    energy_ledger_figure,
    energy_position_figure,
    energy_power_figure,
    energy_stance_figure,
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


# Tables of the chapter on energy.


_LABEL = Column(key="label", heading="trial")
_FULCRUM = Column(key="fulcrum_mm", heading="fulcrum (mm)", form="{:g}")


def conditions_grid(table: Mapping[str, Any]) -> Grid:
    """Means and SD by fulcrum position."""
    shown = (("stored_j", "stored (J)", "{:.2f}", 1.0), ("keel_stored_j", "keel alone (J)", "{:.2f}", 1.0),
             ("returned_j", "returned (J)", "{:.2f}", 1.0), ("return_ratio", "return ratio (%)", "{:.1f}", 100.0),
             ("efficiency", "efficiency (%)", "{:.1f}", 100.0), ("lost_j", "lost in the foot (J)", "{:.2f}", 1.0),
             ("distal_peak_w", "peak distal power (W)", "{:.0f}", 1.0))
    columns = [_FULCRUM, Column(key="n", heading="stances", form="{:g}")]
    for key, heading, form, scale in shown:
        columns += [Column(key=key, heading=heading, form=form, scale=scale),
                    Column(key=f"{key}_sd", heading="SD", form=form, scale=scale)]
    return Grid(name="energy_conditions", columns=columns, rows=table["conditions"],
                caption="Energy of a stance by fulcrum position: mean over the stances and sample standard deviation "
                        "(none with one stance). All of it is simulated.")


def trials_grid(table: Mapping[str, Any]) -> Grid:
    """A row a stance."""
    return Grid(name="energy_trials", rows=table["trials"], columns=(
        _LABEL, Column(key="stance", heading="stance", form="{:g}"), _FULCRUM,
        Column(key="stored_j", heading="stored (J)", form="{:.2f}"),
        Column(key="stored_at_percent", heading="at (% stance)", form="{:.0f}"),
        Column(key="keel_at_most_j", heading="of it keel (J)", form="{:.2f}"),
        Column(key="fulcrum_at_most_j", heading="support (J)", form="{:.2f}"),
        Column(key="foam_at_most_j", heading="foam (J)", form="{:.2f}"),
        Column(key="returned_j", heading="returned (J)", form="{:.2f}"),
        Column(key="return_ratio", heading="return ratio (%)", form="{:.1f}", scale=100.0),
        Column(key="lost_j", heading="lost in the foot (J)", form="{:.2f}"),
        Column(key="distal_peak_w", heading="peak distal power (W)", form="{:.0f}"),
        Column(key="bench_j", heading="bench F²/2k (J)", form="{:.1f}")),
        caption="Energy by stance. Bench F²/2k: what the model would store in the testing machine, load at its load "
                "point and across the keel, at this stance's largest late vertical force; see the notes below.")


def moved_grid(table: Mapping[str, Any], key: str) -> Grid:
    """Every trial at every position, the load (`same_load`) or the motion (`same_motion`) kept."""
    kept = key == "same_load"
    columns = [_LABEL, _FULCRUM, Column(key="stored_j", heading="stored (J)", form="{:.2f}"),
               Column(key="returned_j", heading="returned (J)", form="{:.2f}"),
               Column(key="return_ratio", heading="return ratio (%)", form="{:.1f}", scale=100.0),
               Column(key="friction_loss_j", heading="friction (J)", form="{:.2f}"),
               Column(key="late_load_n", heading="late peak force (N)", form="{:.0f}"),
               Column(key="remainder_share", heading="remainder (% stored)", form="{:.2f}", scale=100.0)]
    if kept:
        columns += [Column(key="off_bw", heading="load off by (% BW)", form="{:.2f}", scale=100.0),
                    Column(key="height_mm", heading="pelvis moved by (mm)", form="{:.1f}")]
    what = ("Each trial's vertical force with the fulcrum elsewhere. Off by: root mean square over stance of what the "
            "force differs by from that at the trial's own position. Only the pelvis' height is changed, not the "
            "angles, which makes the foot slide more where it moves much." if kept else
            "Each trial's motion with the fulcrum elsewhere: the load is what the same motion then gives.")
    return Grid(name=f"energy_{key}", columns=columns, rows=table[key],
                caption=f"{what} In steps of {1e3 * table['moved_step_s']:g} ms.")


def ledger_grid(table: Mapping[str, Any]) -> Grid:
    """The ledger's terms at toe-off."""
    form = {"remainder": "{:.4f}"}
    columns = [_LABEL, *(Column(key=f"{name}_j", heading=f"{text} (J)", form=form.get(name, "{:.2f}"))
                         for name, text in WORDS.items())]
    columns.append(Column(key="remainder_share", heading="largest remainder (% stored)", form="{:.3f}", scale=100.0))
    return Grid(name="energy_ledger", columns=columns, rows=table["trials"],
                caption="The ledger from touch-down to toe-off: the first column is the sum of the others up to the "
                        "remainder. The last is the largest remainder at any instant of stance over stored energy. In "
                        f"steps of {1e3 * table['step_s']:g} ms.")


def convergence_grid(table: Mapping[str, Any]) -> Grid:
    """What twice the step changes."""
    return Grid(name="energy_convergence", rows=table["convergence"], columns=(
        _LABEL, _FULCRUM, Column(key="remainder_max_j", heading="remainder (J)", form="{:.4f}"),
        Column(key="coarse_remainder_max_j", heading="with twice the step (J)", form="{:.4f}"),
        Column(key="remainder_ratio", heading="ratio", form="{:.2f}"),
        Column(key="stored_j_change", heading="stored changes by (J)", form="{:+.4f}"),
        Column(key="returned_j_change", heading="returned (J)", form="{:+.4f}"),
        Column(key="lost_j_change", heading="lost (J)", form="{:+.4f}")),
        caption=f"What steps of {1e3 * table['coarse_step_s']:g} ms change against {1e3 * table['step_s']:g} ms. A "
                "first-order method's remainder doubles.")


# Sentences of the chapter on energy, made of its table.


def finding(table: Mapping[str, Any]) -> str:
    """What it comes to."""
    conditions = table["conditions"]
    if not conditions:
        return "No trial has a whole stance: there is no energy to tell of."
    parts = [f"{c['stored_j']:.1f} J and returns {c['returned_j']:.1f} J with the fulcrum at {c['fulcrum_mm']:g} mm"
             for c in conditions]
    share = table["ledger_remainder_share_max"]
    closes = "" if share is None else (
        f" In steps of {1e3 * table['step_s']:g} ms the energy ledger closes within {100.0 * share:.2g} % of the "
        f"stored energy in the worst {_of(len(table['trials']))} (asked: {100.0 * table['asked_share']:g} %).")
    origin = " The walks follow SYNTHETIC motion." if table["synthetic"] else ""
    return f"In the mean of its stances the model's foot stores {_listed(parts)}.{closes}{origin}"


def softer(table: Mapping[str, Any]) -> str:
    """The verdict on the settings, and why the same motion is no fair comparison."""
    judged = table["softer"]
    found = [
        _verdict("As recorded, each trial at its own position,", [judged[key]["recorded"] for key in _KEYS]),
        _verdict("Under the same load, in every trial walked at all positions,",
                 [judged[key]["same_load"] for key in _KEYS],
                 against=sorted({label for key in _KEYS for label in judged[key]["same_load_against"]}))]
    motion = [judged[key]["same_motion"] for key in _KEYS]
    if motion[0] is not None:
        reverse = "the opposite holds" if not any(motion) else "the answer need not be the same"
        found.append(
            f"With the same motion {reverse}, as it must for a spring that is pressed by a given path: it stores k "
            "x²/2, more if it is stiffer, where one that carries a given load stores F²/2k, less if it is stiffer. The "
            f"vertical force then becomes up to {_largest(table):.0f} N. Nobody would walk so; the comparison that "
            "answers for a person is that of the load, or of trials that were recorded on each setting.")
    return " ".join(found)


def closing(table: Mapping[str, Any]) -> str:
    """How well the ledger closes and where the remainder comes from."""
    share = table["ledger_remainder_share_max"]
    if share is None:
        return "No share can be given: nothing was stored."
    rows = table["trials"]
    largest = 1e3 * max(row["remainder_max_j"] for row in rows)
    ratios = [row["remainder_ratio"] for row in table["convergence"] if row["remainder_ratio"] is not None]
    falls = "" if not ratios else (
        f" With twice the step it is {_range(ratios, 2)} times as large: it is the steps' error, "
        "not a term that was forgotten.")
    phases = {name: _mean([1e3 * row["remainder_by_phase_j"][name] for row in rows])
              for name in rows[0]["remainder_by_phase_j"]}
    where = (f" In the mean of the stances {phases['loading']:+.1f} mJ of it come in the first 15 % of stance, "
             f"{phases['middle']:+.1f} mJ up to 75 % and {phases['push_off']:+.1f} mJ in push-off (negative: gained)")
    if _push_off_leads(phases):
        where += ": it is not the heel's impact but the springs' release that costs most"
    kept = table.get("result_remainder_share_max")
    whole = "" if kept is None else (
        f" The whole person's ledger that is kept with each walk, in steps of {1e3 * table['result_step_s']:g} ms, "
        f"leaves up to {100.0 * kept:.1f} % of what the foot stores over the same stances.")
    met = "closes" if share <= table["asked_share"] else "does NOT close"
    return (f"It {met} within the {100.0 * table['asked_share']:g} % that is asked: the largest remainder at any "
            f"instant of a stance is {largest:.1f} mJ, {100.0 * share:.2g} % of what that foot stores at worst, with "
            f"steps of {1e3 * table['step_s']:g} ms.{falls}{where}.{whole}")


def checks(table: Mapping[str, Any]) -> list[str]:
    """The second methods, a sentence each."""
    rows, found = table["trials"], []
    if table["balance_share_max"] is not None:
        found.append(
            "The limb's work from the wrench of the ground and the rate of the prosthesis' momentum, without the "
            f"bushing's law, is off from the ledger's by at most {100.0 * table['balance_share_max']:.2g} % of the "
            "stored energy at any instant.")
    if table["distal_share_max"] is not None:
        found.append(
            "The distal segment power of the pylon, integrated, differs from strain and losses of the foot by at most "
            f"{100.0 * table['distal_share_max']:.2g} % of the stored energy at any instant. It knows neither keel nor "
            "foam, and neglects the mass of the keel.")
    beams = [row["bent_at_most_j"] / row["beam_j"] for row in rows if row["beam_j"]]
    if beams:
        found.append(
            "Keel and support at the largest strain hold "
            f"{_range(beams, 2)} times the F²/2k of the closed form of a chain of sprung joints on its "
            "support, with the load across the keel and the place where it acts at that instant.")
    benches = [row["stored_j"] / row["bench_j"] for row in rows if row["bench_j"]]
    if benches:
        loads, places = ([row[key] for row in rows if row[key] is not None]
                         for key in ("keel_load_n", "keel_load_point_mm"))
        forces, strains = ([row[key] for row in rows] for key in ("late_load_at_percent", "stored_at_percent"))
        found.append(
            f"The bench's F²/2k is another load case: a stance stores {_range(benches, 2)} times that. At the largest "
            f"strain {_range(loads, 0)} N act across the keel, {_range(places, 0)} mm from its posterior end; the "
            f"testing machine's load acts at {table['load_point_mm']:g} mm. The largest late vertical force, at "
            f"{_range(forces, 0)} % of stance, and the largest strain, at {_range(strains, 0)} %, are not at the "
            "same time either.")
    return found


def stance_alt(table: Mapping[str, Any]) -> str:
    """What the figure over stance shows."""
    parts = []
    for c in table["conditions"]:
        row = next(row for row in table["trials"] if row["fulcrum_mm"] == c["fulcrum_mm"])
        parts.append(f"fulcrum {c['fulcrum_mm']:g} mm {row['stored_j']:.1f} J at {row['stored_at_percent']:.0f} % of "
                     f"stance, of which keel {row['keel_at_most_j']:.1f}, support {row['fulcrum_at_most_j']:.1f} and "
                     f"foam {row['foam_at_most_j']:.1f} J, {row['lost_j']:.1f} J lost until toe-off")
    return f"Energy in the foot rises to its largest in late stance and is gone at toe-off: {'; '.join(parts)}."


def position_alt(table: Mapping[str, Any]) -> str:
    """What the figure over fulcrum positions shows."""
    parts = []
    for key, name in (("conditions", "as recorded"), ("same_load", "under the same load"),
                      ("same_motion", "with the same motion")):
        places = sorted({row["fulcrum_mm"] for row in table[key]})
        if len(places) > 1:
            ends = [_mean([row["stored_j"] for row in table[key] if row["fulcrum_mm"] == x])
                    for x in (places[0], places[-1])]
            parts.append(f"{name} {ends[0]:.1f} J stored at {places[0]:g} mm and {ends[1]:.1f} J at {places[-1]:g} mm")
    return f"Stored energy in the mean of the trials: {'; '.join(parts)}. Returned energy runs below it, likewise."


def ledger_alt(table: Mapping[str, Any]) -> str:
    """What the figure of the ledger shows."""
    row, share = table["trials"][0], table["ledger_remainder_share_max"]
    worst = "" if share is None else (f" Over all stances it is at most {100.0 * share:.2g} % of the stored energy, in "
                                      f"steps of {1e3 * table['step_s']:g} ms.")
    lost = sum(row[f"{name}_j"] for name in table["terms"] if name.endswith("_loss"))
    return (f"Of {row['limb_work_j']:.2f} J that the limb puts into the prosthesis of {row['label']} during stance, "
            f"{row['kinetic_j']:.2f} J are kinetic, {row['gravity_j']:.2f} J in height and {lost:.2f} J lost; "
            f"{row['remainder_j']:.4f} J remain.{worst}")


def power_alt(table: Mapping[str, Any]) -> str:
    """What the figure of the power shows."""
    parts = [f"{c['distal_lowest_w']:.0f} and {c['distal_peak_w']:.0f} W at {c['fulcrum_mm']:g} mm"
             for c in table["conditions"]]
    return ("Power of the foot on the pylon is negative while it is loaded and positive in push-off; lowest and "
            f"highest in the mean: {'; '.join(parts)}.")


_KEYS = ("stored_j", "returned_j")


def _of(stances: int) -> str:
    return "of one stance" if stances == 1 else f"of {stances} stances"


def _verdict(how: str, found: Sequence[bool | None], against: Sequence[str] = ()) -> str:
    stores, returns = found
    if stores is None or returns is None:
        return f"{how} there are not two settings to compare."
    if stores and returns:
        return f"{how} the softer setting stores and returns more at every step of the fulcrum."
    trials = f" (not in {', '.join(against)})" if against else ""
    if not stores and not returns:
        return f"{how} the softer setting does NOT always store more, nor return more{trials}."
    does, fails = ("stores", "return") if stores else ("returns", "store")
    return f"{how} the softer setting {does} more, but does NOT always {fails} more{trials}."


def _push_off_leads(phases: Mapping[str, float]) -> bool:
    return abs(phases["push_off"]) > max(abs(phases["loading"]), abs(phases["middle"]))


def _largest(table: Mapping[str, Any]) -> float:
    return max(float(row["late_load_n"]) for row in table["same_motion"])


def _mean(values: Sequence[float]) -> float:
    return float(sum(values) / len(values))


def _range(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return low if low == high else f"{low} to {high}"


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
