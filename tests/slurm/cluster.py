"""A private Slurm of two nodes on this machine: no munge, no database, everything in one folder."""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil

NODES = ("node1", "node2")
PROGRAMS = ("slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "scancel", "sinfo", "srun")

SLURM_CONF = """\
ClusterName=filtercake_test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
AuthType=auth/none
CredType=cred/none
SlurmUser={user}
SlurmdUser={user}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/log/slurmctld.log
SlurmdLogFile={folder}/log/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/log/jobcomp.txt
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout=15
KillWait=2
MinJobAge=3600
NodeName=node1 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[1]} CPUs=2 RealMemory=8000
NodeName=node2 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[2]} CPUs=2 RealMemory=8000
PartitionName=test Nodes=node1,node2 Default=YES DefaultTime=10 MaxTime=1000 State=UP
"""

# The executor plugin runs job steps without SLURM_CONF, which a cluster with its configuration in /etc/slurm does not
# need. A file "fail" or "delay" makes the next job step fail, or wait, once.
SRUN = """\
#!/bin/sh
if rm "{folder}/fail" 2>/dev/null; then echo "srun: asked to fail" >&2; exit 1; fi
if rm "{folder}/delay" 2>/dev/null; then sleep 600; fi
SLURM_CONF={folder}/slurm.conf exec {srun} "$@"
"""


def missing() -> list[str]:
    """Programs of Slurm that are not installed."""
    return [program for program in PROGRAMS if shutil.which(program) is None]


def wait_for(condition, seconds, what):
    """Wait until a condition holds; its value."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.3)
    raise AssertionError(f"waited {seconds} s for {what}")


class Cluster:
    """Its daemons, and what a user asks it."""

    def __init__(self, folder: Path):
        self.folder = folder
        for name in ("state", "spool", "log", "bin"):
            (folder / name).mkdir(parents=True)
        self.conf = folder / "slurm.conf"
        user = psutil.Process().username()
        text = SLURM_CONF.format(host=socket.gethostname().split(".")[0], ports=free_ports(3), folder=folder, user=user)
        self.conf.write_text(text)
        srun = folder / "bin" / "srun"
        srun.write_text(SRUN.format(folder=folder, srun=shutil.which("srun")))
        srun.chmod(0o755)
        path = os.pathsep.join([str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]])
        self.environment = {**os.environ, "SLURM_CONF": str(self.conf), "PATH": path}
        self.daemons: dict[str, subprocess.Popen] = {}

    def start(self) -> None:
        self._daemon("slurmctld", "slurmctld", "-D", "-c")
        for node in NODES:
            self.start_node(node)
        wait_for(lambda: self.idle() == set(NODES), 60, "both nodes to be idle; " + self.ask("sinfo", "-N"))

    def start_node(self, node: str) -> None:
        self._daemon(node, "slurmd", "-D", "-N", node)

    def _daemon(self, name: str, *command: str) -> None:
        output = (self.folder / "log" / f"{name}.out").open("w")
        self.daemons[name] = subprocess.Popen(
            command,
            env=self.environment,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=end_with_parent,
        )

    def ask(self, *command: str) -> str:
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60)
        return done.stdout.strip()

    def idle(self) -> set[str]:
        rows = [line.split() for line in self.ask("sinfo", "-N", "-h", "-o", "%N %T").splitlines()]
        return {row[0] for row in rows if len(row) == 2 and row[1] == "idle"}

    def jobs(self) -> dict[str, str]:
        """State of every job since the cluster started, by number."""
        lines = self.ask("squeue", "--states=all", "-h", "-o", "%i %T").splitlines()
        return dict(line.split() for line in lines)

    def running(self) -> str | None:
        """Number of a job that runs."""
        return next((job for job, state in self.jobs().items() if state == "RUNNING"), None)

    def node_of(self, job: str) -> str:
        return self.ask("squeue", "-h", "-j", job, "-o", "%N")

    def lose_node(self, node: str, job: str) -> None:
        """What a node that loses its power does: its daemon and its job are gone at once, and nobody is told."""
        lost = self.daemons.pop(node)
        lost.kill()
        lost.wait()
        for process in self._processes(job):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()

    def _processes(self, job: str | None = None) -> list[psutil.Process]:
        """Processes of this cluster's jobs, or of one of them."""
        steps, work = {}, []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                environment = process.environ()
                number = environment.get("SLURM_JOB_ID")
                if (
                    number is None
                    or str(self.folder) not in " ".join(environment.values())
                    or job not in (None, number)
                ):
                    continue
                work.append(process)
                # a step's daemon writes its title over its environment: it is known as the parent of the rest
                steps |= {parent.pid: parent for parent in process.parents() if parent.name() == "slurmstepd"}
        # the daemons first: what they live to see, they report
        return [*steps.values(), *work]

    def stop(self) -> None:
        for job, state in self.jobs().items():
            if state in ("RUNNING", "PENDING", "COMPLETING", "CONFIGURING"):
                self.ask("scancel", job)
        time.sleep(1.0)
        for daemon in self.daemons.values():
            daemon.send_signal(signal.SIGTERM)
        for daemon in self.daemons.values():
            try:
                daemon.wait(timeout=20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        for process in self._processes():
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()


def end_with_parent() -> None:
    """Ask Linux to end this process when the one that started it dies, killed or not."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


def free_ports(count: int) -> list[int]:
    """Ports that nobody listens on."""
    sockets = [socket.socket() for _ in range(count)]
    try:
        for item in sockets:
            item.bind(("127.0.0.1", 0))
        return [item.getsockname()[1] for item in sockets]
    finally:
        for item in sockets:
            item.close()
