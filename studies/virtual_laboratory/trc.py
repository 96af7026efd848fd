"""Markers written as TRC, the text format of Motion Analysis and OpenSim; the product only reads
it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vsf_drake.base.files import replaced
from vsf_drake.motion.formats.recording import Recording, world_to_os


def write_trc(
    path: str | Path,
    markers: Recording | Mapping[str, np.ndarray],
    *,
    rate_hz: float | None = None,
    start_s: float = 0.0,
    unit: str = "m",
) -> None:
    """Writes markers to a TRC file in OpenSim's frame, in full precision; an existing file is
    replaced at the end.

    Args:
        markers: a recording, or (frames, 3) m in W by label; gaps (NaN) become blank cells.
        rate_hz, start_s: frames per second and time of the first frame, where no recording tells
            them.
        unit: "m", which reads back exactly, or "mm".

    Raises:
        ValueError: no markers, shapes that differ, no rate, a label that is empty or holds a tab,
            another unit.
    """
    if isinstance(markers, Recording):
        rate_hz, start_s, markers = (
            rate_hz or markers.marker_rate_hz,
            markers.marker_start_s,
            markers.markers,
        )
    if unit not in ("m", "mm"):
        raise ValueError(f"unit must be m or mm, not {unit!r}")
    if not markers or not rate_hz:
        raise ValueError("there are no markers, or no rate")
    if any(not label.strip() or set(label) & set("\t\r\n") for label in markers):
        raise ValueError("every marker needs a label, without tabs")
    places = [world_to_os(place) * (1.0 if unit == "m" else 1e3) for place in markers.values()]
    frames = len(places[0])
    if any(place.shape != (frames, 3) for place in places):
        raise ValueError("every marker must be (frames, 3)")
    labels, rate = "\t\t\t".join(markers), repr(float(rate_hz))
    axes = "\t".join(f"{axis}{k}" for k in range(1, len(places) + 1) for axis in "XYZ")
    with replaced(path, "w") as stream:
        stream.write(
            f"PathFileType\t4\t(X/Y/Z)\t{Path(path).name}\n"
            "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
            "OrigNumFrames\n"
            f"{rate}\t{rate}\t{frames}\t{len(places)}\t{unit}\t{rate}\t1\t{frames}\n"
            f"Frame#\tTime\t{labels}\t\t\n\t\t{axes}\n\n"
        )
        for i, row in enumerate(np.concatenate(places, axis=1)):
            cells = ("" if np.isnan(cell) else repr(float(cell)) for cell in row)
            stream.write("\t".join([str(i + 1), repr(float(start_s + i / rate_hz)), *cells]) + "\n")
