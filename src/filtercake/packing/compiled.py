"""Compiled kernels, with a cache on disk that never stands in the way.

Numba's own cache ends a run when one of its files is damaged, refuses to import where it finds nowhere to write, and
writes a file for every kernel at import. Here a damaged file is made anew, a place in the temporary folder or none at
all will do, and nothing is opened before a kernel is first called.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, overload

from numba import njit
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    InTreeCacheLocator,
    NullCache,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)

F = TypeVar("F", bound=Callable[..., Any])


@overload
def cached_njit(function: F) -> F: ...


@overload
def cached_njit(function: None = None, **options: Any) -> Callable[[F], F]: ...


def cached_njit(function: Any = None, **options: Any) -> Any:
    """Compile a function when it is first called, as :func:`numba.njit` with these options; kept on disk."""
    if function is None:
        return lambda found: _compile(found, options)
    return _compile(function, options)


def _compile(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    dispatcher = njit(**options)(function)
    dispatcher._cache = KernelCache(function)
    return dispatcher


class KernelCache(NullCache):
    """The compiled forms of one function on disk: opened late, and done without where that fails."""

    def __init__(self, function: Callable[..., Any]):
        self.function = function

    @cached_property
    def files(self) -> Any:
        """Numba's cache of the function; one that holds nothing where nowhere can be written."""
        try:
            return _Files(self.function)  # type: ignore[no-untyped-call]
        except RuntimeError:
            return NullCache()

    @property
    def cache_path(self) -> Any:
        """Folder of the files, None without any."""
        return self.files.cache_path

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled form for a signature, None where there is none or it is damaged."""
        try:
            return self.files.load_overload(sig, target_context)
        except Exception:  # a truncated or spoilt file raises whatever unpickling meets
            self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled form, where there is room."""
        try:
            self.files.save_overload(sig, data)
        except OSError:
            self.flush()
        except Exception:  # the index it would add to is damaged
            self.flush()
            self.files.save_overload(sig, data)

    def flush(self) -> None:
        """Forget what is kept, if it may be written."""
        try:
            self.files.flush()
        except OSError:
            self.__dict__["files"] = NullCache()


class _TemporaryLocator(UserWideCacheLocator):
    """A folder in the temporary folder that nobody else may write: what is read from it is run."""

    def __init__(self, py_func: Any, py_file: str):
        super().__init__(py_func, py_file)  # type: ignore[no-untyped-call]
        self.own = Path(tempfile.gettempdir()) / f"filtercake-{os.getuid()}"
        self._cache_path = str(self.own / self.get_suitable_cache_subpath(py_file))  # type: ignore[no-untyped-call]

    def ensure_cache_path(self) -> None:
        self.own.mkdir(mode=0o700, exist_ok=True)
        found = self.own.lstat()
        shared = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or shared:
            raise PermissionError(f"{self.own} can be written by others")
        super().ensure_cache_path()  # type: ignore[no-untyped-call]


class _Results(CompileResultCacheImpl):
    _locator_classes = [UserProvidedCacheLocator, InTreeCacheLocator, UserWideCacheLocator, _TemporaryLocator]  # noqa: RUF012


class _Files(FunctionCache):
    """Numba's cache, which sees changes of a function's own file alone; here also of the kernels it calls in others."""

    _impl_class = _Results

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (*super()._index_key(sig, codegen), *self._borrowed)  # type: ignore[no-untyped-call]

    @cached_property
    def _borrowed(self) -> tuple[str, ...]:
        """Digests of the modules with kernels that the function's own module names, and of those that they name."""
        found: dict[str, ModuleType] = {}
        waiting = [self._py_func.__globals__]
        while waiting:
            for value in waiting.pop().values():
                if (
                    isinstance(value, ModuleType)
                    and value.__name__.endswith("_kernels")
                    and value.__name__ not in found
                ):
                    found[value.__name__] = value
                    waiting.append(vars(value))
        files = sorted(str(module.__file__) for module in found.values())
        return tuple(hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files)
