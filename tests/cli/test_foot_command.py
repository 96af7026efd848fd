"""`vsf-drake foot`: what it leaves, and how it refuses."""

from __future__ import annotations

import pytest
import yaml

from vsf_drake.model.model_file import load_model
from vsf_drake.report.fitted_foot import _FIRST

SIZE = ("--length-mm", 270, "--mass-g", 600)


@pytest.fixture
def curves(tmp_path):
    lines = ["part,displacement_mm,load_n"]
    lines += [f"forefoot,{x},{25.0 * x}" for x in range(33)]
    lines += [f"heel,{x},{70.0 * x}" for x in range(13)]
    path = tmp_path / "curves.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_model_and_picture_are_written_and_it_is_said_what_the_curves_do_not_tell(
    run, curves, tmp_path
):
    out = tmp_path / "myfoot.yaml"
    code, said, _ = run("foot", curves, *SIZE, "--out", out)
    assert code == 0
    assert "The curves do not tell:" in said and "keel clamped at" in said
    foot = load_model(out).foot
    assert foot.length_m == pytest.approx(0.27) and foot.mass_kg == pytest.approx(0.6)
    assert foot.fulcrum.rearmost_m == foot.fulcrum.foremost_m
    clamp_m = foot.fulcrum.rearmost_m
    assert f"Its keel is clamped {1e3 * clamp_m:.1f} mm from the keel's rear end" in said
    written = yaml.safe_load(out.read_text(encoding="utf-8"))["foot"]
    assert written["clamp_m"] == clamp_m and "rearmost_m" not in written["fulcrum"]
    assert out.read_text(encoding="utf-8").startswith(_FIRST)
    assert (tmp_path / "myfoot.png").read_bytes().startswith(b"\x89PNG")
    assert run("foot", "--forefoot-n-per-mm", 30, *SIZE, "--out", out)[0] == 0  # its own file


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*SIZE,), "--forefoot-n-per-mm: is missing"),
        (("CURVES", "--forefoot-n-per-mm", 30, *SIZE), "cannot go with a file of curves"),
        (("CURVES", "--heel-n-per-mm", 60, *SIZE), "--heel-n-per-mm: cannot go with a file of"),
        (("CURVES", "--load-n", 800, *SIZE), "--load-n: cannot go with a file of curves"),
        (("--forefoot-n-per-mm", 30, "--load-n", 0, *SIZE), "--load-n: 0 N is no load"),
        (("CURVES", "--mass-g", 600), "--length-mm: is missing"),
        (("CURVES", "--length-mm", 270), "--mass-g: is missing"),
        (("CURVES", "--length-mm", 27, "--mass-g", 600), "mm. Is it in centimetres?"),
        (("CURVES", "--length-mm", 270, "--mass-g", 0.6), "to 3000 g. Is it in kilograms"),
        (("CURVES", *SIZE, "--keel-mm", 200), "--keel-mm: a keel of 200 mm does not go with"),
        (("--forefoot-n-per-mm", 3000, *SIZE), "--forefoot-n-per-mm: 3000 N/mm is no foot's"),
        (("none.csv", *SIZE), "none.csv: there is no such file"),
    ],
)
def test_mistakes_end_with_one_message_and_leave_no_file(run, curves, tmp_path, words, message):
    out = tmp_path / "out.yaml"
    words = [curves if word == "CURVES" else word for word in words]
    code, _, error = run("foot", *words, "--out", out)
    assert code == 2 and message in error and "Traceback" not in error
    assert not out.exists()


def test_a_foot_ten_times_as_stiff_as_published_ones_is_made_and_its_units_doubted(run, tmp_path):
    out = tmp_path / "foot.yaml"
    words = ("--forefoot-n-per-mm", 280, "--heel-n-per-mm", 60, *SIZE, "--out", out)
    code, said, _ = run("foot", *words)
    assert code == 0 and said.count("Are the units right?") == 1
    assert "Doubtful: forefoot at 0° has 280 N/mm" in said and "10 to 76." in said
    assert "# Doubtful: forefoot" in out.read_text(encoding="utf-8")


def test_a_file_of_somebody_else_s_is_not_written_over(run, curves, tmp_path):
    out = tmp_path / "own.yaml"
    out.write_text("foot: {}\n", encoding="utf-8")
    code, _, error = run("foot", curves, *SIZE, "--out", out)
    assert code == 2 and "was not written by this command" in error
    assert out.read_text(encoding="utf-8") == "foot: {}\n"
    picture = tmp_path / "holiday.png"
    picture.write_bytes(b"mine")
    code, _, error = run("foot", curves, *SIZE, "--out", tmp_path / "holiday.yaml")
    assert code == 2 and "holiday.png" in error and "was not written by this command" in error
    assert picture.read_bytes() == b"mine" and not (tmp_path / "holiday.yaml").exists()
    assert "ends in .yaml" in run("foot", curves, *SIZE, "--out", tmp_path / "folder")[2]
