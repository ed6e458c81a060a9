"""Files of measurements: what is read, every repair said, and all that is wrong named with file, line and value."""

from __future__ import annotations

import importlib.util
import math
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from filtercake.calibration.measurements import (
    COMPRESSIBILITY_COLUMNS,
    FIT_COLUMNS,
    LARGEST_FILE,
    TIME_UNITS,
    VOLUME_UNITS,
    MeasurementFile,
    Readings,
    compressibility_by_csd,
    compressibility_table,
    fits_table,
    load_measurements,
    pressure_effects,
    read_test,
)
from filtercake.errors import ConfigError, FiltrationError, Problem
from filtercake.filtration.constant_pressure import fit_integral
from filtercake.study.loading import parse, read_yaml

REPOSITORY = Path(__file__).resolve().parents[3]
EXAMPLE = REPOSITORY / "config" / "measurements"
ALPHA, MEDIUM = 3.29e9, 5e9

Write = Callable[..., Path]

GOOD = """\
time_s,volume_mL
0,0
4,100
11,200
21.5,300
35,400
51,500
70.5,600
"""


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a file into the test's folder; takes its content and its name."""

    def make(content: str | bytes = GOOD, name: str = "run1.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return make


def readings_csv(pressure: float = 50e3, alpha: float = ALPHA, **noise: Any) -> str:
    """Write a test of 45 cm2, water, 100 g/L as CSV; keywords: seed and size of a noise in time, delay (s)."""
    volume = np.linspace(1e-4, 1e-3, 19)
    driving = 45e-4 * pressure / 1e-3
    time = alpha * 100.0 / (2.0 * 45e-4 * driving) * volume**2 + MEDIUM / driving * volume
    time += noise.get("delay", 0.0) + np.random.default_rng(noise.get("seed")).normal(0.0, noise.get("size", 0.0), 19)
    return "time_s,volume_mL\n" + "".join(
        f"{t!r},{v * 1e6!r}\n" for t, v in zip(time.tolist(), volume.tolist(), strict=True)
    )


ENTRY = """\
  - csd: pmma
    file: {file}
    area_cm2: 45
    pressure_drop_kPa: {pressure}
    viscosity_mPa_s: 1
    solids_per_filtrate_kg_m3: 100
"""


def entries(*files: tuple[str, float]) -> str:
    return "tests:\n" + "".join(ENTRY.format(file=file, pressure=pressure) for file, pressure in files)


def error_of(path: Path) -> str:
    with pytest.raises(FiltrationError) as caught:
        read_test(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ") and "\n" not in text
    return text.removeprefix(f"{path}: ")


def problems_of(path: Path) -> tuple[Problem, ...]:
    with pytest.raises(ConfigError) as caught:
        load_measurements(path)
    assert all(problem.file == str(path) for problem in caught.value.problems)
    return caught.value.problems


# --- reading a CSV: what is accepted --------------------------------------------------------------------------------


def test_a_plain_file(write: Write) -> None:
    found = read_test(write())
    assert isinstance(found, Readings)
    np.testing.assert_allclose(found.time, [4, 11, 21.5, 35, 51, 70.5])
    np.testing.assert_allclose(found.volume, np.arange(1, 7) * 1e-4)
    assert found.notes == ()


@pytest.mark.parametrize(
    ("header", "time", "volume"),
    [
        ("time_s,volume_mL", 1.0, 1e-6),
        ("t (s),V [L]", 1.0, 1e-3),
        ("Time [min],V_cm3", 60.0, 1e-6),
        ("TIME_MIN,VOLUME_M3", 60.0, 1.0),
        ("t_h,filtrate_volume_m3", 3600.0, 1.0),
        ("t/s,V/mL", 1.0, 1e-6),
        ("t / min,V / L", 60.0, 1e-3),
        ("Filtration time (H),Filtrate volume (ml)", 3600.0, 1e-6),
        ("elapsed time [S],Volume of filtrate [l]", 1.0, 1e-3),
        ("t s,V µL", 1.0, 1e-9),
        ("t [s],V [μl]", 1.0, 1e-9),
        ("t [s],V [cm³]", 1.0, 1e-6),
        ("t [s],V [m^3]", 1.0, 1.0),
        ('"t [s]","V [CM3]"', 1.0, 1e-6),
        ("T [s],v [mL]", 1.0, 1e-6),
        ("t [s],T [K],V [mL],v [mm/s]", 1.0, 1e-6),
    ],
)
def test_headers(write: Write, header: str, time: float, volume: float) -> None:
    columns = header.count(",") + 1 if '"' not in header else 2
    rows = [[float(k), float(k)] if columns == 2 else [float(k), 9.0, float(k), 9.0] for k in range(1, 7)]
    path = write(header + "\n" + "\n".join(",".join(map(str, row)) for row in rows) + "\n")
    found = read_test(path)
    np.testing.assert_allclose(found.time, np.arange(1, 7) * time, rtol=1e-15)
    np.testing.assert_allclose(found.volume, np.arange(1, 7) * volume, rtol=1e-15)
    assert found.notes == ()


PLAIN = {",": "{0!r},{1!r}", ";": "{0!r};{1!r}", "\t": "{0!r}\t{1!r}"}


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3)), min_size=5, max_size=30),
    st.sampled_from(sorted(TIME_UNITS)),
    st.sampled_from(sorted(VOLUME_UNITS)),
    st.sampled_from(sorted(PLAIN)),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_round_trip_in_every_unit(
    write: Write,
    steps: list[tuple[float, float]],
    time_unit: str,
    volume_unit: str,
    separator: str,
    swapped: bool,
    upper: bool,
    commas: bool,
) -> None:
    time, volume = np.cumsum(np.array(steps), axis=0).T
    pairs = [(t / TIME_UNITS[time_unit], v / VOLUME_UNITS[volume_unit]) for t, v in zip(time, volume, strict=True)]
    names = [f"t [{time_unit.upper() if upper else time_unit}]", f"V [{volume_unit}]"]
    columns = [names, *([repr(float(value)) for value in pair] for pair in pairs)]
    text = "\n".join(separator.join(row[::-1] if swapped else row) for row in columns)
    commas = commas and separator != ","
    found = read_test(write(text.replace(".", ",") if commas else text))
    np.testing.assert_allclose(found.time, time, rtol=1e-13)
    np.testing.assert_allclose(found.volume, volume, rtol=1e-13)
    assert found.notes == (("decimal commas read as decimal points",) if commas else ())


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.permutations(["time_s", "volume_mL", "pressure_kPa", "remark"]), st.sampled_from(sorted(PLAIN)))
def test_other_columns_and_their_order_do_not_matter(write: Write, order: list[str], separator: str) -> None:
    rows = [{"time_s": f"{k}", "volume_mL": f"{10 * k}", "pressure_kPa": "50", "remark": "-"} for k in range(1, 8)]
    lines = [separator.join(order), *(separator.join(row[name] for name in order) for row in rows)]
    found = read_test(write("\n".join(lines)))
    np.testing.assert_allclose(found.time, np.arange(1, 8))
    np.testing.assert_allclose(found.volume, np.arange(1, 8) * 1e-5)


