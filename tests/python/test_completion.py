from pathlib import Path
import shutil
import subprocess

import pytest

root = Path(__file__).resolve().parents[2]


def complete(*words, script=root / "completions/moraine.bash", directory=root):
    """What bash offers for the last of these words."""
    ask = f"""compopt() {{ :; }}
source {script}
COMP_WORDS=(./moraine {' '.join(f"'{w}'" for w in words)}) COMP_CWORD={len(words)}
_moraine
printf '%s\\n' "${{COMPREPLY[@]}}\""""
    done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, cwd=directory, check=True)
    assert done.stderr == ""
    return [line.strip() for line in done.stdout.splitlines() if line]


def test_commands():
    assert {"run", "sweep", "watch", "figures", "movie", "view", "reproduce", "test"} <= set(complete(""))
    assert complete("wa") == ["watch"]


@pytest.mark.parametrize("command, options", [
    ("run", "--resume --force --quiet --set --backend --threads --ranks --help"),
    ("export", "--format --output --help"),
    ("watch", "--interval --once --time --png --no-png --help"),
    ("figures", "--output --format --only --help"),
    ("movie", "--only --stage --fps --size --output --help"),
    ("view", "--stage --every --most --output --help"),
    ("reproduce", "--preset --seeds --quick --set --settled --output --cores --gpu --cluster --cluster-options --dry-run --help"),
])
def test_options(command, options):
    assert complete(*command.split(), "-") == options.split()


def test_cases():
    assert "cases/quick-shear" in complete("watch", "cases/q") and complete("figures", "cases/q") == ["cases/quick-shear"]


def test_values_of_options():
    assert complete("reproduce", "--preset", "") == ["paper", "standard", "fast"]
    assert complete("watch", "--interval", "") == complete("figures", "--format", "") == []
    assert complete("movie", "--only", "") == ["grains", "section"] and complete("figures", "--only", "") == []
    assert complete("export", "--format", "") == ["csv", "lammps", "vtk"]
    assert complete("watch", "--png", "READ") == ["README.md"]


def test_studies(tmp_path):
    (tmp_path / "completions").mkdir()
    script = shutil.copy(root / "completions/moraine.bash", tmp_path / "completions")
    assert complete("reproduce", "", script=script, directory="/") == []
    for name in ("study", "stage", "other"):
        (tmp_path / "cases" / name).mkdir(parents=True)
    for name in ("study", "other"):
        (tmp_path / "cases" / name / "study.toml").touch()
    assert complete("reproduce", "st", script=script, directory="/") == ["study"]
