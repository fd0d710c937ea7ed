"""How Sphinx builds these pages into a site: `make docs`.

Sphinx, because it makes a reference of NumPy-style docstrings, ends the build at a broken link or reference, and is what numpy's
own ecosystem keeps. MkDocs had its last release in 2024, Material for MkDocs gets security fixes alone, and their successor
Zensical is at 0.1. MyST lets the pages be Markdown that a git host shows as well.
"""

import os
import re
import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

project = "Arena"
copyright = "the authors of the arena"

extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc"]
exclude_patterns = ["figures"]
nitpicky = True
highlight_language = "none"  # commands and drawings; code says its language
html_theme = "furo"
html_title = "Arena"
html_copy_source = False

myst_heading_anchors = 4  # `page.md#a-heading`, as git hosts have it

# The notebook runs from top to bottom at every build, somewhere else than here, and the site shows what came of it.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # where `arena` is
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_output_stderr = "remove"  # progress

default_role = "literal"  # `name` in a docstring is code
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
numpydoc_show_class_members = False  # autodoc shows them

# Other projects' names cannot be looked up without a network.
_OTHERS = "collections|gymnasium|numpy|np|pathlib|pettingzoo|typing"
nitpick_ignore_regex = [
    (r"py:.*", rf"({_OTHERS})\..*"),
    (r"py:.*", r"arena\.game\.observation_fields\..*"),  # the table behind the arrays, told in zenoh.md
    (r"py:.*", r"(tuple|dict)\[.*"),  # a field's type, which numpydoc takes for a name
]


def setup(app: Sphinx) -> None:
    """Show the boards of the rules as they are drawn, and docstrings as they are written."""
    app.add_lexer("board", TextLexer)
    app.connect("autodoc-process-docstring", _allow_plurals, priority=100)


def _allow_plurals(app: Sphinx, what: str, name: str, item: object, options: object, lines: list[str]) -> None:
    """Read a name with an s behind it, `Seat`s, as the docstrings mean it."""
    lines[:] = [re.sub(r"(`\w+`)s\b", r"\1\\ s", line) for line in lines]
