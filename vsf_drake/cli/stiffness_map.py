"""`vsf-drake map`: what the foot does over mass, slope and fulcrum; and which fulcrum does what is
wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsf_drake.base.errors import require
from vsf_drake.base.schema import option
from vsf_drake.cli.app import (
    Contact,
    Model,
    Out,
    Seed,
    Workers,
    app,
    model_of,
    path,
    print_text,
    progress,
    say,
)
from vsf_drake.cli.options import Asked, fields_of, flags, from_fields, number_of

if TYPE_CHECKING:
    from vsf_drake.device.stiffness_map import StiffnessMap
    from vsf_drake.model.parameters import ModelParameters

_GRID = "LOW:HIGH:COUNT"


@dataclass(frozen=True, kw_only=True)
class MapAxes:
    """Grids of the map that the command takes, by the names of its axes."""

    mass_kg: str | None = option(
        None,
        "Body masses (kg), or a list: 50,70,90,110. With --target one.",
        flag="--mass",
        metavar=_GRID,
        shown="50:110:5",
    )
    slope_deg: str | None = option(
        None,
        "Slopes (degrees), uphill positive. With --target one.",
        flag="--slope",
        metavar=_GRID,
        shown="-6:6:5",
    )
    fulcrum_mm: str | None = option(
        None,
        "Fulcrum positions from the keel's posterior end, or a list: 66,108 or 12N/mm,16N/mm.",
        metavar=_GRID,
        shown="the reach, 9",
    )
    alignment_deg: str | None = option(
        None,
        "Degrees by which the foot is turned toe up against the pylon.",
        flag="--alignment",
        metavar=_GRID,
        shown="0",
    )
    heel_ratio: str | None = option(
        None,
        "Stiffness of the heel's contact, relative to the model's.",
        flag="--heel",
        metavar=_GRID,
        shown="1",
    )


@app.command("map")
@from_fields
def stiffness_map(
    out: Out = Path("map"),
    *,
    grids: Annotated[Asked, MapAxes],
    target: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help=(
                "Finds the fulcrum position for a target in the map in --out, made first if there "
                "is none: radius (m), eflr, moment_arm (mm), stored, returned (J), stiffness "
                "(N/mm). May be repeated."
            ),
        ),
    ] = None,
    load: Annotated[
        Path | None,
        typer.Option(
            parser=path, help="Load instead of ISO 22675's: CSV with time_s, tilt_deg, force_bw."
        ),
    ] = None,
    model: Model = None,
    contact: Contact = None,
    draws: Annotated[
        int | None,
        typer.Option(
            help="Number of other contacts for the bands of 90 %; 0 for no bands.",
            show_default="40",
            min=0,
        ),
    ] = None,
    seed: Seed = 0,
    workers: Workers = None,
) -> None:
    """Maps stiffness, roll-over, energy and loading of the foot over mass, slope and fulcrum, with
    bands.

    With --target: the fulcrum position for it, an interval, and a check by rolling the foot there;
    or the nearest.
    """
    from vsf_drake.cli.sweep import places_said, values_of
    from vsf_drake.report.results_folder import PAGE
    from vsf_drake.simulation.fulcrum_place import fulcrum_place

    given = {
        name: values_of(grids[name], flags(field)[0])
        for name, field in fields_of(MapAxes).items()
        if name in grids and name != "fulcrum_mm"
    }
    if "fulcrum_mm" in grids:
        device = model_of(model).foot
        given["fulcrum_mm"] = tuple(
            round(1e3 * fulcrum_place(said, device, where="--fulcrum-mm"), 6)
            for said in places_said(grids["fulcrum_mm"])
        )
    wanted = [_target(text) for text in target or ()]
    files = {"--load": load, "--model": model, "--contact": contact}
    make = partial(_made, out, files=files, draws=draws, seed=seed, workers=workers)
    from vsf_drake.report.map_page import MAP, map_rows, read_map

    if not wanted:
        make(given)
        mapped = read_map(out)
        print_text(
            "map",
            t=mapped.table,
            rows=map_rows(mapped),
            place={name: values[len(values) // 2] for name, values in mapped.table.axes.items()},
        )
        say(f"written to {out / PAGE}")
        return
    require("fulcrum_mm" not in given, "is what --target looks for", "--fulcrum-mm", "Leave it out")
    for name, values in given.items():
        require(len(values) == 1, f"has {len(values)} values", name, "Give one with --target")
    if (out / MAP.table).is_file():
        mapped = read_map(out)
        _check_same(mapped, files, out)
        require(
            draws is None or draws == mapped.table.draws,
            f"{draws} is not that of the map in {out}",
            "--draws",
            "Leave it out, or choose another folder",
        )
    else:
        say(f"no map in {out} yet: all of it is made first")
        make({})
        mapped = read_map(out)
    answers = []
    for name, value in wanted:
        answer = mapped.inverse(name, value, **{axis: values[0] for axis, values in given.items()})
        answers.append(
            (
                answer,
                [mapped.rolled(name, **answer.where, fulcrum_mm=mm) for mm in answer.positions_mm],
            )
        )
    print_text("map_answer", answers=answers, draws=mapped.table.draws)
    say(f"asked of the map in {out}: mechanical targets, no prescription")


def _made(
    out: Path,
    given: dict[str, tuple[float, ...]],
    *,
    files: Mapping[str, Path | None],
    draws: int | None,
    seed: int,
    workers: int | None,
) -> None:
    from vsf_drake.device.stiffness_map import iso_22675, load_profile, make_map, standard_axes
    from vsf_drake.device.stiffness_map.make import DRAWS, check_axes
    from vsf_drake.report.map_page import MAP, write_map

    MAP.check(out)
    load = files["--load"]
    own: ModelParameters = model_of(files["--model"], files["--contact"])
    axes = check_axes(standard_axes(own.foot) | given, own.foot)
    stance = iso_22675() if load is None else load_profile(load)
    with progress() as show:
        table, arrays = make_map(
            own,
            axes=axes,
            load=stance,
            draws=DRAWS if draws is None else draws,
            seed=seed,
            workers=workers,
            inputs=_inputs(files),
            progress=show,
        )
        show("writing the page", 0.99)
        write_map(out, table, arrays)


def _inputs(files: Mapping[str, Path | None]) -> dict[str, str]:
    """SHA-256 of the files that were given, by option and name."""
    from vsf_drake.base.files import sha256

    return {f"{option} {file.name}": sha256(file) for option, file in files.items() if file}


def _check_same(mapped: StiffnessMap, files: Mapping[str, Path | None], out: Path) -> None:
    """Raises InputError if the map in `out` was made with another file than one that is given."""
    made = {(name.split()[0], digest) for name, digest in mapped.table.inputs.items()}
    for name, digest in _inputs(files).items():
        option = name.split()[0]
        require(
            (option, digest) in made,
            f"is not what the map in {out} was made with",
            option,
            "Leave it out, or choose another folder",
            file=files[option],
        )


def _target(text: str) -> tuple[str, float]:
    from vsf_drake.device.stiffness_map.cells import ROLLED

    name, _, value = (part.strip() for part in text.partition("="))
    known = [name for name in ROLLED if name != "loading_rate"]
    require(
        name != "loading_rate",
        "is the load's, which is given: no fulcrum changes it",
        f"--target {name}",
    )
    require(name in known, f"{name!r} is no target", "--target", f"There are: {', '.join(known)}")
    return name, number_of(value, f"--target {name}", f"Give {name}=NUMBER")