def test_marks_comments_and_blank_lines_are_skipped(write: Write) -> None:
    text = "\ufeff# made by hand\r\n\r\n" + GOOD.replace("\n", "\r\n").replace("11,", "  # 10,1\r\n,,\r\n11 , ")
    found = read_test(write(text))
    np.testing.assert_array_equal(found.time, read_test(write()).time)
    assert found.notes == ()
    assert read_test(write(GOOD.replace("\n", "\r"))).time.size == 6
    assert read_test(write(GOOD.rstrip())).time.size == 6


def test_numbers_of_every_kind(write: Write) -> None:
    found = read_test(write("t [s];V [L]\n 1e0 ;1.\n+2;.2e1\n3.0E0;3\n4;04\n5;5\n"))
    np.testing.assert_array_equal(found.volume, np.arange(1, 6) * 1e-3)


# --- reading a CSV: repairs, each said ------------------------------------------------------------------------------


def test_decimal_commas(write: Write) -> None:
    for separator in (";", "\t"):
        found = read_test(write(GOOD.replace(",", separator).replace(".", ",")))
        assert found.time[2] == 21.5
        assert found.notes == ("decimal commas read as decimal points",)


def test_text_above_the_header(write: Write) -> None:
    found = read_test(write("Test of 12 May, second try\nArea;45 cm2\n" + GOOD))
    assert found.time.size == 6
    assert found.notes == ("lines 1, 2 above the column header skipped",)


def test_readings_at_the_same_time_are_averaged(write: Write) -> None:
    found = read_test(write(GOOD.replace("35,400\n", "35,398\n35,402\n35,403\n")))
    np.testing.assert_allclose(found.time, [4, 11, 21.5, 35, 51, 70.5])
    assert found.volume[3] == pytest.approx(401e-6)
    assert found.notes == ("lines 7, 8: read at the same time as the line before, volumes averaged",)


def test_readings_at_the_same_time_may_differ_a_little(write: Write) -> None:
    found = read_test(write(GOOD.replace("35,400\n", "35,400\n35,444\n")))  # 10 % of 444 mL are 44.4 mL
    assert found.volume[3] == pytest.approx(422e-6)
    # 0.5 % of 600 mL are 3 mL
    assert read_test(write(GOOD.replace("0,0\n", "0,0\n1,1\n1,3.9\n", 1))).volume[0] == pytest.approx(2.45e-6)
    assert "4.1 mL at the same time" in error_of(write(GOOD.replace("0,0\n", "0,0\n1,1\n1,4.1\n", 1)))
    # nothing is made of time zero
    assert read_test(write(GOOD.replace("0,0\n", "0,0\n0,8\n", 1))).time.size == 6


def test_a_volume_a_little_lower_is_left_out(write: Write) -> None:
    # 0.5 % of 600 mL are 3 mL
    found = read_test(write(GOOD.replace("35,400\n", "35,400\n40,397\n41,400\n")))
    np.testing.assert_allclose(found.time, [4, 11, 21.5, 35, 41, 51, 70.5])
    assert found.notes == ("line 7: volume a little below an earlier one, left out",)
    text = error_of(write(GOOD.replace("35,400\n", "35,400\n40,396.99\n41,410\n")))
    assert text == "line 7: volume = 396.99 mL, after 400 mL: must not fall, or only by 0.5 % of the final volume"


def test_a_lower_volume_is_held_against_the_highest_before(write: Write) -> None:
    text = error_of(write(GOOD.replace("35,400\n", "35,400\n40,398\n41,396\n")))
    assert text.startswith("line 8: volume = 396 mL, after 400 mL")


