"""A study on a cluster: the profile for Slurm, its scripts among programs that play Slurm, and what is said of jobs that failed."""
import os
import subprocess

import pytest

from conftest import root
from moraine import cluster
from moraine.__main__ import main
from moraine.results import MissingData
from moraine.study import Study

slurm = root / "cases/cluster/slurm"


@pytest.fixture
def play(tmp_path, monkeypatch):
    """play(NAME, SCRIPT) puts a program of this name before all others."""
    def program(name, script):
        (tmp_path / "bin").mkdir(exist_ok=True)
        file = tmp_path / "bin" / name
        file.write_text(f"#!/bin/bash\n{script}\n")
        file.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:{os.environ['PATH']}")
    return program


def said_by(script, *words, **environment):
    return subprocess.run([slurm / script, *words], capture_output=True, text=True, env=os.environ | environment)


@pytest.mark.parametrize("state, expected", [
    ("COMPLETED", "success"), ("RUNNING", "running"), ("PENDING", "running"), ("COMPLETING", "running"), ("REQUEUED", "running"), ("FAILED", "failed"),
    ("TIMEOUT", "failed"), ("CANCELLED", "failed"), ("OUT_OF_MEMORY", "failed"), ("NODE_FAIL", "failed"), ("PREEMPTED", "failed")])
def test_states_of_jobs(play, state, expected):
    play("scontrol", f'[[ "$*" == "--oneliner show job 12" ]] && echo "JobId=12 JobName=x JobState={state} Reason=None"')
    assert said_by("status", "12").stdout == expected + "\n"


def test_a_controller_that_does_not_answer_is_asked_again(play):
    play("scontrol", 'echo "slurm_load_jobs error: Unable to contact slurm controller (connect failure)" >&2; exit 1')
    play("sacct", "echo FAILED")
    assert said_by("status", "12").stdout == "running\n"


@pytest.mark.parametrize("accounting, expected", [("echo COMPLETED", "success"), ('echo "CANCELLED by 0"', "failed"), ("echo RUNNING; echo TIMEOUT", "failed"),
                                                  ("echo no accounting >&2; exit 1", "failed")])
def test_a_job_that_is_long_over_is_looked_up(play, accounting, expected):
    play("scontrol", 'echo "slurm_load_jobs error: Invalid job id specified" >&2; exit 1')
    play("sacct", accounting)
    assert said_by("status", "12").stdout == expected + "\n"


def step(play, left, sleep=0, state="RUNNING"):
    """Of a job with so many seconds left, whose program is stopped after so many."""
    play("srun", f'echo "$@" >&2; sleep {sleep}; exit 1')
    play("squeue", f'echo "{state} $(date -d "{left} seconds" +%Y-%m-%dT%H:%M:%S)"')
    play("scontrol", 'echo "scontrol $*" >&2; exit 1')  # a true one would end the job here
    return said_by("step", "moraine", "run", "a case", SLURM_JOB_ID="7", SLURM_CPUS_PER_TASK="3")


def test_a_job_far_from_its_time_limit_just_fails(play):
    done = step(play, 3600)
    assert done.returncode == 1 and "scontrol" not in done.stderr and done.stderr.startswith("job 7 on ")
    assert "--cpus-per-task=3" in done.stderr and done.stderr.rstrip().endswith("moraine run a case")


def test_a_job_that_is_cancelled_near_its_time_limit_stays_so(play):
    assert "scontrol" not in step(play, 60, state="COMPLETING").stderr


def test_a_job_whose_time_limit_leaves_no_time_is_told_so(play):
    done = step(play, 60)
    assert done.returncode == 1 and "scontrol" not in done.stderr and "it takes a longer --time" in done.stderr


def test_a_job_at_its_time_limit_is_queued_again(play, tmp_path, monkeypatch):
    patient = tmp_path / "step"
    patient.write_text((slurm / "step").read_text().replace("least=30", "least=1"))
    patient.chmod(0o755)
    monkeypatch.setattr("test_cluster.slurm", tmp_path)
    done = step(play, 60, sleep=1.2)
    assert done.returncode == 1 and "scontrol requeue 7" in done.stderr and "job 7 came to its time limit and is queued again" in done.stderr


def test_the_profile_has_what_the_page_names(play):
    yaml = pytest.importorskip("yaml")
    profile = yaml.safe_load((slurm / "config.yaml").read_text())
    page = (root / "docs/manual/how-to/cluster.md").read_text()
    for word in ("--time=1-00:00:00", "--mem-per-cpu=2G", "--signal=TERM@120"):
        assert word in profile["cluster"] and f"| `{word}` |" in page
    for key in ("jobs", "restart-times", "latency-wait"):
        assert f"| `{key}: {profile[key]}` |" in page
    assert profile["cluster-status"] == "status" and os.access(slurm / "status", os.X_OK) and os.access(slurm / "step", os.X_OK)
    assert os.access(slurm / "submit", os.X_OK)
    text = profile["cluster"].format(rule="shear_1", threads=6, params=type("P", (), {"log": "runs/x.log"}))
    assert "--output=runs/x.log" in text and "--cpus-per-task=6" in text and text.endswith("$MORAINE_SBATCH")


def test_profiles(play, tmp_path, monkeypatch):
    with pytest.raises(MissingData, match="--cluster slrum: expected one of slurm, or a directory with the config.yaml"):
        cluster.profile("slrum")
    play("sbatch", "")
    assert cluster.profile("slurm") == slurm and cluster.step(slurm) == str(slurm / "step")
    own = tmp_path / "own"
    own.mkdir()
    (own / "config.yaml").write_text("cluster: qsub -V\n")
    monkeypatch.setenv("PATH", "/nonexistent")
    with pytest.raises(MissingData, match="qsub is not on the PATH"):
        cluster.profile(str(own))
    (own / "config.yaml").write_text("cluster: my-submit\n")
    assert cluster.profile(str(own)) == own and cluster.step(own) == "env"


