"""The manual has a place for all that there is, and what it names is there. How its pages build is tried by ./moraine docs."""
from pathlib import Path
import re
import sys

import pytest

root = Path(__file__).resolve().parents[2]
manual = root / "docs/manual"
sys.path.insert(0, str(manual / "_ext"))
import contents  # noqa: E402
import inner_links  # noqa: E402

pages = sorted(manual.rglob("*.md"))


@pytest.fixture(scope="module")
def tables():
    try:
        contents.program()
    except RuntimeError as why:
        pytest.skip(str(why))
    return contents.tables()


def test_every_key_has_its_place(tables):
    text = contents.keys()
    placed = re.findall(r"^```\{key\} (.*)$", text, re.M)
    assert placed == [key["name"] for key in tables["keys"]] and len(placed) > 150
    assert "<!-- generated: keys -->" in (manual / "reference/keys.md").read_text()
    for table in {key["name"].rpartition(".")[0] for key in tables["keys"]}:
        assert contents.about_tables[table]


def test_keys_that_pages_name_exist(tables):
    known = {key["name"] for key in tables["keys"]}
    named = {key for page in pages for key in re.findall(r"\{key\}`([^`]+)`", page.read_text())}
    assert len(named) > 30 and named <= known


def test_every_column_has_its_place(tables):
    placed = re.findall(r"^\| `(\w+)` \|", contents.series(), re.M)
    assert placed == [column["name"] for column in tables["series"]] and "asked_bottom_pressure" in placed
    assert "<!-- generated: series -->" in (manual / "reference/files.md").read_text()


def test_loads_and_presets_are_taken_whole(tables):
    assert "interpolation" in contents.made("loads") and "model.preset" not in contents.made("loads")
    assert contents.made("presets").count("model.f = ") == 3


def test_every_command_has_its_place(tables):
    known = contents.known_commands()
    assert {"run", "keys", "watch", "reproduce"} <= known
    assert known <= set(contents.about_commands)  # else to be described in docs/manual/_ext/contents.py
    text = (manual / "reference/commands.md").read_text()
    assert "<!-- generated: commands -->" in text
    launcher = set(re.findall(r'"([\w-]+)"', re.search(r"launcher_commands = \{(.*?)\}", (root / "src/main.cpp").read_text(), re.S)[1]))
    assert launcher - known == set(re.findall(r"^\(command-([\w-]+)\)=$", text, re.M)) == {"docs", "test"}
    made = contents.commands()
    assert set(re.findall(r"^\(command-([\w-]+)\)=$", made, re.M)) == known
    assert "--resume" in made and "--interval" in made  # of a command of the program and of one in Python


def test_every_module_has_its_place():
    public, internal = contents.modules()
    assert sorted([*public, *internal]) == sorted(path.stem for path in (root / "python/moraine").glob("*.py") if path.stem != "__init__")
    strangers = [name for name in public if name not in contents.for_users]
    assert strangers == []  # to be put on a list in docs/manual/_ext/contents.py: for_users, or inside
    text = contents.api()
    assert all(f"automodule:: moraine.{name}\n" in text for name in public)


def test_what_is_generated_has_a_maker():
    wanted = {what for page in pages for what in re.findall(r"<!-- generated: ([\w -]+?) -->", page.read_text())}
    assert wanted == set(contents.makers)


def test_files_and_functions_that_theory_names_exist():
    named = {(page.name, text) for page in pages for text in re.findall(r"\{src\}`([^`]+)`", page.read_text())}
    assert len(named) > 100
    assert [(page, contents.missing(text)) for page, text in sorted(named) if contents.missing(text)] == []
    assert contents.missing("src/dem/law/contact.hpp: grip, no_such_thing()") == "src/dem/law/contact.hpp has no no_such_thing"
    assert contents.missing("src/no/such.hpp") == "src/no/such.hpp is not there"


def slug(title):
    """The anchor of a heading, as where the repository is read."""
    return re.sub(r"[^\w -]", "", title.strip().lower()).replace(" ", "-")


def test_links_lead_somewhere():
    lost = []
    for page in [root / "README.md", root / "CONTRIBUTING.md", *pages]:
        text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            if re.match(r"[a-z]+:", link):
                continue
            if not target.exists():
                lost.append(f"{page.relative_to(root)}: {link}")
            elif anchor and target.suffix == ".md" and anchor not in map(slug, re.findall(r"^#+ (.*)$", target.read_text(), re.M)):
                lost.append(f"{page.relative_to(root)}: {link}: no such heading")
    assert lost == []


def test_pictures_exist():
    shown = [(page, link) for page in [root / "README.md", *pages] for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text())]
    assert len(shown) > 5 and all((page.parent / link).exists() for page, link in shown)


def test_every_page_is_in_a_list():
    for page in pages:
        if page.name == "index.md" or page.parent == manual:
            continue
        assert re.search(rf"^{page.stem}$", (page.parent / "index.md").read_text(), re.M), page


def test_readme_is_two_screens():
    assert len((root / "README.md").read_text().splitlines()) <= 90


def test_broken_links_of_built_pages_are_found(tmp_path):
    (tmp_path / "a.html").write_text('<a href="b.html#there">x</a><a href="https://example.org/none">y</a><img src="p.png"><h1 id="top"></h1>')
    (tmp_path / "b.html").write_text('<p id="there"><a href="a.html#top">x</a></p>')
    (tmp_path / "p.png").touch()
    assert inner_links.broken(tmp_path) == []
    (tmp_path / "p.png").unlink()
    (tmp_path / "b.html").write_text('<a href="#here">x</a>')
    assert inner_links.broken(tmp_path) == ["a.html: b.html#there", "a.html: p.png", "b.html: #here"]
