"""What files for other engines cannot hold of a foot: told in them, and by `vsf-drake export`."""

from __future__ import annotations

from vsf_drake.base.sentences import text_templates
from vsf_drake.laws.contact_laws import FITTED_LAW
from vsf_drake.model.parameters import FootParameters
from vsf_drake.mujoco import DEPTH_M
from vsf_drake.plants.contact_geometry import MATCHED_DEPTH_M, REFERENCE_LOAD_N


def cannot_hold(
    parameters: FootParameters,
    file_format: str,
    *,
    law: str = FITTED_LAW,
    condensed: bool = False,
) -> dict[str, str]:
    """By parameter, named as in model files, what stands in its place in a file of a format (osim,
    mjcf, sdf): a text with both.

    Only what this foot has counts: an exponent of 1, and a friction of 0, are in every file. `law`
    is the contact law, one of CONTACT_LAWS; `condensed` is of the file of the condensed foot, whose
    stations are fitted to the zones. The table is `engines/templates/limits.txt.j2`.
    """
    text = (
        text_templates("engines/templates")
        .get_template("limits.txt.j2")
        .render(
            foot=parameters,
            format=file_format,
            law=law,
            condensed=condensed,
            load_n=REFERENCE_LOAD_N,
            depth_mm=1e3 * MATCHED_DEPTH_M,
            calibrated_mm=1e3 * DEPTH_M,
        )
    )
    return dict(line.split(": ", 1) for line in text.splitlines())