def test_readings_without_time_or_volume_are_left_out(write: Write) -> None:
    for first in ("0,0", "2,0", "0.0,0.000"):
        assert read_test(write(GOOD.replace("0,0\n", first + "\n", 1))).notes == ()
    found = read_test(write(GOOD.replace("0,0\n", "0,0\n1,0\n2,0\n")))
    assert found.time.size == 6
    assert found.notes == ("lines 3, 4: without time or volume, left out",)
    found = read_test(write(GOOD.replace("0,0\n", "0,7\n")))
    assert found.time.size == 6
    np.testing.assert_allclose(found.volume, np.arange(1, 7) * 1e-4 - 7e-6)
    (note,) = found.notes
    assert note.startswith("line 2: 7 mL at time zero, taken off all volumes (if the clock was started late instead")
    assert found.lines == (3, 4, 5, 6, 7, 8) and found.known_zero


def test_many_lines_are_counted(write: Write) -> None:
    text = "t [s],V [mL]\n" + "".join(f"{k // 2},{200 + k}\n" for k in range(2, 40))
    (note,) = read_test(write(text)).notes
    assert note == "19 lines (3, 5, 7, 9, 11, ...): read at the same time as the line before, volumes averaged"


def test_masses_need_the_density_of_the_filtrate(write: Write) -> None:
    path = write(GOOD.replace(",", ";").replace("volume_mL", "mass_g"))
    np.testing.assert_allclose(read_test(path, 789.0).volume, np.arange(1, 7) * 1e-4 / 0.789, rtol=1e-12)
    # a column of volumes needs none, and is taken where both are there
    both = write("t_s,m_g,V_mL\n1,9,100\n2,9,200\n")
    np.testing.assert_allclose(read_test(both).volume, [1e-4, 2e-4])


CLOCK = "clock;V_mL\n{};0\n{};100\n{};200\n"


@pytest.mark.parametrize(
    ("stamps", "time", "note"),
    [
        (("0:00:00", "0:00:06", "0:00:14.5"), (6.0, 14.5), ""),
        (("14:00:00", "14:00:06", "14:00:14"), (6.0, 14.0), ""),
        (("23:59:58", "0:00:04", "0:00:12"), (6.0, 14.0), "line 3: the clock went over midnight"),
        (("23:59:58,5", "0:00:04,5", "0:00:12,5"), (6.0, 14.0), "line 3: the clock went over midnight"),
        (("12:59:58", "1:00:04", "1:00:12"), (6.0, 14.0), "line 3: the clock went over 12"),
        (("11:59:58 AM", "12:00:04 PM", "12:00:12 pm"), (6.0, 14.0), ""),
        (("11:59:58 pm", "12:00:04 am", "12:00:12 am"), (6.0, 14.0), "line 3: the clock went over midnight"),
        (("2024-02-28 23:59:58", "2024-02-29T00:00:04", "2024-02-29 00:00:12"), (6.0, 14.0), ""),
        (("31.12.2023 23:59:58", "1.1.2024 00:00:04", "01.01.2024 00:00:12"), (6.0, 14.0), ""),
    ],
)
def test_clock_times(write: Write, stamps: tuple[str, str, str], time: tuple[float, float], note: str) -> None:
    found = read_test(write(CLOCK.format(*stamps)))
    np.testing.assert_allclose(found.time, time)
    assert found.known_zero and (not note or note in found.notes)


def test_short_clock_times_go_by_their_header(write: Write) -> None:
    for header, unit in (("time [mm:ss]", 1.0), ("t (min:s)", 1.0), ("time [hh:mm]", 60.0)):
        found = read_test(write(f"{header};V_mL\n0:00;0\n0:30;100\n1:10;200\n"))
        np.testing.assert_allclose(found.time, [30.0 * unit, 70.0 * unit])


def test_a_clock_of_the_day_tells_the_beginning_only_by_a_reading_without_filtrate(write: Write) -> None:
    assert read_test(write("clock,V_mL\n9:00:00,0\n9:00:30,0\n9:00:36,100\n9:00:44,200\n")).time.tolist() == [6.0, 14.0]
    found = read_test(write("clock,V_mL\n9:00:06,100\n9:00:14,200\n9:00:24,300\n"))
    assert not found.known_zero and found.time.tolist() == [0.0, 8.0, 18.0]
    stamps = read_test(write("time_s,V_mL\n1714563606,100\n1714563614,200\n1714563624,300\n"))
    assert not stamps.known_zero and stamps.time.tolist() == [0.0, 8.0, 18.0]


def test_what_flows_while_the_clock_shows_the_same_is_averaged(write: Write) -> None:
    text = "time_s,V_mL\n0,0\n{}4,400\n5,500\n6,600\n"
    found = read_test(write(text.format("1,60\n1,140\n2,200\n")))
    assert found.volume[0] == pytest.approx(1e-4)
    # not where it is read to a tenth of a second, or more than can have flown
    assert "at the same time" in error_of(write(text.format("1.0,60\n1.0,140\n2.0,200\n")))
    assert "at the same time" in error_of(write(text.format("1,100\n2,150\n2,390\n3,395\n")))


def test_two_readings_at_time_zero(write: Write) -> None:
    found = read_test(write(GOOD.replace("0,0\n", "0,0\n0,8\n", 1)))
    assert found.volume[0] == pytest.approx(1e-4)
    assert found.notes == ("line 3: at time zero as the line before, left out",)


