"""`vsf-drake foot`: a foot of any make from its bench."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.schema import quantity
from vsf_drake.cli.app import app, path, print_text, say
from vsf_drake.cli.options import from_fields, named_as_options


@dataclass(frozen=True, kw_only=True)
class FootRequest:
    """Size of the foot, and its stiffness where there are no curves."""

    length_mm: float | None = quantity(
        None, unit="mm", source="measured", help="Length of the foot, heel to toe. Needed."
    )
    mass_g: float | None = quantity(
        None, unit="g", source="measured", help="Mass of the foot. Needed."
    )
    keel_mm: float | None = quantity(
        None,
        unit="mm",
        source="measured",
        help="Length of its keel. Default: the nominal foot's share of its length, 93 %.",
    )
    forefoot_n_per_mm: float | None = quantity(
        None,
        unit="N/mm",
        source="measured",
        help="Without curves: load over displacement of the forefoot, at --load-n.",
    )
    heel_n_per_mm: float | None = quantity(
        None,
        unit="N/mm",
        source="measured",
        help="Without curves: load over displacement of the heel, at --load-n.",
    )
    load_n: float | None = quantity(
        None,
        unit="N",
        source="choice",
        help="Without curves: load of the two stiffnesses. Default: 600 N.",
    )


@app.command()
@from_fields
def foot(
    curves: Annotated[
        Path | None,
        typer.Argument(
            parser=path,
            metavar="[CURVES.csv]",
            help="Columns part, displacement_mm, load_n, and where known angle_deg and branch.",
        ),
    ] = None,
    *,
    out: Annotated[
        Path, typer.Option(parser=path, help="Model file to write (YAML); its picture beside it.")
    ],
    asked: FootRequest,
) -> None:
    """Makes a model of a passive foot from force-displacement curves of its forefoot and heel.

    Commands take it by --model. It says which of its values the curves tell, and which they do not.
    """
    from vsf_drake.device.foot_from_curves import curves_of_stiffness, foot_from_curves
    from vsf_drake.report.fitted_foot import check_foot_file, misses, said_of, write_fitted_foot

    require(
        (curves is None) != (asked.forefoot_n_per_mm is None),
        "is missing" if curves is None else "cannot go with a file of curves",
        "--forefoot-n-per-mm",
        "Give a file of curves, or the stiffness of the forefoot and, if known, of the heel",
    )
    for value, flag in ((asked.heel_n_per_mm, "--heel-n-per-mm"), (asked.load_n, "--load-n")):
        require(
            curves is None or value is None,
            "cannot go with a file of curves",
            flag,
            "Give the heel's curve in the file, or the stiffness of forefoot and heel, and the "
            "load that they are of, without a file",
        )
    if asked.length_mm is None or asked.mass_g is None:
        raise InputError(
            "is missing",
            where="--length-mm" if asked.length_mm is None else "--mass-g",
            right="Give the foot's length in mm and its mass in g",
        )
    check_foot_file(out)
    with named_as_options(
        FootRequest,
        length_m="--length-mm",
        mass_kg="--mass-g",
        keel_m="--keel-mm",
        forefoot_n_per_m="--forefoot-n-per-mm",
        heel_n_per_m="--heel-n-per-mm",
    ):
        made = foot_from_curves(
            curves
            if curves is not None
            else curves_of_stiffness(
                forefoot_n_per_m=1e3 * (asked.forefoot_n_per_mm or 0.0),
                heel_n_per_m=None if asked.heel_n_per_mm is None else 1e3 * asked.heel_n_per_mm,
                load_n=600.0 if asked.load_n is None else asked.load_n,
            ),
            length_m=1e-3 * asked.length_mm,
            mass_kg=1e-3 * asked.mass_g,
            keel_m=None if asked.keel_mm is None else 1e-3 * asked.keel_mm,
        )
    picture = write_fitted_foot(made, out)
    print_text("foot", values=made.values, said=said_of(made), misses=misses(made))
    say(f"written to {out}, {picture.name}")
