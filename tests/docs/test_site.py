"""The documentation builds without a warning, its links resolve, and every public system is in it
with its ports."""

from __future__ import annotations

import dataclasses
import html.parser
import json
import posixpath
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import api_pages
import port_text
import pytest
import tutorial
from made_systems import public_diagrams, public_systems

from vsf_drake.cli.guide import GUIDES
from vsf_drake.model.parameters import FulcrumParameters

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.slow


class Page(html.parser.HTMLParser):
    """Links, anchors and text of a page."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors, self.text = [], set(), []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors |= {given[key] for key in ("id", "name") if given.get(key)}
        self.links += [given[key] for key in ("href", "src") if given.get(key)]

    def handle_data(self, data):
        self.text.append(data)


SEARCH = """
const fs = require("fs"), vm = require("vm"), [root, words] = process.argv.slice(1);
const page = { addEventListener() {}, getElementById: () => ({}), readyState: "loading" };
const world = vm.createContext({ document: page, SPHINX_HIGHLIGHT_ENABLED: false });
world.window = world;
for (const name of ["doctools", "language_data", "searchtools"].map(name => `_static/${name}`))
  vm.runInContext(fs.readFileSync(`${root}/${name}.js`, "utf8"), world);
vm.runInContext(fs.readFileSync(`${root}/searchindex.js`, "utf8"), world);
const found = vm.runInContext("word => Search._performSearch(...Search._parseQuery(word))", world);
console.log(JSON.stringify(words.split(" ").map(word => found(word).reverse().map(row => row[0]))));
"""
"""What the site's own search finds: docnames, best first, of words."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The built site."""
    folder = tmp_path_factory.mktemp("documentation")
    source = shutil.copytree(
        ROOT / "docs", folder / "docs", ignore=shutil.ignore_patterns("api", "_build")
    )
    for beside in ("studies", "models"):  # pages offer files from there
        (folder / beside).symlink_to(ROOT / beside)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "-W",
            "--keep-going",
            "-q",
            "-b",
            "html",
            source,
            folder / "html",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    # what the notebooks' kernels say of their ports and their start
    of_kernels = ("[IPKernelApp]", "#")
    assert not [
        line
        for line in done.stderr.splitlines()
        if line.strip() and not line.startswith(of_kernels)
    ]
    return folder / "html"


@pytest.fixture(scope="module")
def site(folder):
    """The built pages by their path."""
    return {path.relative_to(folder).as_posix(): Page(path) for path in folder.rglob("*.html")}


@pytest.mark.skipif(shutil.which("node") is None, reason="node runs the site's search")
def test_search_leads_to_the_useful_page_among_the_first_three_and_to_none_of_the_api(folder):
    wanted = {
        "keel": "explanation/keel",
        "fulcrum": "explanation/keel",
        "stiffness": "howto/stiffness_of_a_setting",
        "C3D": "howto/read_a_c3d",
        "CoP": "howto/force_and_cop",
        "bushing": "howto/socket_bushing",
        "AutoDiff": "howto/gradient_by_autodiff",
        "sweep": "guide/sweep",
        "export": "guide/engines",
        "citation": "howto/cite_a_number",
    }
    done = subprocess.run(
        ["node", "-e", SEARCH, folder, " ".join(wanted)], capture_output=True, text=True, check=True
    )
    found = dict(zip(wanted, json.loads(done.stdout), strict=True))
    assert {word: rows[:3] for word, rows in found.items() if wanted[word] not in rows[:3]} == {}
    assert not [rows for rows in found.values() if any("api/" in row for row in rows[:3])]