# --- reading a CSV: what is wrong with it ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "says"),
    [
        # the header
        (GOOD.replace("time_s", "time"), "line 1: the column of time has no unit: must be one of s, min, h, "),
        (GOOD.replace("_mL", ""), "line 1: the column of volume has no unit: must be one of m3, L, mL, cm3, uL, "),
        (GOOD.replace("time_s", "time_ms"), "line 1: the column of time has the unit 'ms': must be one of s, min, h"),
        (GOOD.replace("_mL", " [gal]"), "line 1: the column of volume has the unit 'gal': must be one of m3, L, mL"),
        (GOOD.replace("_mL", "_ML"), "line 1: the column of volume has the unit 'ML': must be one of m3, L, mL"),
        (GOOD.replace("_mL", " []"), "line 1: the column of volume has no unit"),
        (GOOD.replace("time_s", "time_s,t [min]"), "line 1: 2 columns of time: must be exactly one"),
        (GOOD.replace("time_s,", "time_s,V_L,"), "line 1: 2 columns of volume: must be exactly one"),
        (GOOD.partition("\n")[2], "line 1: '0,0': numbers, but no line above names a column of times and one of"),
        ("Area;45\n45;50\n" + GOOD, "line 2: '45;50': numbers, but no line above names a column"),
        (GOOD.replace("volume_mL", "height_cm"), "line 2: '0,0': numbers, but no line above names a column of times"),
        (
            GOOD.replace("volume_mL", "mass_g"),
            "line 1: holds masses of filtrate: give filtrate_density_kg_m3, the filtr",
        ),
        (
            GOOD.replace("volume_mL", "mass_oz"),
            "line 1: the column of mass has the unit 'oz': must be one of kg, g, mg",
        ),
        # clock times
        (GOOD.replace("4,100", "0:00:04,100"), "line 2: time = '0': must be a clock time, HH:MM:SS"),
        ("clock,V_mL\n0:06,100\n0:14,200\n0:24,300\n", "line 2: time = '0:06': hours and minutes, or minutes and seco"),
        ("clock,V_mL\n14:00:06,100\n14:00:02,200\n", "line 3: time = -4 s, after 0 s in line 2: times must ascend"),
        (GOOD.replace(",", " "), "no line names a column of times and one of filtrate volumes"),
        ("", "no line names a column of times and one of filtrate volumes"),
        ("# nothing\n\n", "no line names a column of times"),
        # the numbers
        (GOOD.replace("35,", "x,"), "line 6: time = 'x': must be a finite number"),
        (GOOD.replace(",400", ",4oo"), "line 6: volume = '4oo': must be a finite number"),
        (GOOD.replace(",400", ","), "line 6: volume = '': must be a finite number"),
        (GOOD.replace(",400", ""), "line 6: volume = '': must be a finite number"),
        (GOOD.replace("35,", "nan,"), "line 6: time = 'nan': must be a finite number"),
        (GOOD.replace(",400", ",inf"), "line 6: volume = 'inf': must be a finite number"),
        (GOOD.replace(",400", ",1e999"), "line 6: volume = '1e999': must be a finite number"),
        (GOOD.replace(",400", ",1_000"), "line 6: volume = '1_000': must be a finite number"),
        (GOOD.replace(",400", ",-400"), "line 6: volume = '-400': must not be negative"),
        (GOOD.replace("\n0,", "\n-0.5,"), "line 2: time = '-0.5': must not be negative"),
        (GOOD.replace(",400", ",400 mL"), "line 6: volume = '400 mL': must be a finite number"),
        (GOOD.replace(",400", ',"400,5"'), "line 6: volume = '400,5': must be a finite number, with a decimal point"),
        (GOOD.replace("35,400", "35,0,400,0"), "line 6: '35,0,400,0': 4 values under 2 columns (decimal commas? separ"),
        (GOOD.replace("35,400", "35,400,"), "line 6: '35,400,': 3 values under 2 columns (decimal commas? separate"),
        (GOOD.replace(",", ";").replace("35;", "35;1;"), "line 6: '35;1;400': 3 values under 2 columns"),
        (
            GOOD.replace(",", ";").replace("35;", "1,035;"),
            "line 6: '1,035': decimal commas and points in one file; use one of them",
        ),
        # the order
        (GOOD.replace("35,", "21.4,"), "line 6: time = 21.4 s, after 21.5 s in line 5: times must ascend"),
        (GOOD.replace(",400", ",40"), "line 6: volume = 40 mL, after 300 mL: must not fall"),
        (GOOD.replace("70.5,600", "70.5,0"), "line 8: volume = 0 mL, after 500 mL: must not fall"),
        (
            GOOD.replace("35,400\n", "35,400\n35,450\n"),
            "line 6: volume = 400 mL, but 450 mL at the same time, 35 s, in line 7: must differ by at most 10 %, or",
        ),
        (
            GOOD.replace("35,400\n", "35,400\n35,395\n35,310\n"),
            "line 8: volume = 310 mL, but 400 mL at the same time, 35 s, in line 6: must differ by at most 10 %",
        ),
        # how many
        ("\n".join(GOOD.split("\n")[:3]), "1 usable readings: must be at least 2 with time and volume above zero"),
        ("time_s,volume_mL\n", "0 usable readings: must be at least 2"),
        ("time_s,volume_mL\n" + "1,0\n2,0\n3,0\n4,0\n5,0\n6,0\n", "0 usable readings: must be at least 2"),
        # no text
        (GOOD.encode("utf-16"), "line 1: must be UTF-8 text, not 0xff"),
        ((GOOD + "80,700 µL").encode("latin-1"), "line 9: must be UTF-8 text, not 0xb5"),
        (GOOD.replace("35", "\0"), "line 6: must be text, not binary data"),
        (b"\x89PNG\r\n\x1a\n", "line 1: must be UTF-8 text, not 0x89"),
        ('time_s,volume_mL\n"' + "1" * 200_000 + '",2\n', "line 2: is not CSV (field larger than field limit"),
    ],
)
def test_wrong_files_are_named_with_line_and_value(write: Write, content: str | bytes, says: str) -> None:
    assert error_of(write(content)).startswith(says)


