"""What LIGGGHTS prints and dumps, complete, cut short or garbled, is read without surprise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filtercake.errors import EngineError
from filtercake.packing.engines.liggghts import check_end, read_dump
from filtercake.packing.engines.liggghts_log import LiggghtsLog, parse_log, trajectory

DATA = Path(__file__).resolve().parents[2] / "data" / "liggghts"

COMPLETE = """\
LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled 2022-01-26-19:42:32 by buildd, git commit unknown)
units           micro
read_data       cloud.data
WARNING: Something is odd (./src/somewhere.cpp:12)
print           "@state ${now} ${height} ${energy} ${sampled}"
@state 0 143.75 83.5 836564.25
Dangerous builds = 0
@state 400 100.5 12.5 936564.25
@state 800 62.25 0.5 1666950
Dangerous builds = 0
print           "@finished ${now}"
@finished 800
"""


def read(name: str) -> str:
    return (DATA / name).read_text(encoding="utf-8", errors="replace")


# --- handmade output -----------------------------------------------------------------------------------------------


def test_a_complete_output() -> None:
    log = parse_log(COMPLETE)
    assert log.version == "LIGGGHTS-PUBLIC 3.8.0"
    assert log.error is None
    assert log.warnings == ("Something is odd (./src/somewhere.cpp:12)",)
    assert log.states.tolist() == [
        [0, 143.75, 83.5, 836564.25],
        [400, 100.5, 12.5, 936564.25],
        [800, 62.25, 0.5, 1666950],
    ]
    assert (log.dangerous_builds, log.inserted, log.finished_step, log.forced_end) == (0, None, 800, False)
    assert log.last_line == "@finished 800"


def test_the_states_in_si() -> None:
    # one sphere of 10 um radius and 1180 kg/m3 in the sample region weighs 4/3 pi 1000 um3 * 1.18 pg/um3
    mass = 4.0 / 3.0 * np.pi * 1000.0 * 1.18
    log = parse_log(f"@state 200 50 2.5 {mass!r}\n")
    record = trajectory(log, time_step=0.5e-6, length=40e-6, density=1180.0)
    assert record.time == pytest.approx([1e-4])
    assert record.mean_height == pytest.approx([50e-6])
    assert record.kinetic_energy == pytest.approx([2.5e-15])  # 1 pg um2/us2 = 1e-15 kg m2/s2
    assert record.porosity_sample == pytest.approx([1.0 - 4.0 / 3.0 * np.pi * 1e3 / 40.0**3])


def test_no_states_make_an_empty_trajectory() -> None:
    record = trajectory(parse_log(""), 1e-6, 1e-4, 1180.0)
    assert record.time.size == record.mean_height.size == record.kinetic_energy.size == record.porosity_sample.size == 0


@pytest.mark.parametrize("text", ["", "\n\n  \n", "\x00\x01\x02"])
def test_an_output_without_words(text: str) -> None:
    log = parse_log(text)
    assert (log.version, log.error, log.finished_step) == ("unknown", None, None)
    assert log.states.shape == (0, 4)


def test_the_first_error_counts_with_the_line_that_was_being_read() -> None:
    log = parse_log(
        "units micro\ntimestepp 0.4\nERROR: Unknown command: timestepp (./src/input.cpp:259)\nERROR: more\n"
    )
    assert log.error == "Unknown command: timestepp (./src/input.cpp:259) (while reading: timestepp 0.4)"


@pytest.mark.parametrize("prefix", ["ERROR: ", "ERROR on proc 0: ", "ERROR on proc 12: "])
def test_errors_of_any_process(prefix: str) -> None:
    assert parse_log(f"run 5\n{prefix}Lost atoms: original 60 current 59\n").error == (
        "Lost atoms: original 60 current 59 (while reading: run 5)"
    )


def test_the_echo_of_the_deck_is_not_taken_for_its_output() -> None:
    log = parse_log(
        'print "@finished ${now}"\nprint "@state ${now} ${height}"\nprint "ERROR: no"\nprint "got SIGTERM"\n'
    )
    assert (log.finished_step, log.error, log.forced_end, len(log.states)) == (None, None, False, 0)


def test_a_state_cut_short_is_left_out() -> None:
    whole = "@state 0 1 2 3\n@state 400 100.5 12.5 936564.25\n"
    for cut in range(len(whole)):
        states = parse_log(whole[:cut]).states
        assert states.shape[0] <= 2
        assert states.shape[1] == 4
    assert parse_log("@state 0 1 2\n@state a b c d\n@state\n@state 1 2 3 4 5\n").states.shape == (0, 4)


def test_warnings_are_kept_once_each_in_order() -> None:
    assert parse_log("WARNING: b\nWARNING on proc 1: a\nWARNING: b\n").warnings == ("b", "a")


@pytest.mark.parametrize(
    ("lines", "count"),
    [
        ("Dangerous builds = 3\n", 3),
        ("Dangerous builds = 0\nDangerous builds = 2\nDangerous builds = 0\n", 2),
        ("Dangerous builds = \n", 0),
    ],
)
def test_dangerous_builds(lines: str, count: int) -> None:
    assert parse_log(lines).dangerous_builds == count


@pytest.mark.parametrize(
    "line",
    [
        "SIGINT/SIGTERM caught - Writing restart on next occasion and quitting after that.",
        "mpirun noticed that process rank 0 with PID 5 on node n exited on signal 9 (Killed).",
    ],
)
def test_signals_are_noticed(line: str) -> None:
    assert parse_log(COMPLETE + line + "\n").forced_end


@given(st.text(max_size=400))
def test_any_text_is_parsed(text: str) -> None:
    log = parse_log(text)
    assert isinstance(log, LiggghtsLog)
    assert log.states.shape[1] == 4


WORDS = [
    "@state",
    "@finished",
    "ERROR",
    " on proc 0",
    ": ",
    "WARNING",
    "Dangerous builds = ",
    "1",
    "2.5",
    "nan",
    "-",
    "\n",
    " ",
]
WORDS += [
    "LIGGGHTS (Version ",
    ")",
    ", compiled",
    "inserted 5 particle",
    "insertion",
    "SIGTERM",
    "٣",
    "1e999",
    "\r",
    "\x85",
]


@given(st.lists(st.sampled_from(WORDS), max_size=40).map("".join))
def test_any_mixture_of_its_own_words_is_parsed(text: str) -> None:
    assert parse_log(text).states.shape[1] == 4


def test_a_very_long_number_is_parsed() -> None:
    assert parse_log("Dangerous builds = " + "9" * 5000).states.shape[1] == 4


@given(st.integers(0, 12_000))
def test_any_beginning_of_a_real_output_is_parsed_and_never_taken_for_a_good_end(cut: int) -> None:
    text = read("screen.log")
    beginning = text[:cut]
    log = parse_log(beginning)
    if "\n@finished 1" not in beginning:
        assert log.finished_step is None
        with pytest.raises(EngineError):
            check_end(0, log)


# --- real output ---------------------------------------------------------------------------------------------------


def test_a_real_run() -> None:
    log = parse_log(read("screen.log"))
    assert log.version == "LIGGGHTS-PUBLIC 3.8.0"
    assert (log.error, log.forced_end, log.dangerous_builds, log.inserted) == (None, False, 0, None)
    assert log.states[:, 0].tolist() == [0, 400, 800, 1200]
    assert log.finished_step == 1200
    assert log.states[0, 3] == pytest.approx(836564.235748914, rel=1e-14)  # as printed
    check_end(0, log)


def test_a_real_input_error() -> None:
    log = parse_log(read("error.log"))
    assert log.error is not None
    assert log.error.startswith("Unknown command: timestepp")
    with pytest.raises(EngineError, match=r"^LIGGGHTS: Unknown command: timestepp") as caught:
        check_end(1, log)
    assert not caught.value.transient


def test_a_real_sigterm_with_its_exit_status_zero() -> None:
    log = parse_log(read("sigterm.log"))
    assert log.forced_end
    assert log.finished_step is None
    with pytest.raises(EngineError, match="asked to stop by a signal") as caught:
        check_end(0, log)
    assert caught.value.transient


def test_a_real_insertion() -> None:
    assert parse_log(read("as_published_head.log")).inserted == 60


# --- how a run ended -----------------------------------------------------------------------------------------------


def test_a_good_end_raises_nothing() -> None:
    check_end(0, parse_log(COMPLETE))


@pytest.mark.parametrize(
    ("status", "text", "says", "transient"),
    [
        (0, "run 5\nERROR: Illegal run command\n", "LIGGGHTS: Illegal run command (while reading: run 5)", False),
        (1, COMPLETE + "ERROR: late\n", "LIGGGHTS: late", False),
        (-9, "run 5\n", "killed by signal 9", True),
        (-11, COMPLETE, "killed by signal 11", True),
        (0, COMPLETE + "SIGINT/SIGTERM caught - Writing restart\n", "asked to stop by a signal", True),
        (137, "run 5\n", "ended with status 137; its last line: 'run 5'", True),
        (1, COMPLETE, "ended with status 1", True),
        (127, "stdbuf: failed to run command\n", "its last line: 'stdbuf: failed to run command'", True),
        (0, COMPLETE.replace("\n@finished 800", ""), "ended before its deck did (stopped, or disk full)", True),
        (0, "", "ended before its deck did", True),
    ],
)
def test_every_bad_end_is_an_error_in_words(status: int, text: str, says: str, transient: bool) -> None:
    with pytest.raises(EngineError) as caught:
        check_end(status, parse_log(text))
    assert says in str(caught.value)
    assert caught.value.transient is transient


def test_an_error_in_the_input_stays_one_and_another_program_may_be_replaced() -> None:
    banner = "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled 2020)\n"
    for text, may_pass in ((banner, False), ("LAMMPS (2 Aug 2023)\n", True)):
        with pytest.raises(EngineError) as caught:
            check_end(1, parse_log(text + "run 5\nERROR: Unknown command: rum\n"))
        assert (caught.value.transient, caught.value.may_pass) == (False, may_pass)


# --- dumps ---------------------------------------------------------------------------------------------------------

HEADER = "ITEM: TIMESTEP\n800\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS pp pp ff\n0 140\n0 140\n-25 300\n"
COLUMNS = "ITEM: ATOMS id type x y z vx vy vz radius \n"
ROWS = ["2 1 10 20 30 0.001 0.002 -0.003 15", "1 1 40 50 60.5 0 0 0 25", "3 1 70 80 90 0 0 0 15"]


def dump(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "final.dump"
    path.write_text(text, encoding="ascii", errors="replace")
    return path


def good_dump(rows: list[str] = ROWS, promised: int = 3, columns: str = COLUMNS) -> str:
    return HEADER.format(n=promised) + columns + "".join(row + "\n" for row in rows)


def test_a_good_dump_in_si_and_in_the_order_of_the_cloud(tmp_path: Path) -> None:
    position, velocity, radius = read_dump(dump(tmp_path, good_dump()))
    assert position == pytest.approx(np.array([[40, 50, 60.5], [10, 20, 30], [70, 80, 90]]) * 1e-6)
    assert velocity == pytest.approx(np.array([[0, 0, 0], [0.001, 0.002, -0.003], [0, 0, 0]]))  # um/us = m/s
    assert radius == pytest.approx(np.array([25, 15, 15]) * 1e-6)


def test_a_real_dump() -> None:
    position, velocity, radius = read_dump(DATA / "final.dump")
    assert position.shape == velocity.shape == (60, 3)
    assert np.unique(radius.round(12)) == pytest.approx([15e-6, 25e-6])
    assert np.all(np.isfinite(velocity))


def test_nan_in_a_dump_is_left_to_acceptance(tmp_path: Path) -> None:
    position, _, _ = read_dump(dump(tmp_path, good_dump([ROWS[0], ROWS[1].replace("60.5", "nan"), ROWS[2]])))
    assert np.isnan(position[0, 2])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty or cut short"),
        (HEADER.format(n=3), "empty or cut short"),
        (good_dump(columns="ITEM: ATOMS id type x y z radius \n"), "empty or cut short (no atom table)"),
        (good_dump(columns="ITEM: ATOMS id type z y x vx vy vz radius \n"), "no atom table"),
        (good_dump(ROWS[:2]), "promises 3 atoms but holds 2"),
        (good_dump([]), "promises 3 atoms but holds 0"),
        (good_dump([], promised=0), "promises 0 atoms but holds 0"),
        (good_dump(promised=2), "promises 2 atoms but holds 3"),
        (good_dump([*ROWS[:2], "3 1 70 80"]), "cut short or garbled in a row"),
        (good_dump([*ROWS[:2], "3 1 70 80 90 0 0 0 x"]), "cut short or garbled in a row"),
        (good_dump([*ROWS[:2], "\x00" * 30]), "cut short or garbled in a row"),
        (good_dump().replace("ITEM: NUMBER OF ATOMS\n3\n", ""), "cut short or garbled"),
        (good_dump().replace("ATOMS\n3\n", "ATOMS\nthree\n"), "cut short or garbled"),
        ("\x00" * 4096, "empty or cut short"),
    ],
)
def test_a_bad_dump_is_refused_and_may_be_tried_again(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(EngineError) as caught:
        read_dump(dump(tmp_path, text))
    assert says in str(caught.value)
    assert caught.value.transient


def test_a_missing_dump_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="final dump cannot be read: No such file"):
        read_dump(tmp_path / "final.dump")
    with pytest.raises(EngineError, match="final dump cannot be read"):
        read_dump(tmp_path)


@given(st.data())
def test_a_real_dump_cut_anywhere_before_its_last_number_is_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    text = read("final.dump")
    cut = data.draw(st.integers(0, len(text.rstrip()) - len(text.split()[-1]) - 1))
    path = tmp_path_factory.getbasetemp() / "cut.dump"
    path.write_text(text[:cut], encoding="ascii")
    with pytest.raises(EngineError):
        read_dump(path)


def test_a_dump_cut_within_its_last_number_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EngineError):
        read_dump(dump(tmp_path, good_dump().rstrip()[:-1]))


def test_a_dump_with_an_atom_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EngineError):
        read_dump(dump(tmp_path, good_dump([ROWS[0], ROWS[1], ROWS[1]])))
