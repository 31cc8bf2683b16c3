"""What the manual takes from the program: tables of keys and columns, and the help of commands.

A page has a line <!-- generated: WHAT --> where one of these goes:
    keys             all keys of case.toml, each with an anchor; the role {key}`contact.k_n` links to it
    presets, loads   what stands below the list of `moraine keys`
    series           the columns of series.h5
    commands         the commands, with an example each and what `moraine COMMAND --help` prints
    gallery          the figures of the studies, as their reports have them
    notebooks        those in notebooks/, with what they show
    api, internal    the modules of python/moraine: those for users with their docstrings, the others as a list
The role {src}`src/dem/law/contact.hpp: grip()` names a file of the sources, and functions or types in it. A file or name that is
not there is a warning, so that the manual follows the code.
"""
import re
from pathlib import Path

from docutils import nodes
from sphinx.errors import ExtensionError
from sphinx.util import logging

import contents

log = logging.getLogger(__name__)


def fill_in(app, document, source):
    if document.startswith("bench/results/") and not re.search(r"^# ", source[0], re.M):
        source[0] = f"# {Path(document).name}\n\n" + source[0]  # a table alone
    try:
        source[0] = re.sub(r"<!-- generated: ([\w -]+?) -->", lambda match: contents.made(match[1]), source[0])
    except RuntimeError as why:
        raise ExtensionError(f"{document}: {why}") from None


def src(role, rawtext, text, lineno, inliner, options=None, content=()):
    wrong = contents.missing(text)
    if wrong:
        log.warning(wrong, location=(inliner.document.settings.env.docname, lineno))
    literal = nodes.literal(rawtext)
    for k, part in enumerate(re.split(r"(?<=[/_])", text)):  # where a narrow table may break it
        if k:
            literal += nodes.raw("", "<wbr>", format="html")
        literal += nodes.Text(part)
    return [literal], []


def as_rst(app, what, name, obj, options, lines):
    """Docstrings are plain text with `name` for code; what is indented stands as it is."""
    out, inside_block = [], False
    for line in lines:
        indented = line.startswith(" ")
        if indented and not inside_block:
            out += ["", "::", ""]
        if line.strip() and not indented and inside_block:
            out.append("")
        if line.strip():
            inside_block = indented
        out.append(line if indented else re.sub(r"[|*]", r"\\\g<0>", re.sub(r"(?<![`:\w])`([^`]+)`(?!`)", r"``\1``", line)))
    lines[:] = out


def setup(app):
    app.add_object_type("key", "key", objname="key of case.toml", indextemplate="single: %s (key)")
    app.add_role("src", src)
    app.connect("source-read", fill_in)
    app.connect("autodoc-process-docstring", as_rst, priority=100)
    return {"parallel_read_safe": True}
