# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sphinx configuration of `make site`; the sources are those that `fluxverify.docs.site` writes."""

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))

project = "Fluxlock"
author = "Fluxlock contributors"
project_copyright = "2026, Fluxlock contributors"
version = release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "source_pages",
    "timing",
]
root_doc = "index"
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
highlight_language = "text"
default_role = "code"

myst_heading_anchors = 4
myst_url_schemes = {"http": None, "https": None, "mailto": None, "source": None}
myst_enable_extensions = ["attrs_inline", "attrs_block", "colon_fence"]

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    "npt.ArrayLike": "ArrayLike",
    **{name: name for name in ("FloatArray", "ComplexArray", "IntArray", "BoolArray", "Commutation", "Order")},
}
add_module_names = False
python_use_unqualified_type_names = True

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "docs" / "gallery"),
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "remove_config_comments": True,
    "write_computation_times": False,
    "only_warn_on_example_error": False,
    "abort_on_example_error": True,
    "copyfile_regex": r"",
}

html_theme = "pydata_sphinx_theme"
html_title = "Fluxlock"
html_context = {"default_mode": "auto"}
html_static_path = ["static"]
html_css_files = ["fluxlock.css"]
html_search_scorer = str(Path(__file__).parent / "scorer.js")
# A page opened as a file may read no other file, so results come without an extract.
html_show_search_summary = False
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "header_links_before_dropdown": 8,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "navigation_depth": 4,
    "show_nav_level": 1,
    "show_toc_level": 2,
    "show_prev_next": True,
    "footer_start": ["copyright"],
    "footer_center": [],
    "footer_end": [],
    "secondary_sidebar_items": {
        "**": ["page-toc"],
        "reference/settings": [],
        "verification/regression": [],
        "verification/matrix": [],
        "index": [],
    },
    "pygments_light_style": "tango",
    "pygments_dark_style": "github-dark",
}
html_sidebars = {"index": [], "search": [], "source/**": []}
