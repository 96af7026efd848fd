"""Which contact runs under which integrator, at what cost, and how far it is from the fitted law.

Five contacts (the paper's law, its smooth variant, Hunt-Crossley, Drake's point contact and
hydroelastic pads) under Drake's Simulator: continuous plants under five integrators, discrete
plants with three time steps. Each drops the same leg, 10 kg on a damped slide, its shank leaning
15 degrees so that the forefoot lands; each presses the same keel with dead loads of 200 and 600 N.
Writes contact_alternatives.md, .csv, .json and the picture.

Found on one core: at 1 ms a discrete plant with Drake's contact is the cheapest that is right.
cenic is right with Drake's contact if its steps are kept to 1 ms, and with the paper's law, under
this leg, if they are kept to 0.1 ms; longer ones it accepts and gets wrong, for of the support's
force it keeps only the diagonal of the gradient.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
from pathlib import Path

import numpy as np
from contact_comparison import REFERENCE, WAYS, Advance, Comparison, Row, compare_contacts
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from vsf_drake.base.files import replaced, resource, write_json
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.foot import CONTACTS
from vsf_drake.report.style import label, log_scale, new_figure, save_figure, style
from vsf_drake.simulation.bench_stiffness import BenchStiffness

QUICK_CONTACTS = ("kelvin_voigt", "drake_point", "hydroelastic")
QUICK_WAYS = tuple(way for way in WAYS if way.name in ("cenic, steps to 1 ms", "discrete 1 ms"))
QUICK_REFERENCE = Advance("discrete 0.1 ms", time_step_s=1e-4)
SETTLED, STIFF = 0.005, 0.02
"""Differences of load from weight, and of stiffness from the bench's, beyond which a row says
so."""
COLOURS = dict(
    zip(CONTACTS, ("0.1", "tab:orange", "tab:green", "tab:blue", "tab:red"), strict=True)
)
COLUMNS = (
    "contact",
    "plant and integrator",
    "runs",
    "wall / simulated (s/s)",
    "settled load / weight (1)",
    "forefoot stiffness (N/mm)",
    "off the bench (%)",
    "peak force (N)",
    "RMS difference (N)",
    "remark",
)


def main(out: Path, quick: bool = False) -> dict[str, float]:
    """Compares, writes table and picture, and returns the numbers of the discrete plant with
    1 ms."""
    foot = load_model(resource("models/nominal.yaml")).foot
    made = compare_contacts(
        foot,
        contacts=QUICK_CONTACTS if quick else CONTACTS,
        ways=QUICK_WAYS if quick else WAYS,
        reference=QUICK_REFERENCE if quick else REFERENCE,
        wall_limit_s=10.0 if quick else 30.0,
        progress=lambda text: print(text, flush=True),
    )
    bench = _bench_stiffness(foot, made.fulcrum_m)
    table = [_cells(row, bench) for row in made.rows]
    _write(out / "contact_alternatives", made, table, bench)
    with style():
        save_figure(_figure(made), out / "contact_alternatives")
    best = {
        row.contact: row
        for row in made.rows
        if row.way == "discrete 1 ms" and row.settled is not None
    }
    return {
        "weight": made.weight_n,
        "bench_stiffness": bench,
        **{
            f"{contact}_{name}": float(getattr(row, name))
            for contact, row in best.items()
            for name in ("settled", "stiffness_n_per_m", "peak_n", "rms_n", "real_time_factor")
        },
    }


def _bench_stiffness(foot: FootParameters, fulcrum_m: float) -> float:
    """Of the implicit stepper's bench (N/m), mean slope from 200 to 600 N."""
    return float(BenchStiffness(foot, fulcrums_m=(fulcrum_m,), heel=False).evaluate({})[0][0])