def test_long_lines_are_cut_short_in_messages(write: Write) -> None:
    text = error_of(write(GOOD.replace("35,400", "35," + "4" * 1000 + "x")))
    assert len(text) < 200 and "..." in text


def test_missing_and_large_files(write: Write, tmp_path: Path) -> None:
    assert error_of(tmp_path / "none.csv") == "cannot be read (No such file or directory)"
    assert "cannot be read" in error_of(tmp_path)
    path = write()
    with path.open("ab") as stream:
        stream.truncate(LARGEST_FILE + 1)
    assert error_of(path) == "must be at most 10 MB"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda text: ("time_s,volume_mL\n" + text).encode()))
def test_any_content_is_read_or_refused(write: Write, content: bytes) -> None:
    try:
        found = read_test(write(content))
    except FiltrationError as error:
        assert "run1.csv" in str(error)
    else:
        assert (np.diff(found.time) > 0.0).all() and (np.diff(found.volume) >= 0.0).all()


# --- files of measurements ------------------------------------------------------------------------------------------


def test_tests_and_resistances(write: Write) -> None:
    write(readings_csv(), "run1.csv")
    write(readings_csv(100e3, size=0.2, seed=1), "run2.csv")
    path = write(
        "title: Mine\n"
        + entries(("run1.csv", 50), ("run2.csv", 100)).replace("file: run2", "name: second\n    file: run2")
        + textwrap.dedent("""\
            resistances:
              - {csd: pmma, resistance_m_kg: 3.06e+9, relative_uncertainty: 0.05, source: a paper}
              - {csd: alum, resistance_m_kg: 1e8, relative_uncertainty: 5e-1, source: b, pressure_drop_kPa: 53, name: x}
              - {csd: pmma, resistance_m_kg: 3e9, relative_uncertainty: 1, source: c}
            """),
        "mine.yaml",
    )
    found = load_measurements(path)
    assert found.title == "Mine" and found.warnings == ()
    first, second = found.tests
    assert (first.name, first.csd, second.name) == ("run1", "pmma", "second")
    assert (first.area, first.pressure_drop, first.viscosity, first.solids_per_filtrate) == pytest.approx(
        (45e-4, 50e3, 1e-3, 100.0), rel=1e-12
    )
    assert found.fits[0].integral.form == "integral" and found.fits[0].differential.form == "differential"
    for fit in found.fits[0]:
        assert fit.resistance == pytest.approx(ALPHA, rel=1e-10)
        assert fit.medium_resistance == pytest.approx(MEDIUM, rel=1e-10)
    names = [entry.name for entry in found.measurements]
    assert names == ["run1", "second", "pmma", "x", "pmma (2)"]
    run1, run2, paper, alum, _ = found.measurements
    assert run1.resistance == found.fits[0].integral.resistance and run1.pressure_drop == pytest.approx(50e3)
    assert run1.relative_se == 1e-6 and run1.source == "run1.csv (integral form)"
    own = found.results[1]
    assert run2.relative_se == pytest.approx(own.resistance_se / own.resistance) and run2.relative_se > 1e-4
    assert (paper.resistance, paper.relative_se, paper.pressure_drop, paper.source) == (3.06e9, 0.05, None, "a paper")
    assert (alum.csd, alum.relative_se, alum.pressure_drop) == ("alum", 0.5, pytest.approx(53e3))


def test_the_spread_between_runs_counts_where_it_is_larger(write: Write) -> None:
    for name, pressure, alpha in (("a", 50e3, 3e9), ("b", 50e3, 3.3e9), ("c", 100e3, 4e9)):
        write(readings_csv(pressure, alpha), f"{name}.csv")
    # within 1 % is the same pressure
    path = write(entries(("a.csv", 50), ("b.csv", 50.4), ("c.csv", 100)), "mine.yaml")
    a, b, c = load_measurements(path).measurements
    spread = float(np.std(np.log([a.resistance, b.resistance]), ddof=1))
    assert a.relative_se == b.relative_se == pytest.approx(spread, rel=1e-9)
    assert spread == pytest.approx(math.log(1.1 * 50.4 / 50.0) / math.sqrt(2.0), rel=1e-6)
    assert c.relative_se == 1e-6
    path.write_text(path.read_text().replace("csd: pmma", "csd: other", 1))
    assert {entry.relative_se for entry in load_measurements(path).measurements} == {1e-6}
    path.write_text(path.read_text().replace("csd: other", "csd: pmma").replace("50.4", "50.6"))
    assert {entry.relative_se for entry in load_measurements(path).measurements} == {1e-6}


def test_a_fit_s_own_error_counts_where_it_explains_the_spread(write: Write) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        write(readings_csv(size=0.5, seed=seed), f"{name}.csv")
    found = load_measurements(write(entries(("a.csv", 50), ("b.csv", 50)), "mine.yaml"))
    spread = float(np.std(np.log([entry.resistance for entry in found.measurements]), ddof=1))
    for entry, result in zip(found.measurements, found.results, strict=True):
        own = result.resistance_se / result.resistance
        assert own > spread and entry.relative_se == pytest.approx(own, rel=1e-12)


