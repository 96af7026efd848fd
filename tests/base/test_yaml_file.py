"""YAML of anybody: what is too much or means two things is refused with file and line."""

from __future__ import annotations

import time

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from vsf_drake.base.errors import UNPRINTABLE, InputError
from vsf_drake.base.schema import dump_yaml, load_plain, load_yaml
from vsf_drake.base.yaml_file import MOST_BYTES, MOST_NODES, dump
from vsf_drake.model.parameters import Subject
from vsf_drake.motion.manifest import load_manifest

LAUGHS = "a0: &a0 [x, x]\n" + "".join(
    f"a{i + 1}: &a{i + 1} [*a{i}, *a{i}, *a{i}]\n" for i in range(25)
)
HARMFUL = {
    "nested aliases": LAUGHS,
    "alias of itself": "&a {x: *a}",
    "alias of a list in itself": "a: &a [1, *a]",
    "brackets": "[" * 2000,
    "braces": "{a: " * 2000,
    "dashes": "- " * 2000,
    "question marks": "? " * 2000,
    "2 MB": "a: 1\n" * 400_000,
    "values": "[" + "1," * (MOST_NODES + 1) + "]",
    "alias of much, often": f"a: &a [{'1,' * 1000}]\nb: [{'*a,' * 100}]",
    "unknown alias": "a: *b",
    "a list as key": "? [a]\n: 1",
    "beyond Unicode": '"\\UFFFFFFFF"',
    "version": f"%YAML 1.{'9' * 5000}\n---\na: 1",
    "control characters": "\0",
    "escaped control characters": 'name: "\\e[31m"',
    "half a character": 'name: "\\ud800"',
    "two documents": "a: 1\n---\na: 2",
}


@pytest.mark.parametrize("harm", HARMFUL)
def test_no_yaml_harms(tmp_path, harm):
    path = tmp_path / "result.yaml"
    path.write_text(HARMFUL[harm], encoding="utf-8")
    start = time.perf_counter()
    with pytest.raises(InputError, match=r"result\.yaml: (?!.*unknown key)"):
        load_yaml(path, Subject)
    # about one second by itself; it was minutes, or without an end
    assert time.perf_counter() - start < 20.0


NO_NUMBERS = [
    "!!int ''",
    "!!int x",
    "!!int 1.5",
    "!!float ''",
    "!!float x",
    "!!bool x",
    "!!bool ''",
    "!!null x",
    "!!timestamp x",
    "!!timestamp 2026-11-22",
    "!!binary é",
    "!!set {a}",
    "!!omap [a: 1]",
    "!!python/object:os.system 7",
    "!!python/object/apply:os.system [true]",
    "!x 7",
    "9" * 400,
    "9" * 5000,
    "1e999",
    ".nan",
    "null",
    "070",
    "0_70",
    "1:18",
    "1:18:00",
    "1_000",
    "0x1F",
    "0o17",
    "0b1",
    "2026-11-22",
    "yes",
    "on",
    "true",
    "７０",
    "[70]",
]


def test_decimal_numbers_are_read_and_what_is_none_is_refused_with_its_line(tmp_path):
    path, rest = tmp_path / "subject.yaml", "stature_m: 1.8\nsex: male\nprosthetic_side: left\n"
    for text in ("70", "70.", "+7e1", "7.0E+1", ".7e2", "'70'", "!!float 70", "070.0"):
        path.write_text(f"{rest}mass_kg: {text}\n", encoding="utf-8")
        assert load_yaml(path, Subject).mass_kg == 70.0, text
    for text in NO_NUMBERS:
        for content in (f"{rest}mass_kg: {text}", f"# two lines\n{{mass_kg: {text}}}"):
            path.write_text(content, encoding="utf-8")
            with pytest.raises(InputError, match=r"subject\.yaml: line \d.*mass_kg"):
                load_yaml(path, Subject)


def test_truth_is_true_or_false(tmp_path):
    path = tmp_path / "walk.yaml"
    for word in ("yes", "no", "on", "Off", "1"):
        path.write_text(
            f"subject: a\nprosthesis: {{fulcrum_mm: 66}}\nsynthetic: {word}", encoding="utf-8"
        )
        with pytest.raises(
            InputError, match=r"line 3, synthetic: .* is not a true or false\. Write true or false"
        ):
            load_manifest(path)


@pytest.mark.parametrize("text", ["a:\t1", "a: [\t1]", "{\n\ta: 1}", "a: x\ty", "a\t: 1"])
def test_tabs_are_refused_whatever_takes_the_text_apart(tmp_path, text):
    path = tmp_path / "values.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"line \d: is not valid YAML \(found character '\\t'"):
        load_plain(path)


TEXTS = [
    "070",
    "1:18",
    "1_000",
    "0x1F",
    "0o17",
    "1e5",
    "1e+5",
    ".5",
    ".inf",
    "-.INF",
    ".NaN",
    "yes",
    "NO",
    "true",
    "null",
    "~",
    "",
    "2026-11-22",
    "2026-11-22T10:00:00Z",
    "=",
    "<<",
    "!x",
    "&a",
    "*a",
    "- a",
    "a: b",
    "a\nb",
    "# a",
    "70",
]


def test_a_text_that_looks_like_something_else_comes_back_as_the_text(tmp_path):
    path = tmp_path / "subject.yaml"
    for name in TEXTS:
        subject = Subject(
            name=name, mass_kg=80.0, stature_m=1.8, sex="male", prosthetic_side="left"
        )
        path.write_text(dump_yaml(subject), encoding="utf-8")
        assert load_yaml(path, Subject) == subject
        assert yaml.safe_load(dump_yaml(subject))["name"] == name  # other programs read YAML 1.1


@given(
    st.recursive(
        st.none()
        | st.booleans()
        | st.integers(-(10**60), 10**60)
        | st.floats(allow_nan=False)
        | st.sampled_from(TEXTS)
        | st.text().filter(lambda text: not UNPRINTABLE.search(text)),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(st.sampled_from([*TEXTS, "key"]), inner, max_size=4)
        ),
        max_leaves=8,
    )
)
def test_whatever_is_dumped_comes_back(tmp_path_factory, values):
    path = tmp_path_factory.getbasetemp() / "values.yaml"
    path.write_text(dump({"values": [values, values]}), encoding="utf-8", newline="")
    assert load_plain(path) == {"values": [values, values]}


@pytest.mark.parametrize(
    "text",
    [
        "a:\n" + " x\n" * (MOST_BYTES // 4),
        "a:" + " x" * (MOST_BYTES // 3),
        "#\n" * (MOST_BYTES // 2),
    ],
    ids=["lines", "words", "comments"],
)
def test_what_pyyaml_is_slowest_at_takes_seconds(tmp_path, text):
    path = tmp_path / "long.yaml"
    path.write_text(text, encoding="utf-8")
    start = time.perf_counter()
    load_plain(path)
    assert time.perf_counter() - start < 20.0


@pytest.mark.parametrize(
    "made", [lambda path: path.mkdir(), lambda path: path.symlink_to("/dev/zero")]
)
def test_only_ordinary_files_are_read(tmp_path, made):
    made(tmp_path / "subject.yaml")
    with pytest.raises(InputError, match=r"is a folder|is no ordinary file"):
        load_yaml(tmp_path / "subject.yaml", Subject)