def _cells(row: Row, bench: float) -> tuple[str, ...]:
    def number(value: float | None, form: str, scale: float = 1.0) -> str:
        return "-" if value is None else format(scale * value, form)

    remarks = [row.note] if row.note else []
    if row.settled is not None and not _comes_to_rest(row):
        remarks.append(f"not on its weight within {100 * SETTLED:g} %")
    off = None if row.stiffness_n_per_m is None else row.stiffness_n_per_m / bench - 1.0
    if off is not None and abs(off) > STIFF:
        remarks.append(f"press not settled or off the bench by more than {100 * STIFF:g} %")
    return (
        row.contact,
        row.way,
        "no" if row.note else "yes",
        number(row.real_time_factor, ".3g"),
        number(row.settled, ".4f"),
        number(row.stiffness_n_per_m, ".3f", 1e-3),
        number(off, "+.2f", 100.0),
        number(row.peak_n, ".0f"),
        number(row.rms_n, ".1f"),
        "; ".join(remarks),
    )


def _write(stem: Path, made: Comparison, table: list[tuple[str, ...]], bench: float) -> None:
    lines = [
        "| " + " | ".join(cells) + " |" for cells in (COLUMNS, ("---",) * len(COLUMNS), *table)
    ]
    text = "\n".join(
        (
            *lines,
            "",
            (
                f"Weight {made.weight_n:.1f} N, fulcrum at {1e3 * made.fulcrum_m:g} mm, bench "
                f"{1e-3 * bench:.3f} N/mm (implicit stepper). RMS difference from kelvin_voigt, "
                f"{made.reference_name}, whose peak is {made.reference_n.max():.0f} N."
            ),
            "",
        )
    )
    print(text)
    with replaced(stem.with_suffix(".md")) as stream:
        stream.write(text)
    with replaced(stem.with_suffix(".csv")) as stream:
        csv.writer(stream, lineterminator="\n").writerows((COLUMNS, *table))
    write_json(
        stem.with_suffix(".json"),
        {
            "weight_n": made.weight_n,
            "fulcrum_m": made.fulcrum_m,
            "bench_n_per_m": bench,
            "reference": made.reference_name,
            "reference_peak_n": float(made.reference_n.max()),
            "rows": [dataclasses.asdict(row) for row in made.rows],
        },
    )


def _comes_to_rest(row: Row) -> bool:
    return row.settled is not None and abs(row.settled - 1.0) <= SETTLED


def _figure(made: Comparison) -> Figure:
    figure = new_figure(9.0, 3.9)
    force, cost = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    force.plot(made.time_s, made.reference_n, color="0.75", linewidth=4.0, label="reference")
    drawn: set[str] = set()
    for row in sorted(made.rows, key=lambda row: row.real_time_factor or np.inf):
        if _comes_to_rest(row) and row.contact not in drawn:
            drawn.add(row.contact)
            force.plot(
                made.time_s,
                made.force_n[row.contact, row.way],
                color=COLOURS[row.contact],
                linewidth=1.0,
                label=f"{row.contact}, {row.way}",
            )
    force.axhline(made.weight_n, color="0.4", linestyle=":", linewidth=0.8)
    force.legend()
    label(
        force,
        x="time (s)",
        y="vertical force (N)",
        title="The drop: each contact by its fastest way to rest",
    )
    for contact in dict.fromkeys(row.contact for row in made.rows):
        cost.plot([], [], "o", color=COLOURS[contact], label=contact)
    figure.legend(
        *cost.get_legend_handles_labels(), loc="outside lower center", ncols=len(CONTACTS)
    )
    ways = list(dict.fromkeys(row.way for row in made.rows))
    for row in made.rows:
        if row.real_time_factor is not None:
            marker = "x" if row.note else "o"
            cost.plot(
                row.real_time_factor,
                ways.index(row.way) + 0.08 * (CONTACTS.index(row.contact) - 2),
                marker,
                color=COLOURS[row.contact],
                fillstyle="full" if _comes_to_rest(row) else "none",
            )
    cost.axvline(1.0, color="0.4", linestyle=":", linewidth=0.8)
    log_scale(cost.xaxis)
    cost.set_yticks(range(len(ways)), ways)
    cost.invert_yaxis()
    cost.xaxis.set_minor_formatter(NullFormatter())
    label(
        cost,
        x="wall time / simulated time (1)",
        y="",
        title="Cost (hollow: wrong rest; cross: too slow)",
    )
    return figure


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick",
        action="store_true",
        help="three contacts, two ways, 10 s of wall time each at most",
    )
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for key, value in main(arguments.out, arguments.quick).items():
        print(f"{key:34s} {value:.6g}")
