"""How the pages of docs/ become a site: `make docs`."""  # noqa: INP001  no package

import sys
from pathlib import Path

_HERE = Path(__file__).parent
sys.path.insert(0, str(_HERE / "_ext"))

project = "syncrelay"
author = "the authors of syncrelay"
copyright = "the authors of syncrelay, Apache-2.0"  # noqa: A001  Sphinx's word

# `repository` and what follows it are ours, in _ext.
extensions = ["myst_parser", "sphinx_copybutton", "repository", "doors", "lexers"]
exclude_patterns = ["_*", "generate"]

nitpicky = True
# The page that opens first, and that names all others.
root_doc = "index"

# As code hosts make them, so that a link to a heading leads to it there and here.
myst_heading_anchors = 6

html_theme = "furo"
html_title = "syncrelay"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True}
pygments_style = "friendly"
pygments_dark_style = "github-dark"

# What is copied can be pasted: a command without its prompt, and without what it answered.
copybutton_prompt_text = "$ "
copybutton_exclude = ".linenos, .gp"
