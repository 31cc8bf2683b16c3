"""A Slurm of one node for as long as it is needed: munge, slurmctld and slurmd of this machine, all files in one directory.

    with Cluster(directory) as slurm: subprocess.run(["sbatch", ...], env=slurm.environment)

The daemons run as the present user, with keys, sockets, ports and spools of their own, and end with it."""
import ctypes
import getpass
import os
import secrets
import signal
import socket
import subprocess
import time
from pathlib import Path

conf = """\
ClusterName=moraine
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={control_port}
SlurmdPort={node_port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={directory}/munge/socket,cred_expire=10
CredType=cred/munge
StateSaveLocation={directory}/state
SlurmdSpoolDir={directory}/spool
SlurmctldPidFile={directory}/slurmctld.pid
SlurmdPidFile={directory}/slurmd.pid
PlugStackConfig={directory}/plugstack.conf
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=2,bf_interval=2
KillWait=10
MailProg=/bin/true
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=bench Nodes={host} Default=YES MaxTime=1-00:00:00
"""


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def end_with_parent():
    """In a child: it is killed should this process die without a word."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)


class Cluster:
    """environment: that of commands that are to talk to this Slurm."""

    def __init__(self, directory, cores=2):
        self.directory, self.cores, self.daemons = Path(directory), cores, []
        self.environment = os.environ | {"SLURM_CONF": str(self.directory / "slurm.conf")}

    def __enter__(self):
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_):
        self.stop()

    def start(self):
        d = self.directory
        for name in ("munge", "state", "spool"):
            (d / name).mkdir(parents=True)
        key = d / "munge/key"
        key.touch(0o600)
        key.write_bytes(secrets.token_bytes(128))
        for name in ("plugstack.conf", "cgroup.conf"):
            (d / name).touch()
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20 // 2
        (d / "slurm.conf").write_text(conf.format(directory=d, host=socket.gethostname().partition(".")[0], user=getpass.getuser(), cores=self.cores,
                                                  memory=memory, control_port=free_port(), node_port=free_port()))
        self.daemon("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={d}/munge/socket", f"--pid-file={d}/munge/pid",
                    f"--log-file={d}/munge/log", f"--seed-file={d}/munge/seed", "--num-threads=2")
        self.wait_for(lambda: (d / "munge/socket").exists(), "munged's socket")
        self.daemon("slurmctld", "-D", "-c")
        self.daemon("slurmd", "-D")
        self.wait_for(lambda: self.call("sinfo", "--noheader", "--format=%T").strip() == "idle", "an idle node")

    def daemon(self, name, *words):
        log = (self.directory / f"{name}.log").open("w")
        self.daemons.append(subprocess.Popen([name, *words], env=self.environment | {"PATH": os.environ["PATH"] + ":/usr/sbin"}, stdin=subprocess.DEVNULL,
                                             stdout=log, stderr=log, start_new_session=True, preexec_fn=end_with_parent))

    def call(self, *words):
        """Output of a command of Slurm; empty if it fails."""
        return subprocess.run(words, env=self.environment, capture_output=True, text=True).stdout

    def wait_for(self, what, words, seconds=60):
        end = time.monotonic() + seconds
        while not what():
            dead = [d.args[0] for d in self.daemons if d.poll() is not None]
            if dead or time.monotonic() > end:
                logs = "".join(f"\n{d.args[0]}:\n" + "\n".join((self.directory / f"{d.args[0]}.log").read_text().splitlines()[-10:]) for d in self.daemons)
                raise SystemExit(f"slurm: {' and '.join(dead) + ' ended' if dead else f'no {words} after {seconds} s'}{logs}")
            time.sleep(0.5)

    def jobs(self):
        """[(number, name, state)] of what is in the queue."""
        return [tuple(line.split()) for line in self.call("squeue", "--noheader", "--format=%i %j %T").splitlines()]

    def state(self, job):
        """JobState and others of a job, {key: value}; also some minutes after its end."""
        return dict(word.split("=", 1) for word in self.call("scontrol", "--oneliner", "show", "job", str(job)).split() if "=" in word)

    def stop(self):
        if len(self.daemons) == 3 and self.daemons[1].poll() is None:
            for number, *_ in self.jobs():
                self.call("scancel", number)
            end = time.monotonic() + 20
            while self.jobs() and time.monotonic() < end:
                time.sleep(0.5)
        for daemon in reversed(self.daemons):
            daemon.terminate()
            try:
                daemon.wait(15)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
