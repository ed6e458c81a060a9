"""Read files and templates that users may edit: regular files of bounded size, UTF-8, YAML without surprises."""

from __future__ import annotations

import codecs
import os
import re
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

import yaml

from filtercake.errors import ConfigError, FiltercakeError, Problem, shown

if TYPE_CHECKING:
    import jinja2

LARGEST_YAML: Final = 200_000
"""Bytes of a configuration file beyond which it is surely not one."""

MOST_ZERO_BYTES: Final = 0.3
"""Share of zero bytes at every other place beyond which a text without a byte order mark is UTF-16."""

_BINARY: Final = re.compile("[\x00-\x08\x0e-\x1f\x7f]")
"""Control characters that no text has."""


class Unusable(FiltercakeError):  # noqa: N818 - reads better where it is caught
    """A file that cannot be used; the text says why, the caller says which."""


def read_text(path: Path, largest: int) -> str:
    """Read a regular UTF-8 file, with or without a byte order mark, of at most ``largest`` bytes.

    Raises
    ------
    Unusable
        If there is no such file, or it is not text of that size.
    """
    content = read_bytes(path, largest)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise Unusable(f"line {line}: must be UTF-8 text, not {content[error.start]:#x}") from None


def read_text_of_any_program(path: Path, largest: int) -> tuple[str, str]:
    """Read a regular text file as spreadsheets and instruments write it: UTF-8, UTF-16 or Windows-1252.

    Returns
    -------
    tuple of str
        The text, without its byte order mark, and the name of its encoding.

    Raises
    ------
    Unusable
        If there is no such file, or it is not text of that size.
    """
    content = read_bytes(path, largest)
    for encoding, mark in (("utf-8", codecs.BOM_UTF8), ("utf-16-le", b"\xff\xfe"), ("utf-16-be", b"\xfe\xff")):
        if content.startswith(mark):
            tried, content = [encoding], content[len(mark) :]
            break
    else:
        tried = ["utf-8", "cp1252"]
        for encoding, zeros in (("utf-16-le", content[1::2]), ("utf-16-be", content[::2])):
            if zeros.count(0) > MOST_ZERO_BYTES * len(zeros):
                tried = [encoding]
    for encoding in tried:
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not _BINARY.search(text):
            return text, encoding
    raise Unusable("is not text (UTF-8, UTF-16 or Windows-1252) but binary; export it as CSV or text")


def read_bytes(path: Path, largest: int) -> bytes:
    """Read a regular file of at most ``largest`` bytes.

    Devices and pipes are refused before anything is read: they may have no end, or wait for ever.

    Raises
    ------
    Unusable
        If there is no such file, or it is larger.
    """
    try:
        with open(path, "rb", opener=_without_waiting) as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise Unusable("must be a regular file, not a device or a pipe")
            content: bytes = stream.read(largest + 1)
    except OSError as error:
        raise Unusable(f"cannot be read ({error.strerror})") from None
    except ValueError:  # NUL or half a character in the path
        raise Unusable("cannot be read (no file has such a name)") from None
    if len(content) > largest:
        raise Unusable(f"must be at most {_size(largest)}")
    return content


def is_file(path: Path) -> bool:
    """Whether a path is a regular file; False where the path itself is impossible (too long, not allowed)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_yaml(path: Path) -> Any:
    """Parse a YAML file without tags, aliases that multiply, or surprises.

    Raises
    ------
    ConfigError
        If it cannot be read or is not YAML.
    """
    try:
        return yaml.load(read_text(path, LARGEST_YAML), Loader=_Loader)
    except Unusable as error:
        raise _problem(path, "(file)", str(error)) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else "(file)"
        raise _problem(path, where, f"not valid YAML: {error.problem}") from None
    except RecursionError:
        raise _problem(path, "(file)", "not valid YAML: nested too deeply") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise _problem(path, "(file)", f"not valid YAML: {' '.join(str(error).split())}") from None


def templates(folder: Path, *, html: bool = False) -> jinja2.Environment:
    """Return the templates of a folder, in which a name without a value is an error; values in HTML are escaped."""
    import jinja2  # most who read a file fill no template

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not html,
        autoescape=html,
    )


def _problem(path: Path, where: str, allowed: str) -> ConfigError:
    return ConfigError([Problem(str(path), where, "", allowed)])


def _without_waiting(path: str, flags: int) -> int:
    """Open without waiting for the other end of a pipe."""
    return os.open(path, flags | os.O_NONBLOCK)


def _size(size: int) -> str:
    return f"{size // 10**6} MB" if size >= 10**6 else f"{size // 10**3} kB"


class WrittenWhole(int):
    """A whole number that knows how it was written: 007 may be a name."""

    written: str

    def __repr__(self) -> str:
        """Return the number as it was written."""
        return self.written


class WrittenDecimal(float):
    """A number that knows how it was written: 1.0e5 may be a name."""

    written: str


def as_written(value: Any) -> Any:
    """Text of a number of a file, as it was written there; any other value as it is."""
    return value.written if isinstance(value, WrittenWhole | WrittenDecimal) else value


class _Loader(yaml.SafeLoader):
    """Safe YAML without tags, without aliases (they can multiply a small file into a huge one) and doubled keys.

    Keys are text as they are written, numbers know how they were written, and dates are text: names of studies and
    distributions may look like any of them.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            self._refuse("aliases (*name) are not allowed here", event.start_mark)
        if getattr(event, "tag", None) is not None:
            self._refuse("tags (!name) are not allowed here", event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                self._refuse("merge keys (<<) are not allowed here", key_node.start_mark)
            if isinstance(key_node, yaml.ScalarNode):
                key_node.tag = "tag:yaml.org,2002:str"
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, (list, dict)):
                self._refuse("keys must be plain text", key_node.start_mark)
            if key in seen:
                self._refuse(f"the key {shown(key)} stands twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)

    def construct_whole(self, node: yaml.ScalarNode) -> WrittenWhole:
        """Keep a whole number's text."""
        value = WrittenWhole(self.construct_yaml_int(node))
        value.written = node.value
        return value

    def construct_decimal(self, node: yaml.ScalarNode) -> WrittenDecimal:
        """Keep a number's text."""
        value = WrittenDecimal(self.construct_yaml_float(node))
        value.written = node.value
        return value

    def _refuse(self, text: str, mark: Any) -> NoReturn:
        raise yaml.constructor.ConstructorError(None, None, text, mark)


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_whole)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_decimal)
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in found if tag != "tag:yaml.org,2002:timestamp"]
    for first, found in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
