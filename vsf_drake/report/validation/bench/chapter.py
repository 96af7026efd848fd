"""The bench chapter of the validation's report: the foot in the testing machine, experiment beside simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vsf_drake.report.pieces import Bullets, Chapter, Heading, Missing, Picture, Piece, Text
from vsf_drake.report.validation.bench.agreement_figure import bench_agreement_figure
from vsf_drake.report.validation.bench.curves_figure import bench_curves_figure
from vsf_drake.report.validation.bench.energy_figure import bench_energy_figure
from vsf_drake.report.validation.bench.load_point_figure import bench_load_point_figure
from vsf_drake.report.validation.bench.sentences import (
    agreement_alt,
    calibration_text,
    coarseness_text,
    curves_alt,
    energy_alt,
    energy_text,
    fit_text,
    heel_text,
    load_point_alt,
    load_point_text,
    result_text,
    shape_alt,
    shape_text,
    source_text,
)
from vsf_drake.report.validation.bench.shape_figure import bench_shape_figure
from vsf_drake.report.validation.bench.tables import (
    comparison_grid,
    load_point_grid,
    rates_grid,
    settings_grid,
    shape_grid,
)

_ERRORS = (" Middle: error of stiffness, with the 95 % confidence band of the regression of simulated on measured "
           "stiffness, less identity. Right: offset of the mid-range displacement.")


def bench_chapter(table: Mapping[str, Any], arrays: Mapping[str, Any]) -> Chapter:
    """The chapter; `table` and `arrays` of the saved bench section."""
    judged = bool(table["n"])
    pieces: list[Piece] = [
        Text(source_text(table)),
        Bullets([text for text in (result_text(table), coarseness_text(table), fit_text(table),
                                   calibration_text(table), heel_text(table)) if text])]
    if table["unconverged_steps"]:
        pieces.append(Missing(f"{table['unconverged_steps']} steps of the simulated bench did not converge: do not "
                              "trust this chapter."))
    if judged:
        pieces.append(comparison_grid(table))
    pieces += [
        Picture(name="bench_curves", figure=bench_curves_figure(table, arrays), alt=curves_alt(table), caption=(
            "Load over displacement. Solid: measured, or the published slope where there is no curve. Dashed: "
            "simulated. Dotted: the nominal model. Band around the measurement, where passes were repeated: 95 % "
            "confidence of their mean. Dotted line across: 200 N, above which stiffness is the mean slope.")),
        settings_grid(table),
        Picture(name="bench_agreement", figure=bench_agreement_figure(table, arrays), alt=agreement_alt(table),
                caption="Left: stiffness by position, filled measured, open simulated." + (_ERRORS if judged else "")),
        Heading("Linear and curvilinear"), Text(shape_text(table)),
        Picture(name="bench_shape", figure=bench_shape_figure(table, arrays), alt=shape_alt(table), caption=(
            "Left: slope of the curves. Right: the curve's largest distance from the straight line between its ends, "
            "along the displacement.")),
        shape_grid(table)]
    if table["rates"]:
        pieces += [
            Heading("Other speeds, and the way back"), Text(energy_text(table)),
            Picture(name="bench_energy", figure=bench_energy_figure(table, arrays), alt=energy_alt(table), caption=(
                "Simulated. Left: loops at the highest speed. Middle: what is lost of the stored energy. Right: energy "
                "stored at 600 N, beside that of a linear spring and, where a curve was measured, its own.")),
            rates_grid(table)]
    if table["load_points"]:
        pieces += [
            Heading("Other points of the load"), Text(load_point_text(table)),
            Picture(name="bench_load_point", figure=bench_load_point_figure(table), alt=load_point_alt(table),
                    caption="Simulated stiffness by load point, beside the closed form of the overhung beam with the "
                            "same compliances of fulcrum and foam."),
            load_point_grid(table)]
    return Chapter(name="bench", title="Bench", pieces=tuple(pieces))
