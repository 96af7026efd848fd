"""On no page does anything lie over anything, on a desk, on a small screen and on a telephone,
wherever it is scrolled.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import chromium
from made_contact import made_contact
from made_fit import made_fit
from made_map import made_map
from made_session import made_session_table
from made_tuning import made_arrays, made_stride_arrays, made_stride_table, made_table
from page_boxes import SIZES, lying_over

from vsf_drake.base.files import plain, resource
from vsf_drake.device.bench_protocol import bench_protocol
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.trial import load_trial
from vsf_drake.recording.examine import examine
from vsf_drake.report.compare_page import write_comparison
from vsf_drake.report.fit_output import write_fit
from vsf_drake.report.import_outputs import import_page
from vsf_drake.report.map_page import write_map
from vsf_drake.report.predict_page import write_prediction
from vsf_drake.report.protocol_page import write_protocol
from vsf_drake.report.session_page import SESSION
from vsf_drake.report.tuning.chapters import write_tuning
from vsf_drake.simulation.archive import provenance
from vsf_drake.tuning.answered import predict
from vsf_drake.walks.difference import difference_of, side_of
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

WALKS = Path(__file__).resolve().parents[2] / "data/sessions/a/day_1/1p1"
STUCK = """<!doctype html><body><h1>A heading</h1><p style="height:1500px">A text.</p><p>Its end.</p>
<p id="stuck" style="position:sticky;bottom:0;margin:0">A slider.</p></body>"""  # noqa: E501
"""Its last line stays in view, over the text."""


@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_nothing_lies_over_anything_on_any_page(quick_validation, tmp_path):
    mapped = made_map(
        lambda m, s, x: 0.1 + 0.003 * (x - 66.0) + 0 * m, tuple(np.linspace(0.9, 1.1, 19))
    )
    write_map(tmp_path / "map", mapped.table, mapped.arrays)
    write_protocol(tmp_path / "protocol", bench_protocol(ModelParameters(), "iso16955"))
    write_fit(made_fit(), tmp_path / "fit", contact=made_contact())
    write_tuning(tmp_path / "tune", made_table(), made_arrays())
    write_tuning(tmp_path / "tune_free", made_stride_table(), made_stride_arrays())
    walks = [path for path in embedded_trials() if path.stem in ("low_1", "low_2", "high_1")]
    contact = load_contact(embedded_contact())
    found = predict([load_trial(path) for path in walks], contact, fulcrum_m=0.108, step_s=4e-3)
    assert "half_width" in found.arrays, "with its interval"
    write_prediction(tmp_path / "predict", found)
    SESSION.write(tmp_path / "session", plain(made_session_table()))
    walk = examine(load_trial(resource("data/reference_subject/exact/medium_1.yaml")))
    sides = [
        side_of(name, [load_trial(WALKS / f"{name}_{k}.yaml") for k in (1, 2)])
        for name in ("low", "high")
    ]
    write_comparison(tmp_path / "compare", difference_of(*sides), *sides, provenance())
    pages = {
        name: (tmp_path / name / "report.html").read_text(encoding="utf-8")
        for name in "map protocol fit tune tune_free predict compare session".split()
    }
    pages |= {
        "validate": (quick_validation / "report.html").read_text(encoding="utf-8"),
        "validate_appendix": (quick_validation / "appendix.html").read_text(encoding="utf-8"),
        "fit_appendix": (tmp_path / "fit/appendix.html").read_text(encoding="utf-8"),
        "stuck": STUCK,
        "import": import_page([walk], title="A recording", failures={}, replay="replay.html"),
    }
    (tmp_path / "seen").mkdir()
    found = lying_over(pages, tmp_path / "seen")
    assert {of: over for of, over in found.items() if over and of[0] != "stuck"} == {}
    assert all(
        "p#stuck" in pair
        for over in (found["stuck", f"{x} x {y}"] for x, y in SIZES)
        for pair in over
    )
    assert all(found["stuck", f"{x} x {y}"] for x, y in SIZES), (
        "what does lie over something is seen"
    )