def known(*values: tuple[float, float], pressure: float | None = 50, csd: str = "pmma") -> str:
    at = "" if pressure is None else f", pressure_drop_kPa: {pressure}"
    lines = [
        f"  - {{csd: {csd}, resistance_m_kg: {value}, relative_uncertainty: {error}, source: a{at}}}\n"
        for value, error in values
    ]
    return "resistances:\n" + "".join(lines)


def test_values_that_contradict_each_other_are_said_and_less_sure(write: Write) -> None:
    path = write(known((2.5e9, 0.02), (4.5e9, 0.02)), "mine.yaml")
    found = load_measurements(path)
    spread = math.log(4.5 / 2.5) / math.sqrt(2.0)
    assert [entry.relative_se for entry in found.measurements] == pytest.approx([spread] * 2, rel=1e-9)
    (said,) = found.contradictions
    assert said.startswith("the measurements of pmma at 50 kPa contradict each other (pmma, pmma (2); chi-square 431.9")
    assert said.endswith("a scatter of 42 % is added to the error of each")
    assert found.warnings == (f"{path}: {said}",)
    # neither where the errors explain it nor where the pressures differ or are not known
    for text in (
        known((2.5e9, 0.5), (4.5e9, 0.5)),
        known((2.5e9, 0.02), (4.5e9, 0.02), pressure=None),
        known((2.5e9, 0.02)) + known((4.5e9, 0.02), pressure=100).partition("\n")[2],
        known((2.5e9, 0.02)) + known((4.5e9, 0.02), csd="alum").partition("\n")[2],
    ):
        path.write_text(text)
        found = load_measurements(path)
        assert found.contradictions == found.warnings == ()
        assert {entry.relative_se for entry in found.measurements} <= {0.02, 0.5}


def test_tests_and_values_are_held_against_each_other(write: Write) -> None:
    write(readings_csv(50e3, 3e9), "a.csv")
    path = write(entries(("a.csv", 50)) + known((3.6e9, 0.02)), "mine.yaml")
    test, value = load_measurements(path).measurements
    assert test.relative_se == pytest.approx(value.relative_se, rel=0.02) and test.relative_se > 0.12
    assert len(load_measurements(path).contradictions) == 1
    # a vague value does not spoil a test
    path.write_text(entries(("a.csv", 50)) + known((3.6e9, 0.5)))
    test, value = load_measurements(path).measurements
    assert test.relative_se == 1e-6 and value.relative_se == 0.5


def test_runs_may_differ_a_little(write: Write) -> None:
    """A fit's error is far smaller than what differs from run to run: that alone is no contradiction."""
    for name, alpha in (("a", 3e9), ("b", 3.3e9), ("c", 4.5e9)):
        write(readings_csv(50e3, alpha), f"{name}.csv")
    path = write(entries(("a.csv", 50), ("b.csv", 50)), "mine.yaml")
    assert load_measurements(path).contradictions == ()
    path.write_text(entries(("a.csv", 50), ("b.csv", 50), ("c.csv", 50)))
    (said,) = load_measurements(path).contradictions
    assert "(a, b, c; " in said


def test_a_resistance_that_changes_with_pressure_is_said(write: Write) -> None:
    def effect(exponent: float, *pressures: float, error: float = 0.02) -> dict[str, str]:
        values = [
            known((3e9 * (p / 50) ** exponent * (1.0 + 0.005 * (-1) ** k), error), pressure=p).partition("\n")[2]
            for k, p in enumerate(pressures)
        ]
        return pressure_effects(load_measurements(write("resistances:\n" + "".join(values), "mine.yaml")))

    (said,) = effect(0.3, 25, 50, 75, 100).values()
    assert said.startswith("the resistance of pmma rises with pressure from 25 to 100 kPa (exponent 0.3 ± 0.0")
    assert "falls with pressure" in effect(-0.3, 25, 50, 75, 100)["pmma"]
    assert effect(0.0, 25, 50, 75, 100) == effect(0.3, 50) == {}
    # two points have no interval; their own errors decide: 1.96 * hypot(e, e) / ln 2
    assert "rises" in effect(0.3, 50, 100)["pmma"]
    assert effect(0.3, 50, 100, error=0.08) == {}


def test_a_wrong_clock_is_a_warning_and_no_error(write: Write) -> None:
    write(readings_csv(size=0.2, seed=3, delay=6.0), "late.csv")
    path = write(entries(("late.csv", 50)), "mine.yaml")
    found = load_measurements(path)
    (result,), (entry,), (said,) = found.results, found.measurements, found.warnings
    assert result.form == "differential" and result.time_zero == pytest.approx(6.0, abs=1.0)
    assert said.startswith(f"{path}: late: time zero: the filtration began at ")
    assert entry.resistance == result.resistance == pytest.approx(ALPHA, abs=result.resistance_ci95)
    assert entry.relative_se == pytest.approx(result.resistance_se / result.resistance)
    # both forms agree over the readings used, from there on
    assert found.fits[0].integral.resistance == pytest.approx(found.fits[0].differential.resistance, rel=1e-6)


def test_repairs_and_notes_are_warnings_said_once(write: Write) -> None:
    lines = readings_csv(size=0.3, seed=5).split("\n")
    lines[1:5] = [f"{line.split(',')[0]},{10 * k + 10}" for k, line in enumerate(lines[1:5])]
    write("\n".join(["a remark", *lines]), "run1.csv")
    path = write(entries(("run1.csv", 50)), "mine.yaml")
    found = load_measurements(path)
    assert found.tests[0].notes == ("line 1 above the column header skipped",)
    assert found.warnings[0] == f"{path}: run1: line 1 above the column header skipped"
    assert found.warnings[1].startswith(f"{path}: run1: start-up: lines 3 to 6 left out (4 of 19 readings, to ")
    assert len(set(found.warnings)) == len(found.warnings)


