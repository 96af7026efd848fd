"""One look: readable in grey, the same everywhere, saved whole or not at all."""

from __future__ import annotations

import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from vsf_drake.errors import InputError
from vsf_drake.report.style import MEASURED, SIMULATED, condition_colour, label, new_figure, save_figure, style


def lightness(colour):
    return float(np.dot(to_rgb(colour), [0.2126, 0.7152, 0.0722]))


def test_settings_keep_their_order_in_grey_print():
    grey = [lightness(condition_colour(p)) for p in (None, 0.066, 0.087, 0.108, 0.129, 0.151)]
    assert np.all(np.diff(grey[1:]) > 0.03)
    assert grey[-1] < 0.6, "the lightest must still stand out from white paper"


def test_measured_is_solid_and_simulated_dashed():
    assert MEASURED["linestyle"] == "-"
    assert SIMULATED["linestyle"] not in ("-", "solid")


def draw():
    with style():
        figure = new_figure(3.0, 2.0)
        axes = figure.subplots()
        axes.plot([0.0, 1.0], [0.0, 2.0])
        label(axes, x="time (s)", y="force (N)")
    return figure


def test_same_figure_gives_the_same_bytes(tmp_path):
    first, second = save_figure(draw(), tmp_path / "a"), save_figure(draw(), tmp_path / "b")
    assert [p.name for p in first] == ["a.png", "a.svg"]
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes()


def test_settings_of_the_user_are_neither_used_nor_changed(tmp_path):
    save_figure(draw(), tmp_path / "before")
    with matplotlib.rc_context({"font.size": 30.0, "lines.linewidth": 9.0}):
        save_figure(draw(), tmp_path / "after")
        assert matplotlib.rcParams["font.size"] == 30.0
    assert (tmp_path / "before.png").read_bytes() == (tmp_path / "after.png").read_bytes()


def test_missing_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        save_figure(draw(), tmp_path / "missing" / "a")


def test_figures_need_neither_pyplot_nor_drake():
    code = ("import sys, vsf_drake.report.figures, vsf_drake.analysis.metrics\n"
            "assert not [m for m in sys.modules if m.startswith(('pydrake', 'matplotlib.pyplot'))], 'imported'")
    subprocess.run([sys.executable, "-c", code], check=True)
