#!/usr/bin/env python3
"""Stands in for LIGGGHTS: fails in the next way of a list, and is the real one when the list is at its end."""

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

REAL = os.environ["FAULTS_REAL_LIGGGHTS"]
LIST = Path(os.environ["FAULTS_LIST"])
MEMORY = 60_000_000
"""Bytes of address space: too few for LIGGGHTS to start or to run."""


def next_way() -> str:
    """Take the first word off the list, and note when it was used."""
    words = LIST.read_text().split()
    LIST.write_text("\n".join(words[1:]))
    if words:
        with LIST.with_suffix(".used").open("a") as stream:
            stream.write(f"{words[0]} {time.time()}\n")
    return words[0] if words else ""


def real() -> int:
    """Run LIGGGHTS itself."""
    return subprocess.call([REAL, *sys.argv[1:]])


def spoil(way: str) -> None:
    """Damage the final dump of a run that went well."""
    dump = Path("final.dump")
    lines = dump.read_text().splitlines()
    words = lines[-1].split()
    if way == "dump_truncated":
        lines = lines[: len(lines) // 2]
    elif way == "dump_empty":
        lines = []
    elif way == "sphere_missing":
        lines[3] = str(int(lines[3]) - 1)
        lines.pop()
    elif way == "not_a_number":
        lines[-1] = " ".join([*words[:2], "nan", *words[3:]])
    elif way == "sphere_outside":
        lines[-1] = " ".join([*words[:4], "-1e6", *words[5:]])
    elif way == "sphere_twice":
        lines[-1] = lines[-2]
    dump.write_text("".join(f"{line}\n" for line in lines))


way = next_way()
if way == "garbage":
    sys.stdout.buffer.write(os.urandom(20_000))
elif way == "garbage_dump":
    Path("final.dump").write_bytes(os.urandom(20_000))
    print("@finished 1000")
elif way == "dies_with_status_0":
    print("LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled)")
elif way == "dies_with_status_3":
    sys.exit(3)
elif way == "hangs":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(3600)
elif way == "wrong_version":
    print("LAMMPS (2 Aug 2023)\nunits micro\natom_style granular\nERROR: Unknown atom style granular")
    sys.exit(1)
elif way == "not_a_program":
    os.execv("/bin/sh", ["sh", "-c", "exec /nonexistent/liggghts"])
elif way == "memory_limit":
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    os.execv(REAL, [REAL, *sys.argv[1:]])
elif way == "memory_killed":
    child = subprocess.Popen([REAL, *sys.argv[1:]])
    time.sleep(0.2)
    child.kill()
    child.wait()
    os.kill(os.getpid(), signal.SIGKILL)
elif way:
    status = real()
    spoil(way)
    sys.exit(status)
else:
    os.execv(REAL, [REAL, *sys.argv[1:]])
