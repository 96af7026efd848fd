"""What is not run again stands on nothing that changed: a digest knows every source, template and
data file that a test reads, and only a whole run that passed is noted."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import checked
import pytest
from contact_fit_study import keeping

LABORATORY = "tests/studies/test_balance.py"
SITE = "tests/docs/test_site.py"
FIT_PAGE = "tests/report/test_fit_output.py"
STUDY = "studies/gait.py"
ROLLED = "tests/validation/test_roll_over_section.py"
BY_ITS_NAME = "tests/studies/test_virtual_laboratory.py"


def test_files_with_slow_tests_are_guarded_as_far_as_asked_but_for_those_with_chance_in_them():
    assert {LABORATORY, SITE, FIT_PAGE} <= set(checked.guarded())
    assert not [name for name in checked.guarded() if name.startswith(checked.ALWAYS)]
    assert all((checked.ROOT / name).exists() for name in checked.ALWAYS)
    here = checked.ROOT / "tests" / "docs"
    assert set(checked.guarded([str(here)])) == {
        name for name in checked.guarded() if name.startswith("tests/docs/")
    }
    assert checked.guarded([f"{checked.ROOT / SITE}::test_one"]) == [SITE]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "knows", "does_not"),
    [
        ("vsf_drake/model/parameters.py", (LABORATORY, SITE, FIT_PAGE, STUDY), ()),
        ("vsf_drake/laws/contact.py", (SITE, STUDY), ()),
        ("studies/virtual_laboratory/closing.py", (LABORATORY, SITE), (FIT_PAGE,)),
        ("vsf_drake/report/templates/fit/story.html.j2", (SITE, FIT_PAGE), (LABORATORY,)),
        ("tests/helpers/browser.py", (FIT_PAGE,), (LABORATORY, STUDY)),
        ("tests/conftest.py", (LABORATORY, FIT_PAGE), (STUDY,)),
        ("models/nominal.yaml", (LABORATORY, SITE, FIT_PAGE, STUDY), ()),
        ("docs/frames.md", (SITE,), (LABORATORY, FIT_PAGE, STUDY)),
        ("README.md", (SITE,), (LABORATORY, FIT_PAGE, STUDY)),
        ("docs/guide/stiffness_map.md", (ROLLED, SITE), (LABORATORY,)),
        ("studies/floor_of_the_reference_subject.py", (BY_ITS_NAME,), (LABORATORY,)),
    ],
)
def test_another_source_template_or_data_file_makes_another_digest_where_it_is_read(
    monkeypatch, changed, knows, does_not
):
    before = checked.digests((*knows, *does_not))
    path, said, read = checked.ROOT / changed, keeping.meaning, checked.of_bytes

    def meaning(file: Path, roots: tuple[Path, ...]) -> tuple[str, set[Path]]:
        digest, imported = said(file, roots)
        return "another" if file == path else digest, imported

    monkeypatch.setattr(keeping, "meaning", meaning)
    monkeypatch.setattr(checked, "of_bytes", lambda file: "another" if file == path else read(file))
    now = checked.digests((*knows, *does_not))
    assert {file for file, digest in now.items() if digest != before[file]} == set(knows)


def test_a_name_that_the_package_imports_when_it_is_used_stands_for_the_whole_package(tmp_path):
    def uses(text: str) -> bool:
        source = tmp_path / f"{len(list(tmp_path.iterdir()))}.py"
        source.write_text(text, encoding="utf-8")
        return checked.promised(source)

    assert uses("import vsf_drake as vsf\n") and uses("from vsf_drake import load_trial\n")
    assert uses(
        "def f():\n    from vsf_drake import (\n        files,\n        run_bench,\n    )\n"
    )
    assert not uses("from vsf_drake import errors\nfrom vsf_drake.motion.trial import load_trial\n")


@pytest.mark.parametrize(
    ("spoiled", "noted"),
    [
        ({}, {"tests/a.py": "new", "tests/b.py": "b"}),
        ({"keyword": "stance"}, {}),
        ({"markexpr": "slow and regression"}, {}),
        ({"args_source": pytest.Config.ArgsSource.ARGS}, {}),
        ({"shouldstop": "one failed"}, {}),
    ],
)
def test_only_what_a_whole_run_passed_is_noted(tmp_path, monkeypatch, spoiled, noted):
    """Of three files one failed in one of its tests, and one skipped one."""
    stored = {"tests/test_checked.py": "as it was", "tests/gone.py": "as it was"}
    (tmp_path / "checked.json").write_text(json.dumps(stored), encoding="utf-8")
    monkeypatch.setattr(checked, "STORED", tmp_path / "checked.json")
    run = checked.Passed({"tests/a.py": "new", "tests/b.py": "b", "tests/c.py": "c", "d": "d"})
    for name, passed, keywords in (
        ("tests/a.py::test_one", True, {"slow": 1}),
        ("tests/a.py::test_quick", False, {}),
        ("tests/b.py::test_one", True, {"slow": 1}),
        ("tests/c.py::test_one", True, {"slow": 1}),
        ("tests/c.py::test_two[x]", False, {"slow": 1}),
        ("tests/c.py::test_three", True, {"slow": 1}),
        ("tests/never_guarded.py::test_one", True, {"slow": 1}),
    ):
        run.pytest_runtest_logreport(SimpleNamespace(nodeid=name, passed=passed, keywords=keywords))
    given = {
        "keyword": "",
        "markexpr": "slow",
        "args_source": pytest.Config.ArgsSource.TESTPATHS,
        "shouldstop": False,
    } | spoiled
    session = SimpleNamespace(
        shouldfail=False,
        shouldstop=given["shouldstop"],
        config=SimpleNamespace(args_source=given["args_source"], option=SimpleNamespace(**given)),
    )
    run.pytest_sessionfinish(session)
    kept = {"tests/test_checked.py": "as it was"} if noted else stored
    assert checked.stored() == kept | noted
