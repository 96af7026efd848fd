"""Sentences of the chapter on energy, made of its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


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
