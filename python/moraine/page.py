"""The page of a report, and what made it."""
from html import escape
from pathlib import Path
import base64
import os
import platform
import subprocess

from . import style
from .results import MissingData


class Page:
    """Collects text once and writes it as HTML and as Markdown."""

    def __init__(self):
        self.html, self.md = [], []

    def heading(self, text, level=2):
        self.html.append(f"<h{level}>{escape(text)}</h{level}>")
        self.md.append("#" * level + f" {text}\n")

    def paragraph(self, text):
        self.html.append(f"<p>{escape(text)}</p>")
        self.md.append(f"{text}\n")

    def table(self, head, rows):
        cells = "".join(f"<th>{escape(h)}</th>" for h in head)
        body = "\n".join("<tr>" + "".join(f"<td>{escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
        self.html.append(f"<table><thead><tr>{cells}</tr></thead><tbody>\n{body}\n</tbody></table>")
        self.md.append("\n".join("| " + " | ".join(str(c).replace("|", "\\|") for c in row) + " |"
                                 for row in [head, ["---"] * len(head), *rows]) + "\n")

    def figure(self, name, caption, directory):
        kind, data = min((("svg+xml", (directory / f"{name}.svg").read_bytes()), ("png", (directory / f"{name}.png").read_bytes())),
                         key=lambda x: len(x[1]) * (1 if x[0] == "png" else 0.5))  # vectors, unless they are far larger
        self.html.append(f'<figure><img alt="{escape(caption)}" src="data:image/{kind};base64,{base64.b64encode(data).decode()}">'
                         f"<figcaption>{escape(caption)}</figcaption></figure>")
        self.md.append(f"![{name}](figures/{name}.png)\n\n*{caption}*\n")

    def figures(self, draws, captions, directory):
        """Draws {name: function}, as SVG and PNG in `directory`, under a heading; what cannot be drawn is said."""
        self.heading("Figures")
        for name, draw in draws.items():
            try:
                style.save(draw(), directory / name, ("svg", "png"), dpi=130)
                self.figure(name, captions[name], directory)
            except (MissingData, ValueError) as why:
                self.paragraph(f"{name} is not drawn: {why}")

    def notes(self, text):
        """Markdown of the simplest kind: headings and paragraphs, set apart by empty lines."""
        for block in text.strip().split("\n\n"):
            block = " ".join(block.split("\n"))
            if block.startswith("#"):
                self.heading(block.lstrip("# "), max(2, len(block) - len(block.lstrip("#"))))
            else:
                self.paragraph(block)

    def write(self, directory, title):
        """report.html and report.md."""
        page = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{escape(title)}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff; }}
h1 {{ line-height: 1.2; }} h2 {{ margin-top: 2.2em; }}
table {{ border-collapse: collapse; font-size: 13px; width: 100%; }}
th, td {{ text-align: left; vertical-align: top; padding: .35em .7em .35em 0; border-bottom: 1px solid #ddd; }}
figure {{ margin: 2em 0; }} figure img {{ max-width: 100%; }} figcaption {{ font-size: 13px; color: #444; }}
</style></head><body>
{chr(10).join(self.html)}
</body></html>
"""
        for name, text in (("report.html", page), ("report.md", "\n".join(self.md))):
            aside = directory / (name + ".tmp")
            aside.write_text(text)
            aside.rename(directory / name)


def machine():
    cpu = platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.partition(":")[2].strip()
                break
    except OSError:
        pass
    return f"{cpu}, {os.cpu_count()} cores"


def version():
    root = Path(__file__).resolve().parents[2]
    git = subprocess.run(["git", "-C", str(root), "describe", "--always", "--dirty"], capture_output=True, text=True)
    return git.stdout.strip() if git.returncode == 0 else "unknown"


class LeftOut(list):
    """What a report leaves out, in words; called with them it says them, too."""

    def __init__(self, say):
        self.say = say

    def __call__(self, why):
        self.append(why)
        self.say(why)


def beside(study):
    """The other directories of runs beside this one, in order."""
    study = Path(study).resolve()
    return sorted(p for p in study.parent.iterdir() if p.is_dir() and p != study)
