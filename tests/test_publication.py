"""What a release says of itself in several files agrees, and what the wheel lacks nobody asks of
it."""

from __future__ import annotations

import fnmatch
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit
from xml.etree import ElementTree

import yaml

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
CODEMETA = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
FOLDERS = {"vsf_drake", "models", "data", "studies", "tests", "docs"}
FILES = {
    "CHANGELOG.md",
    "CITATION.cff",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "Dockerfile",
    "LICENSE",
    "README.md",
    "SECURITY.md",
    "SUPPORT.md",
    "codemeta.json",
    "pyproject.toml",
}
IGNORED = [
    line.strip("/") for line in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
]


def at_the_root() -> Iterator[Path]:
    """What git would keep, but for its own folder."""
    for path in sorted(ROOT.iterdir()):
        if path.name != ".git" and not any(fnmatch.fnmatch(path.name, one) for one in IGNORED):
            yield path


def texts() -> Iterator[Path]:
    """Files in which somebody may write an address."""
    for top in at_the_root():
        for path in [top] if top.is_file() else top.rglob("*"):
            if path.is_file() and path.suffix not in (".mot", ".trc", ".c3d", ".npz", ".pyc"):
                yield path


def bib() -> dict[str, str]:
    """Entries of the paper's references by their key."""
    text = (ROOT / "docs/paper/paper.bib").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{(\w+),\n(.*?)^\}$", text, flags=re.MULTILINE | re.DOTALL)
    assert len(entries) == len(dict(entries)) == len(re.findall(r"^@", text, flags=re.MULTILINE))
    return dict(entries)


def test_versions_and_dates_agree():
    project = PROJECT["project"]
    changelog = re.findall(
        r"^## (\S+) - (\S+)$",
        (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    )
    version, date = changelog[0]
    assert version == project["version"] == str(CITATION["version"]) == CODEMETA["version"]
    assert date == str(CITATION["date-released"]) == CODEMETA["datePublished"]
    package = ElementTree.parse(ROOT / "models" / "package.xml").getroot()
    assert package.findtext("version") == version
    authors = [author["name"] for author in project["authors"]]
    assert [one.text for one in package.findall("maintainer")] == authors
    assert [one["name"] for one in CITATION["authors"]] == authors
    assert [one["name"] for one in CODEMETA["author"]] == authors
    assert CODEMETA["license"].rsplit("/", 1)[1] == CITATION["license"] == project["license"]
    assert CODEMETA["description"] == project["description"]
    assert CODEMETA["keywords"] == project["keywords"]


def test_the_changelog_of_a_release_is_a_page():
    releases = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## ")[1:]
    assert all(len(release.splitlines()) <= 60 for release in releases)


def test_the_rebuilt_paper_has_one_title_and_one_doi():
    [paper] = CITATION["references"]
    [publication] = CODEMETA["referencePublication"]
    entry = bib()["McGeehan2021"]
    assert paper["title"] == publication["name"] and f"title = {{{paper['title']}}}" in entry
    assert publication["identifier"] == f"https://doi.org/{paper['doi']}"
    assert f"doi = {{{paper['doi']}}}" in entry
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").replace(">", " ").split())
    assert paper["title"].lower() in readme.lower() and paper["doi"] in readme


def test_citations_of_the_paper_and_its_references_are_the_same_and_can_be_found():
    text = (ROOT / "docs/paper/paper.md").read_text(encoding="utf-8")
    entries = bib()
    assert set(re.findall(r"@(\w+)", text)) == set(entries)
    for key, entry in entries.items():
        fields = set(re.findall(r"^  (\w+) = \{", entry, flags=re.MULTILINE))
        assert {"author", "title", "year"} <= fields, key
        assert fields & {"doi", "url", "journal"}, key


def test_the_paper_has_the_sections_and_the_length_that_its_journal_asks():
    text = (ROOT / "docs/paper/paper.md").read_text(encoding="utf-8")
    _, head, body = text.split("---\n", 2)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(
        yaml.safe_load(head)
    )
    assert {
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "Acknowledgements",
        "References",
    } <= set(re.findall(r"^# (.*)$", body, flags=re.MULTILINE))
    assert 750 <= len(body.split()) <= 1750


def test_the_root_holds_named_folders_the_usual_files_and_dotfiles():
    seen = {path.name for path in at_the_root() if not path.name.startswith(".")}
    assert seen == FOLDERS | FILES


def test_the_projects_own_addresses_stand_in_one_file():
    hosts = {urlsplit(url).netloc for url in PROJECT["project"]["urls"].values()}
    assert len(hosts) == 1
    [host] = hosts
    home = ROOT / "pyproject.toml"
    assert not [
        path.relative_to(ROOT)
        for path in texts()
        if path != home and host.encode() in path.read_bytes()
    ]


def test_what_is_asked_of_the_package_by_name_is_in_its_wheel():
    build = PROJECT["tool"]["hatch"]["build"]["targets"]
    shipped = {name for name in build["wheel"]["force-include"] if name.startswith("data/")}
    assert shipped < set(build["sdist"]["only-include"])
    asked = re.compile(r"(?:resource\(\s*f?[\"']|package://vsf_drake/)(data/\w+)")
    lacking = {
        str(path.relative_to(ROOT)): name
        for path in texts()
        if path.suffix in (".py", ".md", ".ipynb", ".yaml")
        for name in asked.findall(path.read_text(encoding="utf-8"))
        if name not in shipped
    }
    assert not lacking, f"read from the checkout, by Path(__file__).parents: {lacking}"


def test_the_image_is_built_of_what_the_source_distribution_holds():
    kept = {
        line[1:]
        for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
        if line.startswith("!")
    }
    always = {"pyproject.toml", "README.md", "LICENSE"}
    assert kept == always | set(
        PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["only-include"]
    )