def test_fits_table(write: Write) -> None:
    write(readings_csv(size=0.2, seed=1).replace("time_s", "a remark\ntime_s"), "run1.csv")
    found = load_measurements(write(entries(("run1.csv", 50)), "mine.yaml"))
    table = fits_table(found)
    assert tuple(table.columns) == FIT_COLUMNS and len(table) == 2
    assert table["test"].tolist() == ["run1", "run1"] and table["csd"].tolist() == ["pmma", "pmma"]
    for row, fit in zip(table.itertuples(), found.fits[0], strict=True):
        assert row.form == fit.form
        assert (row.resistance_m_kg, row.resistance_ci95_m_kg) == (fit.resistance, fit.resistance_ci95)
        assert (row.medium_resistance_1_m, row.medium_resistance_ci95_1_m) == (
            fit.medium_resistance,
            fit.medium_resistance_ci95,
        )
        assert (row.points, row.points_left_out, row.pressure_drop_kPa) == (19, 0, pytest.approx(50.0))
        assert row.notes == "line 1 above the column header skipped"
    none = load_measurements(
        write("resistances: [{csd: a, resistance_m_kg: 1, relative_uncertainty: 1, source: s}]", "other.yaml")
    )
    assert tuple(fits_table(none).columns) == FIT_COLUMNS and fits_table(none).empty


def test_compressibility_of_every_distribution(write: Write) -> None:
    for name, pressure in (("a", 25e3), ("b", 50e3), ("c", 100e3)):
        write(readings_csv(pressure, 3e9 * (pressure / 1e5) ** 0.3, size=0.05, seed=1), f"{name}.csv")
    path = write(
        entries(("a.csv", 25), ("b.csv", 50), ("c.csv", 100))
        + textwrap.dedent("""\
            resistances:
              - {csd: pmma, resistance_m_kg: 9e9, relative_uncertainty: 0.05, source: no pressure}
              - {csd: alum, resistance_m_kg: 1e8, relative_uncertainty: 0.05, source: a, pressure_drop_kPa: 50}
              - {csd: alum, resistance_m_kg: 1e8, relative_uncertainty: 0.05, source: b, pressure_drop_kPa: 50.1}
              - {csd: salt, resistance_m_kg: 1e8, relative_uncertainty: 0.05, source: a, pressure_drop_kPa: 50}
              - {csd: salt, resistance_m_kg: 2e8, relative_uncertainty: 0.05, source: b, pressure_drop_kPa: 100}
            """),
        "mine.yaml",
    )
    fits = compressibility_by_csd(load_measurements(path))
    assert list(fits) == ["pmma", "salt"]
    assert fits["pmma"].n == 3 and fits["pmma"].exponent == pytest.approx(0.3, abs=fits["pmma"].exponent_ci95)
    assert fits["salt"].exponent == pytest.approx(1.0) and math.isnan(fits["salt"].exponent_ci95)
    table = compressibility_table(load_measurements(path))
    assert tuple(table.columns) == COMPRESSIBILITY_COLUMNS and table["csd"].tolist() == ["pmma", "salt"]
    pmma, salt = table.itertuples()
    assert (pmma.reference_pressure_kPa, pmma.points, pmma.notes) == (100.0, 3, "")
    assert (pmma.resistance_m_kg, pmma.exponent) == (fits["pmma"].alpha0, fits["pmma"].exponent)
    assert (pmma.resistance_low_m_kg, pmma.resistance_high_m_kg) == (fits["pmma"].alpha0_low, fits["pmma"].alpha0_high)
    assert pmma.exponent_ci95 == fits["pmma"].exponent_ci95
    assert math.isnan(salt.exponent_ci95) and "third pressure" in salt.notes


# --- files of measurements: what is wrong with them -----------------------------------------------------------------

VALUE = "{csd: pmma, resistance_m_kg: 3.06e+9, relative_uncertainty: 0.05, source: a}"


@pytest.mark.parametrize(
    ("old", "new", "key", "value", "allowed"),
    [
        ("area_cm2: 45", "area_cm2: -45", "tests[0].area_cm2", "-45", "must be greater than or equal to 0.0001"),
        ("area_cm2: 45", "area_cm2: yes", "tests[0].area_cm2", "True", "must be a number"),
        ("area_cm2: 45", "area_cm2: .inf", "tests[0].area_cm2", "inf", "must be"),
        ("    area_cm2: 45\n", "", "tests[0].area_cm2", "(missing)", "must be given"),
        ("area_cm2", "area_m2", "tests[0].area_m2", "45", "did you mean area_cm2?"),
        (
            "drop_kPa: 50",
            "drop_kPa: 20000",
            "tests[0].pressure_drop_kPa",
            "20000",
            "must be less than or equal to 10000",
        ),
        ("mPa_s: 1", "mPa_s: 0", "tests[0].viscosity_mPa_s", "0", "must be greater than or equal to 0.001"),
        ("kg_m3: 100", "kg_m3: a lot", "tests[0].solids_per_filtrate_kg_m3", "'a lot'", "must be a number"),
        ("csd: pmma\n    file", "csd: p/m\n    file", "tests[0].csd", "'p/m'", "must be letters"),
        ("file: run1.csv", "file: ''", "tests[0].file", "''", "must have at least 1 character"),
        (
            "uncertainty: 0.05",
            "uncertainty: 1.5",
            "resistances[0].relative_uncertainty",
            "1.5",
            "less than or equal to 1",
        ),
        (
            "uncertainty: 0.05",
            "uncertainty: 0",
            "resistances[0].relative_uncertainty",
            "0",
            "greater than or equal to 0.000001",
        ),
        ("3.06e+9", "0", "resistances[0].resistance_m_kg", "0", "must be greater than or equal to 1"),
        (", source: a", "", "resistances[0].source", "(missing)", "must be given"),
        ("source: a", "sauce: a", "resistances[0].sauce", "'a'", "did you mean source?"),
        ("source: a", "source: a, name: run1", "resistances[0].name", "'run1'", "is the name of tests[0] too"),
    ],
)
def test_wrong_keys_are_named(write: Write, old: str, new: str, key: str, value: str, allowed: str) -> None:
    write()
    text = entries(("run1.csv", 50)) + f"resistances:\n  - {VALUE}\n"
    assert old in text
    found = problems_of(write(text.replace(old, new), "mine.yaml"))
    chosen = [problem for problem in found if problem.key == key]
    assert len(chosen) == 1 and chosen[0].value == value and allowed in chosen[0].allowed


