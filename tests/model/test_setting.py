"""How settings are called: a fulcrum by where it stands, a passive foot by its name."""

from __future__ import annotations

from dataclasses import replace

from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import moves, setting_column, setting_of

NOMINAL = FootParameters()
FIXED = replace(NOMINAL, fulcrum=replace(NOMINAL.fulcrum, rearmost_m=0.1, foremost_m=0.1))
PASSIVE = replace(FIXED, name="category 4")


def test_a_fulcrum_is_called_by_its_place_and_a_passive_foot_by_its_name():
    assert moves(NOMINAL) and not moves(PASSIVE)
    nominal = setting_of(NOMINAL, 0.108)
    passive = setting_of(PASSIVE, 0.1)
    assert (nominal.setting_words, nominal.setting_short) == ("fulcrum 108 mm", "108 mm")
    assert (passive.setting_words, passive.setting_short) == ("foot category 4", "category 4")
    assert setting_of(FIXED, 0.1).setting_short == "passive"


def test_a_column_of_settings_tells_what_all_of_its_feet_have():
    nominal, passive, fixed = (setting_of(foot, 0.108) for foot in (NOMINAL, PASSIVE, FIXED))
    assert setting_column([nominal, nominal]) == ("fulcrum_mm", "fulcrum (mm)", "{:g}")
    assert setting_column([passive, fixed]) == ("foot", "foot")
    assert setting_column([nominal, passive]) == ("setting_words", "setting")
    assert nominal.fulcrum_mm == 108.0 and passive.fulcrum_mm is None


def test_a_passive_foot_without_a_name_has_its_files_and_one_with_a_name_keeps_it(tmp_path):
    feet = {}
    for stem, name in (("soft", ""), ("firm", "category 4"), ("moving", "")):
        ends = "rearmost_m: 0.1, foremost_m: " + ("0.15" if stem == "moving" else "0.1")
        said = f"name: {name}, " if name else ""
        path = tmp_path / f"{stem}.yaml"
        path.write_text(f"foot: {{{said}fulcrum: {{{ends}}}}}", encoding="utf-8")
        feet[stem] = load_model(path).foot.name
    assert feet == {"soft": "soft", "firm": "category 4", "moving": ""}
