"""Run one input and say what became of it: loaded, refused, or one of the outcomes that must not be."""

from __future__ import annotations

import errno
import os
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mutation

from filtercake.errors import FiltercakeError

GOOD = ("loaded", "refused")
BAD = ("traceback", "unclear", "too slow", "too much memory", "wrote outside", "ran something")
CPU_SECONDS, WALL_SECONDS = 20, 120
LARGEST_GROWTH = 2 * 1024**3
"""Bytes of address space that one input may add."""
LONGEST_MESSAGE = 20_000
HARMLESS = ("/__pycache__/", "/dev/null")
"""Python's own cache of compiled code."""
CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.symlink", "os.link", "os.rmdir", "os.truncate", "os.chmod")
STARTS = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect", "pty.spawn")
PROGRAMS = ("git", "liggghts", "/usr/bin/liggghts")
"""Programs that an export asks for their versions."""


class OutOfTime(BaseException):
    """An input takes too long; not an Exception, so that nothing mistakes it for one."""


class Watch:
    """Notes what a process opens for writing and what programs it starts, and prevents both outside its folder."""

    _installed: Watch | None = None

    def __init__(self) -> None:
        self.allowed = ""
        self.named: tuple[str, ...] = ()
        self.on = False
        self.written: list[str] = []
        self.started: list[str] = []

    @classmethod
    def install(cls) -> Watch:
        """Return the process's watch: a hook, once there, stays."""
        if cls._installed is None:
            cls._installed = cls()
            sys.addaudithook(cls._installed.hear)
        return cls._installed

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Take note of an event of the interpreter."""
        if not self.on:
            return
        if event == "open":
            path, _, flags = arguments
            if isinstance(path, (str, bytes, os.PathLike)) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                self._note(path)
        elif event in CHANGES:
            self._note(arguments[0])
        elif event in STARTS and str(arguments[0]) not in PROGRAMS:
            self.started.append(f"{event} {arguments[0]}")
            raise PermissionError(errno.EACCES, "prevented")

    def _note(self, path: Any) -> None:
        where = os.path.realpath(os.fsdecode(path))
        inside = where == self.allowed or where.startswith((self.allowed + "/", tempfile.gettempdir() + "/pymp-"))
        if inside or any(part in where for part in HARMLESS):
            return
        if not where.startswith(self.named):
            self.written.append(where)
        raise PermissionError(errno.EACCES, "prevented")

    @contextmanager
    def __call__(self, named: Iterable[str] = ()) -> Iterator[None]:
        """Listen for the time of one input; ``named`` are the paths that a user asked for by name."""
        self.named = tuple(os.path.dirname(os.path.realpath(_writable(name))) for name in named)  # noqa: PTH120
        self.written, self.started, self.on = [], [], True
        try:
            yield
        finally:
            self.on = False


@contextmanager
def limits() -> Iterator[None]:
    """Bound time and memory of one input."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)

    def end(*_: Any) -> None:
        raise OutOfTime

    handlers = {number: signal.signal(number, end) for number in (signal.SIGALRM, signal.SIGPROF)}
    resource.setrlimit(resource.RLIMIT_AS, (used + LARGEST_GROWTH, before[1]))
    signal.setitimer(signal.ITIMER_PROF, CPU_SECONDS)
    signal.setitimer(signal.ITIMER_REAL, WALL_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)


def outcome_of(
    act: Callable[[], None], watch: Watch, names: tuple[str, ...], named: Iterable[str] = ()
) -> tuple[str, str]:
    """Run one input.

    Parameters
    ----------
    act : callable
        Loads it.
    watch : Watch
        What notices writing and programs.
    names : tuple of str
        One of them must stand in a refusal.
    named : iterable of str
        Paths that the user asked for by name: not even there is anything written, but to try is no fault.

    Returns
    -------
    (str, str)
        One of ``GOOD`` or ``BAD``, and what was said.
    """
    found, said = "loaded", ""
    with watch(named), limits(), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            act()
        except FiltercakeError as error:
            found, said = "refused", str(error)
        except OutOfTime:
            found = "too slow"
        except MemoryError:
            found = "too much memory"
        except BaseException as error:  # whatever it is, it is what is looked for
            found, said = "traceback", f"{type(error).__name__}: {error}"[:2000]
            said += "\n" + "".join(traceback.format_tb(error.__traceback__)[-4:])
    if watch.started or Path(mutation.CANARY).exists():
        return "ran something", f"{watch.started} {said}"
    if watch.written:
        return "wrote outside", f"{watch.written} {said}"
    if found == "refused" and not _clear(said, names):
        return "unclear", said[:2000]
    return found, said


def _writable(name: str) -> str:
    """Return a name as a file system could hold it."""
    return name.encode("utf-8", "replace").decode()


def _clear(said: str, names: tuple[str, ...]) -> bool:
    """Whether a refusal names a file, is one or more printable lines, and no book."""
    visible = all(line.isprintable() for line in said.splitlines())
    return visible and any(name in said for name in names) and len(said) <= LONGEST_MESSAGE
