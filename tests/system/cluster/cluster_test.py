#!/usr/bin/env python3
"""Campaigns on a cluster: a real Slurm of one node, which this test starts without systemd and ends again.

Usage: cluster_test.py TILTPROOF

Exit code 77, and the reason, where Slurm cannot be started.
"""
import getpass
import os
import pathlib
import pwd
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
ENVIRONMENT = {**os.environ, "PATH": os.environ["PATH"] + ":/usr/sbin:/sbin"}
HOVER = """\
name: hover
duration_s: 1.2
reference: {type: hover, at_m: [0, 0, 2]}
criteria:
  - {name: near, stl: "always(position_error_m <= 0.1)"}
"""
NIGHT = """\
campaign: night
scenarios: [hover.yaml]
runs_count: 120
seed: 5
draw: {types: ["actuator.*", "plant.*", frame.drop]}
"""
CONFIG = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldPort={controller}
SlurmdPort={daemon}
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MailProg=/bin/true
ReturnToService=2
NodeName={host} CPUs=2 NodeAddr=127.0.0.1 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


class Unavailable(Exception):
    """No Slurm can be started here."""


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Slurm:
    """munged, slurmctld and slurmd, in the foreground, as this user."""

    def __init__(self, folder):
        self.folder, self.daemons = folder, []
        for program in ("munged", "slurmctld", "slurmd", "sbatch", "squeue"):
            if not shutil.which(program, path=ENVIRONMENT["PATH"]):
                raise Unavailable(f"there is no {program} (packages slurmctld, slurmd, slurm-client, munge)")
        for name in ("state", "spool"):
            (folder / name).mkdir()
        folder.chmod(0o755)
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        self.config = folder / "slurm.conf"
        self.config.write_text(CONFIG.format(host=socket.gethostname().split(".")[0], user=pwd.getpwuid(os.getuid()).pw_name, folder=folder, controller=free_port(), daemon=free_port()))
        ENVIRONMENT["SLURM_CONF"] = str(self.config)

    def start(self):
        self.daemon("munged", "--foreground", "--force", f"--socket={self.folder}/munge.socket", f"--key-file={self.folder}/munge.key", f"--pid-file={self.folder}/munged.pid", f"--seed-file={self.folder}/munge.seed", f"--log-file={self.folder}/munged.log")
        self.wait(lambda: (self.folder / "munge.socket").exists(), "munged does not start")
        self.daemon("slurmctld", "-D", "-f", self.config)
        self.daemon("slurmd", "-D", "-f", self.config)
        self.wait(lambda: subprocess.run(["sinfo", "--noheader", "--format=%t"], env=ENVIRONMENT, capture_output=True, text=True, check=False).stdout.strip() == "idle", "no node becomes idle")

    def daemon(self, program, *arguments):
        with open(self.folder / f"{program}.out", "wb") as log:
            self.daemons.append(subprocess.Popen([program, *map(str, arguments)], env=ENVIRONMENT, stdout=log, stderr=log, start_new_session=True))

    def wait(self, condition, what):
        end = time.monotonic() + 60
        while not condition():
            ended = [daemon for daemon in self.daemons if daemon.poll() is not None]
            if ended or time.monotonic() > end:
                said = "; ".join(path.read_text(errors="replace").strip().splitlines()[-1] for path in sorted(self.folder.glob("*.out")) if path.stat().st_size)
                raise Unavailable(f"{what}: {said}")
            time.sleep(0.1)

    def stop(self):
        for daemon in reversed(self.daemons):
            daemon.terminate()
        for daemon in reversed(self.daemons):
            try:
                daemon.wait(20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


def tiltproof(folder, *arguments, codes):
    done = subprocess.run([PROGRAM, "campaign", *map(str, arguments)], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode in codes, (arguments, done.returncode, done.stdout, done.stderr)
    return done.stdout + done.stderr


def numbers(folder):
    with sqlite3.connect(f"file:{folder}/campaign.sqlite?mode=ro", uri=True) as database:
        return [row[0] for row in database.execute("SELECT number FROM run ORDER BY number")]



def tasks_of(folder):
    """The processes that fly a task of the campaign in this folder."""
    found = []
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if words[0] == os.fsencode(PROGRAM) and b"task" in words and os.fsencode(folder) in words:
            found.append(int(process.name))
    parents = set(found)
    return [pid for pid in found if int((pathlib.Path(f"/proc/{pid}/stat").read_text()).rsplit(")", 1)[1].split()[1]) not in parents]


def test(folder):
    (folder / "hover.yaml").write_text(HOVER)
    (folder / "night.yaml").write_text(NIGHT)
    tiltproof(folder, "night.yaml", "--out", "local", "--no-report", codes=(1,))
    summary = (folder / "local/campaign.json").read_bytes()

    # A task is killed in mid-flight, and is flown again; another one is flown twice at once.
    with subprocess.Popen([PROGRAM, "campaign", "night.yaml", "--executor", "slurm", "--task-runs", "30", "--out", "cluster", "--no-report"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        cluster = folder / "cluster"
        end = time.monotonic() + 60
        while not (victims := tasks_of(cluster)) and time.monotonic() < end and process.poll() is None:
            time.sleep(0.02)
        assert victims, process.stdout.read()
        os.kill(victims[0], signal.SIGKILL)
        status = tiltproof(folder, "status", "cluster", codes=(0,))
        assert "of 4 tasks were flown" in status and "Slurm's job" in status, status
        for twin in [subprocess.Popen([PROGRAM, "campaign", "task", "cluster", "4"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL) for _ in range(2)]:
            assert twin.wait(120) == 0
        said, _ = process.communicate(timeout=400)
    assert process.returncode == 1, said
    assert "of 4 tasks" in said and said.count("Slurm's job") >= 2, said  # the killed one came again
    assert numbers(cluster) == list(range(120))
    assert (cluster / "campaign.json").read_bytes() == summary
    assert "4 of 4 tasks were flown" in tiltproof(folder, "status", "cluster", codes=(0,))
    assert not list((cluster / "tasks").glob("*.sqlite*")), "gathered files are removed"

    # An interrupted campaign leaves its job, and goes on with it.
    with subprocess.Popen([PROGRAM, "campaign", "night.yaml", "--executor", "slurm", "--task-runs", "40", "--out", "cut", "--no-report"], cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        while not (folder / "cut/tasks/job").exists() and process.poll() is None:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 130 and "goes on; `scancel" in said and "--executor slurm`" in said, said
    said = tiltproof(folder, "--resume", "cut", "--executor", "slurm", "--no-report", codes=(1,))
    assert said.count("Slurm's job") <= 1 and (folder / "cut/campaign.json").read_bytes() == summary, said

    # A refusal of the cluster is an error with its reason.
    refused = subprocess.run([PROGRAM, "campaign", "night.yaml", "--executor", "slurm", "--out", "refused", "--no-report"], cwd=folder, env={**ENVIRONMENT, "SBATCH_PARTITION": "nowhere"}, capture_output=True, text=True, check=False, timeout=60)
    assert refused.returncode == 3 and "invalid partition" in refused.stderr, refused.stderr


def main():
    if sys.platform != "linux" or not getpass.getuser():
        raise Unavailable("this is not Linux")
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tiltproof-cluster-"))
    slurm = None
    try:
        (folder / "slurm").mkdir()
        slurm = Slurm(folder / "slurm")
        slurm.start()
        test(folder)
    finally:
        if slurm:
            slurm.stop()
        shutil.rmtree(folder, ignore_errors=True)


try:
    main()
except Unavailable as reason:
    print(f"not run: {reason}")
    sys.exit(77)
