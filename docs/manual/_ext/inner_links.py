"""After a build: every link and picture within the pages leads to a file and an anchor that are there. Sphinx itself does not look at anchors."""
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.ids, self.links = set(), set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id" or (tag == "a" and name == "name"):
                self.ids.add(value)
            elif name in ("href", "src") and value:
                self.links.add(value)


def broken(directory):
    """Links that do not hold, as "page: link"."""
    directory = Path(directory).resolve()
    pages = {path: Page(path.read_text()) for path in directory.rglob("*.html") if "_static" not in path.parts}
    lost = []
    for path, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue  # to the outside
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file() or (parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids):
                lost.append(f"{path.relative_to(directory)}: {link}")
    return sorted(lost)


def check(app, exception):
    if exception or app.builder.format != "html":
        return
    lost = broken(app.outdir)
    if lost:
        from sphinx.errors import ExtensionError  # tests have no Sphinx
        raise ExtensionError("links that lead nowhere:\n  " + "\n  ".join(lost))


def setup(app):
    app.connect("build-finished", check, priority=900)
    return {"parallel_read_safe": True}
