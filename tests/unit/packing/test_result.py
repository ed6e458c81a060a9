"""Packings on disk: whole or absent, and only the one that was accepted is read back."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from filtercake.errors import PackingRejected
from filtercake.packing.result import Packing, publish, read_record, sealed, sha256, write_json


@pytest.fixture
def packing() -> Packing:
    rng = np.random.default_rng(1)
    return Packing(
        rng.random((50, 3)) * 1e-4, rng.random(50) * 1e-5, 1.2345678901234567e-4, {"steps": 7, "seed": 2**62}
    )


def others(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


# --- save and load -------------------------------------------------------------------------------------------------


def test_a_packing_is_read_back_to_the_last_bit(packing: Packing, tmp_path: Path) -> None:
    npz = tmp_path / "new" / "folder" / "r0.npz"
    checksum = packing.save(npz)
    again = Packing.load(npz)
    assert np.array_equal(again.position, packing.position)
    assert np.array_equal(again.radius, packing.radius)
    assert again.length == packing.length
    assert again.diagnostics == {"steps": 7, "seed": 2**62, "sha256": checksum}
    assert checksum == hashlib.sha256(npz.read_bytes()).hexdigest() == sha256(npz)
    assert others(npz.parent) == {"r0.npz", "r0.json"}


def test_the_same_packing_makes_the_same_file(packing: Packing, tmp_path: Path) -> None:
    assert packing.save(tmp_path / "a.npz") == packing.save(tmp_path / "b.npz")


def test_saving_again_replaces_both_files(packing: Packing, tmp_path: Path) -> None:
    npz = tmp_path / "r0.npz"
    packing.save(npz)
    Packing(packing.position[:10], packing.radius[:10], 1.0, {"steps": 8}).save(npz)
    assert len(Packing.load(npz).radius) == 10
    assert Packing.load(npz).diagnostics["steps"] == 8


def test_another_geometry_than_the_accepted_one_is_refused(packing: Packing, tmp_path: Path) -> None:
    npz = tmp_path / "r0.npz"
    packing.save(npz)
    record = (tmp_path / "r0.json").read_bytes()
    Packing(packing.position * 1.0001, packing.radius, packing.length).save(npz)
    (tmp_path / "r0.json").write_bytes(record)
    with pytest.raises(PackingRejected, match=r"r0\.npz is not the file that was accepted \(checksum differs\)"):
        Packing.load(npz)


@pytest.mark.parametrize("keep", [0, 1, 100, -1])
def test_a_truncated_geometry_is_refused(packing: Packing, tmp_path: Path, keep: int) -> None:
    npz = tmp_path / "r0.npz"
    packing.save(npz)
    npz.write_bytes(npz.read_bytes()[:keep])
    with pytest.raises(PackingRejected, match="not the file that was accepted"):
        Packing.load(npz)


def test_one_flipped_bit_is_refused(packing: Packing, tmp_path: Path) -> None:
    npz = tmp_path / "r0.npz"
    packing.save(npz)
    content = bytearray(npz.read_bytes())
    content[len(content) // 2] ^= 1
    npz.write_bytes(content)
    with pytest.raises(PackingRejected, match="checksum differs"):
        Packing.load(npz)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK\x03\x04 not a zip",
        b"garbage" * 100,
    ],
)
def test_garbage_with_a_matching_checksum_is_still_refused(packing: Packing, tmp_path: Path, content: bytes) -> None:
    npz = tmp_path / "r0.npz"
    packing.save(npz)
    npz.write_bytes(content)
    write_json(tmp_path / "r0.json", sealed({"sha256": sha256(npz)}))
    with pytest.raises(PackingRejected, match=r"r0\.npz cannot be read"):
        Packing.load(npz)


def test_an_archive_without_radii_is_refused(tmp_path: Path) -> None:
    npz = tmp_path / "r0.npz"
    np.savez(npz, position=np.zeros((1, 3)))
    write_json(tmp_path / "r0.json", sealed({"sha256": sha256(npz)}))
    with pytest.raises(PackingRejected, match="cannot be read"):
        Packing.load(npz)


def test_missing_files_are_refused_by_name(packing: Packing, tmp_path: Path) -> None:
    npz = tmp_path / "r0.npz"
    with pytest.raises(PackingRejected, match=r"r0\.json cannot be read"):
        Packing.load(npz)
    packing.save(npz)
    (tmp_path / "r0.json").unlink()
    with pytest.raises(PackingRejected, match=r"r0\.json cannot be read"):
        Packing.load(npz)
    packing.save(npz)
    npz.unlink()
    with pytest.raises(PackingRejected, match=r"r0\.npz cannot be read"):
        Packing.load(npz)


@pytest.mark.parametrize("text", ["", "{", '{"sha256": ', "[]", '"text"', "null", "\x00\x00", "1e5"])
def test_a_damaged_record_is_refused(packing: Packing, tmp_path: Path, text: str) -> None:
    npz = tmp_path / "r0.npz"
    packing.save(npz)
    (tmp_path / "r0.json").write_text(text, encoding="utf-8")
    with pytest.raises(PackingRejected, match=r"r0\.json"):
        Packing.load(npz)


def test_a_record_that_is_not_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "r0.json").write_bytes(b"\xff\xfe\x80")
    with pytest.raises(PackingRejected, match="cannot be read"):
        read_record(tmp_path / "r0.json")


def test_nan_never_reaches_a_record(packing: Packing, tmp_path: Path) -> None:
    with pytest.raises(ValueError):
        Packing(packing.position, packing.radius, 1.0, {"energy": float("nan")}).save(tmp_path / "r0.npz")
    # the geometry may lie there, but without its record it is no packing
    with pytest.raises(PackingRejected):
        Packing.load(tmp_path / "r0.npz")


# --- publishing ----------------------------------------------------------------------------------------------------


class BoomError(Exception):
    """An error in the middle of writing."""


@pytest.mark.parametrize("error", [BoomError, KeyboardInterrupt, SystemExit])
def test_an_error_leaves_the_old_file_and_no_temporary_one(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "table.csv"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(error), publish(path) as temporary:
        temporary.write_text("half of the n", encoding="utf-8")
        raise error
    assert path.read_text(encoding="utf-8") == "old"
    assert others(tmp_path) == {"table.csv"}


def test_an_error_where_there_was_no_file_leaves_none(tmp_path: Path) -> None:
    with pytest.raises(BoomError), publish(tmp_path / "table.csv") as temporary:
        temporary.write_text("half", encoding="utf-8")
        raise BoomError
    assert others(tmp_path) == set()


def test_nothing_is_published_before_the_end(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "table.csv"
    with publish(path) as temporary:
        temporary.write_text("new", encoding="utf-8")
        assert not path.exists()
        assert temporary.parent == path.parent  # same file system, or the move were a copy
    assert path.read_text(encoding="utf-8") == "new"
    assert others(path.parent) == {"table.csv"}
    assert path.stat().st_mode & 0o777 == 0o644


def test_a_block_that_removes_its_file_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("old", encoding="utf-8")
    with pytest.raises(FileNotFoundError), publish(path) as temporary:
        temporary.unlink()
    assert path.read_text(encoding="utf-8") == "old"


def test_json_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    write_json(path, {"a": 1})
    for bad in ({"a": object()}, {"a": float("inf")}):
        with pytest.raises((TypeError, ValueError)):
            write_json(path, bad)
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": 1}
    assert others(tmp_path) == {"r.json"}
