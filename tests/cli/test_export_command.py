"""`vsf-drake export`: which files it leaves, from which parameters, and what it refuses."""

from __future__ import annotations

import pytest
import yaml
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.files import resource, sha256
from vsf_drake.model_file import load_model
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.export import foot_mjcf
from vsf_drake.plants.parsed_foot import find_foot
from vsf_drake.schema import from_plain
from vsf_drake.simulation.archive import RECORD_FILE


def test_nominal_foot_leaves_three_models_and_their_sidecar(run, tmp_path):
    code, said, _ = run("export", "--out", tmp_path / "models")
    folder = tmp_path / "models"
    names = ["vsf_foot.sdf", "vsf_foot_at_108mm.sdf", "vsf_foot_at_108mm.xml"]
    assert code == 0
    assert sorted(path.name for path in folder.glob("[!.]*")) == sorted([*names, "export.yaml"])
    assert all(name in said for name in names)
    assert (folder / "vsf_foot.sdf").read_bytes() == resource("models/vsf_foot.sdf").read_bytes()
    sidecar = yaml.safe_load((folder / "export.yaml").read_text(encoding="utf-8"))
    assert sidecar["files_sha256"] == {name: sha256(folder / name) for name in names}
    assert sidecar["fulcrum_m"] == pytest.approx(0.108)
    assert from_plain(FootParameters, sidecar["foot"]) == load_model(resource("models/nominal.yaml")).foot
    assert sidecar["provenance"]["versions"]["vsf-drake"]


def test_model_file_and_position_are_those_of_the_models(run, tmp_path):
    text = resource("models/nominal.yaml").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(text.replace("mass_kg: 0.649", "mass_kg: 0.7"), encoding="utf-8")
    code, *_ = run("export", "--model", tmp_path / "mine.yaml", "--fulcrum-mm", 87.5, "--out", tmp_path / "out")
    assert code == 0
    foot = load_model(tmp_path / "mine.yaml").foot
    written = (tmp_path / "out" / "vsf_foot_at_87.5mm.xml").read_text(encoding="utf-8")
    assert written == foot_mjcf(foot, fulcrum_m=1e-3 * 87.5)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(tmp_path / "out" / "vsf_foot.sdf"))
    assert find_foot(plant, "vsf", foot).parameters.mass_kg == 0.7
    sidecar = yaml.safe_load((tmp_path / "out" / "export.yaml").read_text(encoding="utf-8"))
    assert sidecar["provenance"]["inputs_sha256"] == {"model: mine.yaml": sha256(tmp_path / "mine.yaml")}


def test_one_format_and_no_collision_spheres(run, tmp_path):
    assert run("export", "--format", "sdf", "--no-collision", "--out", tmp_path)[0] == 0
    assert {path.suffix for path in tmp_path.glob("[!.]*")} == {".sdf", ".yaml"}
    assert "<collision" not in (tmp_path / "vsf_foot.sdf").read_text(encoding="utf-8")


@pytest.mark.parametrize(("words", "message"), [
    (["--fulcrum-mm", "200"], "the fulcrum at 200 mm is out of the carriage's reach. It must be between 66 and 151 mm"),
    (["--fulcrum-mm", "nan"], "the fulcrum at nan mm is out of the carriage's reach"),
    (["--format", "mjcf", "--no-springs"], "an MJCF file always has springs and contact spheres"),
    (["--format", "urdf"], "'urdf' is not known. Known are sdf, mjcf, both"),
    (["--model", "nothing.yaml"], "nothing.yaml")])
def test_mistakes_end_with_a_message_and_leave_nothing(run, tmp_path, words, message):
    code, _, error = run("export", "--out", tmp_path / "out", *words)
    assert code == 2
    assert message in error
    assert not (tmp_path / "out").exists()


def test_out_that_is_a_file_is_refused(run, tmp_path):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    code, _, error = run("export", "--out", tmp_path / "out")
    assert code == 2
    assert "is a file, but results are a folder" in error
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


def test_a_folder_of_other_things_is_refused_and_an_earlier_export_replaced(run, tmp_path):
    (tmp_path / "thesis.txt").write_text("mine", encoding="utf-8")
    (tmp_path / "vsf_foot.sdf").write_text("mine", encoding="utf-8")
    code, _, error = run("export", "--out", tmp_path)
    assert code == 2 and "holds other things than an earlier export" in error
    assert (tmp_path / "vsf_foot.sdf").read_text(encoding="utf-8") == "mine"
    out = tmp_path / "out"
    assert run("export", "--out", out)[0] == 0
    assert run("export", "--out", out, "--fulcrum-mm", 80)[0] == 0
    assert not list(out.glob("*108mm*"))
    (out / RECORD_FILE).unlink()
    assert run("export", "--out", out)[0] == 0