@pytest.mark.parametrize("text", ["title: nothing", "tests: []", "tests: []\nresistances: []"])
def test_something_must_have_been_measured(write: Write, text: str) -> None:
    (problem,) = problems_of(write(text, "mine.yaml"))
    assert problem.allowed == "needs at least one entry in tests or in resistances"


def test_a_file_that_is_no_mapping(write: Write, tmp_path: Path) -> None:
    (problem,) = problems_of(write("- a", "mine.yaml"))
    assert "mapping" in problem.allowed
    (problem,) = problems_of(tmp_path / "none.yaml")
    assert "cannot be read" in problem.allowed


def test_all_problems_are_told_at_once(write: Write) -> None:
    write(readings_csv(), "good.csv")
    write(GOOD.replace("35,", "x,"), "wrong.csv")
    volume = np.arange(1, 9)
    fast = "".join(f"{10.0 * math.sqrt(v):.3f},{v}\n" for v in volume)  # faster and faster
    write("t [s],V [L]\n" + fast, "bent.csv")
    names = ("none.csv", "wrong.csv", "good.csv", "bent.csv", "good.csv")
    path = write(entries(*((name, 50) for name in names)), "mine.yaml")
    found = {problem.key: problem for problem in problems_of(path)}
    assert list(found) == ["tests[4].name", "tests[0].file", "tests[1].file", "tests[3].file"]
    assert found["tests[4].name"].value == "'good'" and "tests[2] too" in found["tests[4].name"].allowed
    assert found["tests[0].file"].value == "'none.csv'" and "cannot be read" in found["tests[0].file"].allowed
    assert "wrong.csv: line 6: time = 'x'" in found["tests[1].file"].allowed
    assert "form gives a cake resistance of -" in found["tests[3].file"].allowed


def test_the_schema_has_units_and_bounds() -> None:
    schema = MeasurementFile.model_json_schema()
    test = schema["$defs"]["ConstantPressureTest"]["properties"]
    assert test["area_cm2"]["minimum"] == 1e-4 and "cm2" in test["area_cm2"]["description"]
    assert schema["$defs"]["KnownResistance"]["properties"]["relative_uncertainty"]["maximum"] == 1


# --- the example ----------------------------------------------------------------------------------------------------


def test_the_example_is_what_its_script_makes(tmp_path: Path) -> None:
    spec = importlib.util.spec_from_file_location("maker", REPOSITORY / "tests" / "data" / "make_measurements.py")
    assert spec is not None and spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    maker.make(tmp_path)
    made = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    assert len(made) == 5
    for name, text in made.items():
        assert (EXAMPLE / name).read_text(encoding="utf-8") == text, name
        assert "tests/data/make_measurements.py" in text and "ynthetic" in text


def test_the_example_gives_back_what_it_was_made_of() -> None:
    found = load_measurements(EXAMPLE / "synthetic_tests.yaml")
    assert "ynthetic" in found.title
    truth = pd.read_csv(REPOSITORY / "tests" / "data" / "synthetic_truth.csv").set_index("csd")["resistance_m_kg"]
    alpha = float(truth["pmma_50_50"])
    for result in found.results:
        assert result.resistance == pytest.approx(alpha, abs=result.resistance_ci95)
        assert result.medium_resistance == pytest.approx(MEDIUM, abs=result.medium_resistance_ci95)
    assert [result.integral.left_out for result in found.results] == [4, 0, 0, 0]
    whole, kept = fit_integral(found.tests[0]), found.fits[0].integral
    assert whole.resistance_ci95 > 5.0 * kept.resistance_ci95
    assert abs(whole.resistance - alpha) > 5.0 * abs(kept.resistance - alpha)
    (fit,) = compressibility_by_csd(found).values()
    assert fit.exponent == pytest.approx(0.0, abs=fit.exponent_ci95)
    assert (
        "start-up: lines 5 to 8 left out (4 of 22 readings, to 45.3 s, 200 mL): less filtrate than" in found.warnings[0]
    )


def test_the_model_is_checked_as_studies_are(write: Write) -> None:
    path = write(f"resistances:\n  - {VALUE}\n", "mine.yaml")
    model = parse(MeasurementFile, read_yaml(path), str(path))
    assert model.resistances[0].resistance_m_kg == 3.06e9 and model.tests == []
