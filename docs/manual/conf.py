"""The manual. ./moraine docs builds it into build/docs/html.

The source directory is the root of the repository, so that pages link to each other, to the studies and to the measurements by
the same paths in the manual and where the repository is read.
"""
import shutil
import sys
import types
from pathlib import Path

here = Path(__file__).resolve().parent
root = here.parents[1]
sys.path[:0] = [str(here / "_ext"), str(root / "python")]

project = "Moraine"
copyright = author = "the Moraine developers"  # noqa: A001
version = release = next(line.split('"')[1] for line in (root / "python/moraine/__init__.py").read_text().splitlines()
                         if line.startswith("__version__"))

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "moraine_manual", "inner_links"]
root_doc = "docs/manual/index"
include_patterns = ["docs/**.md", "CONTRIBUTING.md", "bench/results/*.md", "cases/**/README.md", "cases/**/report.md",
                    "cases/**/notes-fast.md"]
exclude_patterns = ["build*", ".*", "shared", "src", "tests", "python", "cases/**/output", "cases/**/sweep", "cases/**/runs"]
suppress_warnings = ["myst.header"]  # reports of studies begin their sections where they like
nitpick_ignore_regex = [("py:.*", r"(?!moraine\.).*|moraine\.(_core|tables)\..*")]  # what NumPy, h5py and others call their own

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 4
myst_dmath_allow_digits = False
myst_dmath_allow_space = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "undoc-members": True}

highlight_language = "none"  # of blocks that name no language: commands in a shell
html_theme = "furo"
html_title = f"Moraine {version}"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
html_show_sourcelink = False
html_copy_source = False

# Equations without a network: Debian's MathJax travels with the pages where it is there.
mathjax_home = Path("/usr/share/javascript/mathjax")
if (mathjax_home / "MathJax.js").exists():
    mathjax_path = "mathjax/MathJax.js?config=TeX-AMS_CHTML"
    mathjax2_config = {"showMathMenu": False, "messageStyle": "none", "tex2jax": {"processClass": "math"}}
    myst_update_mathjax = False  # that is for version 3; Debian has 2.7


# The compiled part of the package is not there: the manual is built from the sources. Its table of keys, from which the package makes
# classes, comes from the program.
class Core(types.ModuleType):
    version, Error = version, type("Error", (RuntimeError,), {"__module__": "moraine"})

    def keys(self):
        from contents import tables
        return tables()["keys"]

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {"__module__": "moraine._core"})


sys.modules["moraine._core"] = Core("moraine._core")


def copy_mathjax(app, exception):
    if exception or app.builder.format != "html" or not (mathjax_home / "MathJax.js").exists():
        return
    target = Path(app.outdir) / "_static/mathjax"
    for part in ("MathJax.js", "config/TeX-AMS_CHTML.js", "extensions", "jax/element", "jax/input/TeX", "jax/output/CommonHTML",
                 "fonts/HTML-CSS/TeX/woff"):
        source = mathjax_home / part
        if source.is_dir():
            shutil.copytree(source, target / part, dirs_exist_ok=True)
        elif source.exists():
            (target / part).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target / part)


def redirect(app, exception):
    """The first page, where one looks for it."""
    if not exception and app.builder.format == "html":
        (Path(app.outdir) / "index.html").write_text(
            '<!DOCTYPE html><meta charset="utf-8"><title>Moraine</title>'
            '<meta http-equiv="refresh" content="0; url=docs/manual/index.html"><a href="docs/manual/index.html">The manual</a>\n')


def setup(app):
    app.connect("build-finished", copy_mathjax)
    app.connect("build-finished", redirect)
