"""How the documentation site is made: `make docs`. pages.py gathers the texts, most of them guides in docs/."""

from __future__ import annotations

import gc
import sys
import tomllib
from importlib.metadata import version as version_of
from importlib.util import find_spec
from pathlib import Path

import click
from fracgyro.cli import cli
from sphinx.application import Sphinx

gc.set_threshold(200_000)  # the trees of all pages live until the end: collecting among them took a tenth of the time

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

project = "fracgyro"
author = "The fracgyro authors"
project_copyright = author
version = release = version_of("fracgyro")

extensions = [
    "compact",
    "mathml",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_click",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
nitpicky = True
# Types of libraries whose own pages cannot be asked offline.
nitpick_ignore_regex = [
    ("py:.*", r"(collections|control|ctypes|matplotlib|numpy|np|os|pathlib|scipy|typing|xarray|xr)\..*"),
    # Tables of fields, which have their own reference.
    ("py:class", r"fracgyro(_lab\.comparison\.task|\.scenario\.(device|schema))\..*"),
    ("py:class", r"(Any|Array|ArrayLike|Callable|ControllerLike|Figure|Iterable|Mapping|NDArray|Path|Sequence|Vector)"),
]

# Markdown
myst_enable_extensions = ["colon_fence"]
myst_fence_as_directive = ["math"]  # the syntax of GitHub
myst_heading_anchors = 4  # with GitHub's names
html_math_renderer = "mathml"

# Docstrings: backticks mark code, as in Markdown
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_inherit_docstrings = False
python_maximum_signature_line_length = 88

sphinx_gallery_conf = {
    "examples_dirs": str(HERE.parent / "gallery"),
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "abort_on_example_error": True,
    "capture_repr": (),
    "copyfile_regex": "",
    "image_scrapers": ("matplotlib",),
    "min_reported_time": 1e9,
    "parallel": find_spec("joblib") is not None,  # the number of scripts at a time is that of -j
    "reset_modules": ("matplotlib",),
    "show_memory": False,
    "show_signature": False,
    "within_subsection_order": "FileNameSortKey",
    "write_computation_times": False,
}


def load(group: click.Group) -> None:
    """Loads commands of other packages, too: sphinx_click lists only loaded commands."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            load(command)


load(cli)

EXAMPLES = tomllib.loads((HERE / "examples.toml").read_text(encoding="utf-8"))


def with_examples(app: Sphinx, context: click.Context, lines: list[str]) -> None:
    """Adds the examples of a command to its description."""
    shown = EXAMPLES.get(context.command_path.partition(" ")[2], [])
    lines += [".. code-block:: sh", "", *(f"   {each}" for each in shown), ""] if shown else []


def without_filler(app: Sphinx, what: str, name: str, found: object, options: object, lines: list[str]) -> None:
    """Removes Python's own words for a field of a named tuple."""
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()


def setup(app: Sphinx) -> None:
    app.connect("autodoc-process-docstring", without_filler)
    app.connect("sphinx-click-process-description", with_examples)


templates_path = [str(HERE / "templates")]
html_theme = "furo"
html_title = f"fracgyro {version}"
html_static_path = [str(HERE / "static")]
html_css_files = ["fracgyro.css"]
html_js_files = ["fracgyro.js"]
html_search_scorer = str(HERE / "scorer.js")
html_favicon = str(HERE / "static" / "favicon.svg")
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_use_index = html_domain_indices = False  # the search answers
copybutton_prompt_text = r">>> |\.\.\. "
copybutton_prompt_is_regexp = True
