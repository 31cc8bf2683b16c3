"""What CONTRIBUTING.md shows of the code stands so in the code."""
import re
from pathlib import Path

root = Path(__file__).resolve().parents[2]


def squeezed(text):
    return re.sub(r"\s+", "", text)


def test_the_list_of_a_step_is_the_code_s():
    text = (root / "CONTRIBUTING.md").read_text()
    shown = [line for line in text.splitlines() if line.startswith("{Task::")]
    code = [line for line in (root / "src/dem/step.hpp").read_text().splitlines() if line.strip().startswith("{Task::")]
    assert len(code) > 5
    assert [squeezed(line) for line in shown] == [squeezed(line) for line in code]


def test_the_files_it_names_exist():
    text = (root / "CONTRIBUTING.md").read_text()
    named = set(re.findall(r"`((?:src|tests|docs|cases|python|cmake|bench)/[\w./-]+)`", text)) - {"src/dem/law/cohesion.hpp"}
    assert len(named) > 20
    assert [name for name in sorted(named) if not (root / name).exists()] == []