def test_every_internal_link_leads_somewhere_and_no_page_names_the_machine_that_built_it(site):
    dead, places = [], (str(ROOT), str(Path.home()), "/tmp/", "/work/", "site-packages")
    for name, page in site.items():
        text = "".join(page.text) + " ".join(page.links)
        assert not [place for place in places if place in text and len(place) > 2], name
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or link.startswith("data:"):
                continue
            target = posixpath.normpath(
                posixpath.join(posixpath.dirname(name), unquote(parts.path)) if parts.path else name
            )
            if target.endswith(".html") and target not in site:
                dead.append(f"{name}: {link}")
            elif (
                target in site
                and parts.fragment
                and not target.endswith("replay.html")  # which takes a walk's number from there
                and unquote(parts.fragment) not in site[target].anchors
            ):
                dead.append(f"{name}: {link}")
    assert not dead, "\n".join(dead[:20])


def test_every_command_and_every_key_of_a_file_is_in_the_reference(site):
    """Of the commands those that --help lists; of the files some keys at any depth, and that a
    notebook has run."""
    options, keys = (
        "".join(site[f"api/{name}.html"].text) for name in ("command_line", "yaml_files")
    )
    assert all(f"vsf-drake {name}" in options for name in GUIDES) and "--hold-out" in options
    for key in (
        "foot.keel.flexural_modulus_pa",
        "prosthesis.fulcrum_mm",
        "ground.patches[].slope_deg",
        "forefoot[].fulcrum_mm",
    ):
        assert key in keys, key
    assert "Pa" in keys and "1e+06 to 1e+12" in keys


def test_the_notebook_of_a_walk_says_what_its_own_numbers_say(site):
    """Its text has it that the foot alone is farther off than no model, and nearer than that with
    momentum."""
    text = " ".join("".join(site["notebooks/walk_and_fit.html"].text).split())
    assert "The foot alone is farther off here than no model at all" in text
    assert re.search(r"fitted contact, physics: 5\.2 %, FARTHER OFF than the better null", text)
    assert re.search(r"fitted contact, momentum: \d\.\d %, nearer than the better null", text)


def test_what_the_notebooks_hold_is_what_they_show_when_run(site):
    """Stored with the commit that showed it."""
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        notebook = json.loads(path.read_text(encoding="utf-8"))
        assert re.fullmatch(r"[0-9a-f]{8}", notebook["metadata"]["shown_by_commit"])
        text = " ".join(site[f"notebooks/{path.stem}.html"].text)
        cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
        shown = [output for cell in cells for output in cell["outputs"]]
        assert any("image/png" in output.get("data", ()) for output in shown)
        for output in shown:
            if output["output_type"] == "stream":
                assert tutorial.same(text, f"... {''.join(output['text'])} ..."), output["text"]


def test_every_public_system_and_diagram_has_its_page_with_its_ports(site):
    for cls in (*public_systems(), *public_diagrams()):
        page = site[f"api/{api_pages.page_of(cls.__module__)}.html"]
        block, words = (
            port_text.port_block(cls.__doc__),
            set(re.findall(r"\w+", " ".join(page.text))),
        )
        name = cls.__name__.split("_")[0]
        assert f"{cls.__module__}.{name}" in page.anchors
        if block:
            assert {*block.inputs, *block.outputs} <= words
            assert "port-block" not in " ".join(page.text), (
                f"{name}: the block is shown as it is typed"
            )
        assert "Impl" not in words


def test_everything_public_that_is_described_has_a_place(site):
    missing = []
    for module in api_pages.public_modules():
        for name in api_pages.described(Path(module.__file__)):
            page = site[f"api/{api_pages.page_of(module.__name__)}.html"]
            missing += (
                [] if f"{module.__name__}.{name}" in page.anchors else [f"{module.__name__}.{name}"]
            )
    assert not missing, ", ".join(missing)


def test_the_pages_of_ports_and_parameters_show_what_the_model_says(site):
    ports = " ".join(" ".join(site["ports.html"].text).split())
    assert "free_moment" in ports and "TestingMachine" in ports and "FootForces" in ports
    parameters = " ".join(" ".join(site["api/vsf_drake.model.parameters.html"].text).split())
    for field in dataclasses.fields(FulcrumParameters):
        assert f"{field.name} {field.default:g} {field.metadata['unit']} " in parameters