def test_without_slurm_it_is_said(monkeypatch, capsys):
    monkeypatch.setattr("shutil.which", lambda name: None if name == "sbatch" else f"/usr/bin/{name}")
    assert main(["reproduce", "paper-2013", "--quick", "--cluster", "slurm"]) == 1
    assert "sbatch is not on the PATH; give this command on a machine from which jobs are submitted" in capsys.readouterr().err


def test_options_of_a_cluster_want_one(capsys):
    assert main(["reproduce", "paper-2013", "--quick", "--cluster-options=--partition=long"]) == 1
    assert "--cluster-options: they go with --cluster" in capsys.readouterr().err


def test_commands_of_jobs_are_steps():
    study = Study(root / "cases/paper-2013", seeds=[1], step="/x/step")
    assert study.command("settle", 1, 1)[:3] == ["/x/step", "../../moraine", "run"]
    assert study.log("settle", 1) == "runs/fast/seed-1/settle.log" and study.report_log() == "runs/fast/report.log"
    assert cluster.words(slurm, 4)[-2:] == ["--cores", "4"] and "--cores" not in cluster.words(slurm, None)


def test_what_has_not_finished_is_named(tmp_path):
    (tmp_path / "study.toml").write_text('title = "t"\n[[case]]\nname = "bed"\n[[case]]\nname = "shear"\nstart = "bed"\n')
    for name in ("bed", "shear"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "case.toml").write_text("")
    study = Study(tmp_path, seeds=[1, 2, 3], step="step")
    of = [tmp_path / "runs/fast" / f"seed-{seed}" for seed in (1, 2, 3)]
    for directory in of:
        directory.mkdir(parents=True)
    (of[0] / "bed.done").touch()
    (of[0] / "shear.log").write_text("job 3 submitted\njob 3 on n1, today\nmoraine: the first\njob 4 submitted\njob 4 on n2, today\nmoraine: warning: a\n"
                                     "moraine: bad bed\nsrun: error: n2: task 0: 1\n")
    (of[1] / "bed.log").write_text("job 5 submitted\njob 5 on n1, today\n0.3 %\n")
    assert cluster.unfinished(study) == [
        f"runs/fast/seed-1/shear has not finished: job 4: bad bed; see {of[0]}/shear.log",
        f"runs/fast/seed-2/bed has not finished: job 5: was ended without a word of the program; see {of[1]}/bed.log",
        "runs/fast/seed-2/shear has not begun: it starts from runs/fast/seed-2/bed",
        "runs/fast/seed-3/bed has not begun: it was not submitted; why, stands above",
        "runs/fast/seed-3/shear has not begun: it starts from runs/fast/seed-3/bed"]


def test_last_words_of_jobs():
    def of_job(said):
        return cluster.last_words(f"job 7 submitted\njob 7 on m\nmoraine: earlier\njob 8 submitted\n{said}")
    assert of_job("job 8 on n\nslurmstepd: error: *** JOB 8 ON n CANCELLED DUE TO TIME LIMIT ***\nsrun: error: x\n") == \
        ("8", "*** JOB 8 ON n CANCELLED DUE TO TIME LIMIT ***")
    assert of_job("job 8 on n\nsrun: error: n: task 0: Killed\n") == ("8", "n: task 0: Killed")
    assert of_job("job 8 on n\nmoraine: 2 of 3 cases did not finish:\n  a: bad\n  b: not begun\n[Thu]") == \
        ("8", "2 of 3 cases did not finish: a: bad; b: not begun")
    assert of_job("") == ("8", "has not run; squeue or sacct say why")


@pytest.mark.parametrize("state, number", [("RUNNING", "12"), ("PENDING", "12"), ("FAILED", "13"), ("CANCELLED", "13"), ("COMPLETED", "13")])
def test_a_job_left_in_the_queue_is_followed(play, tmp_path, state, number):
    play("scontrol", f'[[ $4 == 12 ]] && echo "JobId=12 JobState={state} "')
    play("sbatch", f'echo "$*" >{tmp_path}/words; echo "13;there"')
    log = tmp_path / "a.log"
    log.write_text("job 11 submitted, then\njob 12 on n, then\n")
    assert said_by("submit", log, "sbatch", "--time=1", "a script").stdout == number + "\n"
    if number == "13":
        assert (tmp_path / "words").read_text() == "--time=1 a script\n" and "\njob 13 submitted, " in log.read_text()


def test_the_first_job(play, tmp_path):
    play("sbatch", '[[ $1 == good ]] && echo 1 || { echo "sbatch: error: no" >&2; exit 1; }')
    done = said_by("submit", tmp_path / "a.log", "sbatch", "bad")
    assert done.returncode == 1 and "sbatch: error: no" in done.stderr and not (tmp_path / "a.log").exists()
    assert said_by("submit", tmp_path / "a.log", "sbatch", "good").stdout == "1\n"
    assert (tmp_path / "a.log").read_text().startswith("job 1 submitted, ")


def test_the_profile_of_snakemake_8_says_the_same(play):
    yaml = pytest.importorskip("yaml")
    old, new = (yaml.safe_load((slurm / name).read_text()) for name in ("config.yaml", "config.v8+.yaml"))
    assert new["executor"] == "cluster-generic" and new["cluster-generic-submit-cmd"] == old["cluster"]
    assert all(new[key] == old[key] for key in ("jobs", "restart-times", "max-status-checks-per-second", "latency-wait"))
    assert cluster.environment(slurm, "--partition=a") == {"MORAINE_PROFILE": str(slurm), "MORAINE_SBATCH": "--partition=a"}
