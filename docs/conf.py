"""The site: `make docs`. Pages of the environments and the leaderboard are made from docstrings and from a JSON file."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from pages import markdown_of_docstring, write_pages  # noqa: E402

import tagtrack  # noqa: E402

project, author, release = "TagTrack", "TagTrack contributors", tagtrack.__version__
copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "html"]
html_theme = "furo"
html_title = f"TagTrack {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_domain_indices = False
myst_heading_anchors = 3
myst_enable_extensions = ["deflist"]
autodoc_typehints = "none"  # signatures of arrays say less than docstrings do
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring, napoleon_numpy_docstring = True, False
napoleon_use_rtype = False


def setup(app):
    app.connect("builder-inited", lambda _: write_pages(Path(__file__).parent))
    app.connect("autodoc-process-docstring", markdown_of_docstring)
