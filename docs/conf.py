"""Configuration of the documentation: `sphinx-build -W -b html docs OUT`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import vsf_drake

project = "vsf_drake"
author = "The vsf_drake authors"
project_copyright = author
version = release = vsf_drake.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "vsf_docs"]
exclude_patterns = ["_build", "paper"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

os.environ.pop("MPLBACKEND", None)  # a notebook shows its figures
nb_execution_mode = "force"  # the notebooks show what they do now
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_output_stderr = "remove"

default_role = "name"  # `name` in a docstring: a link where the name is known, code where not
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]  # a list, not objects of their own
napoleon_use_rtype = False
python_maximum_signature_line_length = 88
toc_object_entries = False
highlight_language = "none"  # sketches and equations

html_math_renderer = "mathml"  # no script, no network
html_search_scorer = str(Path(__file__).parent / "_ext" / "scorer.js")
html_theme = "furo"
html_title = f"vsf_drake {version}"
html_static_path = ["_static"]
html_css_files = ["ports.css"]
html_show_sourcelink = False
html_show_copyright = False
