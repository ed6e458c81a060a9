"""Size distributions as people have them: every form is the same distribution, or a refusal that says the cure."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr

from filtercake.crystals.csd import CrystalSizeDistribution, read_csd
from filtercake.errors import CsdError

UM = 1e-6
EDGES = (10.0, 12.59, 15.85, 19.95, 25.12, 31.62, 39.81, 50.12, 63.1)
SHARES = (1.0, 4.0, 10.0, 18.0, 24.0, 22.0, 14.0, 7.0)
"""Nine edges in um and eight shares in %: sum x/d^2 1.525e9 1/m2, Sauter mean 27.41 um by geometric middles."""


@pytest.fixture
def read(tmp_path: Path):
    """Read a file of this text, in this encoding."""

    def from_text(text: str, encoding: str = "utf-8") -> CrystalSizeDistribution:
        path = tmp_path / "x.csv"
        path.write_bytes(text.encode(encoding))
        return read_csd(path)

    return from_text


def rows(*columns: object, header: str, part: str = ",") -> str:
    """A table with a header."""
    lines = [part.join(str(cell) for cell in cells) for cells in zip(*columns, strict=True)]
    return "\n".join([header, *lines, ""])


def below() -> list[float]:
    """Cumulative undersize at the edges, %."""
    return [0.0, *np.cumsum(SHARES).tolist()]


# --- delimiters, decimal marks, encodings


GERMAN = "size_um;volume_fraction_percent\r\n25,5;12,5\r\n32;27,5\r\n40,5;35\r\n51;25\r\n"


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (GERMAN, "utf-8-sig"),
        ("sep=;\r\n" + GERMAN, "utf-8-sig"),
        ('"sep=;"\n' + GERMAN, "utf-8"),
        (GERMAN.replace(";", "\t"), "utf-16"),
        ("\ufeff" + GERMAN.replace(";", "\t"), "utf-16-be"),
        (GERMAN, "utf-16-le"),
        (GERMAN.replace("size_um", "Korngröße (µm)"), "cp1252"),
        (GERMAN.replace(";", "  "), "utf-8"),
        (GERMAN.replace("size_um;", "size (um) ").replace(";", " "), "utf-8"),
        (GERMAN.replace(";", " | "), "utf-8"),
        (GERMAN.replace(",", "."), "utf-8"),
        (GERMAN.replace(",", ".").replace(";", ","), "utf-8"),
        (GERMAN.replace("\r\n", "\r"), "utf-8"),
        ('size_um,volume_fraction_percent\n"25,5","12,5"\n32,"27,5"\n"40,5",35\n51,25\n', "utf-8"),
        ("# laser, March\n// batch 3\n" + GERMAN, "utf-8"),
        ("Batch 3;\nOperator;N. N.\n\n" + GERMAN, "utf-8"),
        (GERMAN.replace("25,5;12,5", "25,5 ;12,5 %").replace("27,5", "27,5%"), "utf-8"),
        ("size_mm;volume_fraction_percent\n0,0255;12,5\n0,032;27,5\n0,0405;35\n0,051;25\n", "utf-8"),
        ("size_nm;volume_fraction_percent\n25 500;12,5\n32 000;27,5\n40 500;35\n51 000;25\n", "utf-8"),
        ("size_m;volume_fraction_percent\n2,55e-5;12,5\n3,2e-5;27,5\n4,05e-5;35\n5,1e-5;25\n", "utf-8"),
    ],
)
def test_a_spreadsheet_is_read_whatever_its_country(read, text: str, encoding: str) -> None:
    csd = read(text, encoding)
    assert csd.sum_x_over_d2 == pytest.approx(7.703e8, rel=1e-3)
    assert csd.sauter_mean / UM == pytest.approx(36.98, abs=0.01)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("size_um;volume_percent\n1,234;40\n2,345;60\n", "line 2: '1,234' may be a decimal comma or thousands"),
        ("size_um;volume_percent\n20,5;40.5\n50;59.5\n", "line 2: '20,5' has a decimal comma, '40.5' in line 2 a"),
        ("size_um,volume_percent\n20,5,40\n50,5,60\n", "line 2: 3 values under 2 columns (decimal commas?"),
        ("size_um\x00,volume_percent\n", "binary"),
    ],
)
def test_numbers_that_may_be_two_are_refused(read, text: str, says: str) -> None:
    with pytest.raises(CsdError) as caught:
        read(text)
    assert says in str(caught.value)


# --- headers


@pytest.mark.parametrize(
    "header",
    [
        "size,volume fraction\num,-",
        "size,volume fraction\n[um],[-]",
        "um,-\nsize,volume fraction",
        "Particle diameter [μm],Volume fraction",
        "d_um,mass fraction",
        "Size,Volume\nof crystals,fraction\n(um),(-)",
        "x [um],weight_fraction",
        "Made up\n\nsize in um,volume fraction",
    ],
)
def test_names_and_units_stand_where_they_like(read, header: str) -> None:
    csd = read(f"{header}\n30,0.4\n60,0.6\n")
    assert csd.sum_x_over_d2 == pytest.approx(6.111e8, rel=1e-3)
    assert csd.sauter_mean / UM == pytest.approx(42.86, abs=0.01)


@pytest.mark.parametrize(
    "text",
    [
        "size_um,30,60\nvolume_fraction,0.4,0.6\n",
        "volume (%);40;60\nsize;um;30;60\n",
        "size_um\t30\t60\nremark\ta\tb\nmass_percent\t40\t60\n".replace("remark\ta\tb\n", ""),
    ],
)
def test_a_table_on_its_side(read, text: str) -> None:
    assert read(text).sum_x_over_d2 == pytest.approx(6.111e8, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("size_um,share\n20,1\n", "needs exactly one column 'volume_fraction'"),
        ("size_um,cumulative_percent\n20,0\n50,100\n", "'cumulative_percent' does not say a share of what"),
        ("size_um,volume_percent,mass_percent\n20,50,40\n50,50,60\n", "'volume_percent', 'mass_percent' may be meant"),
        ("size_inch,volume_percent\n20,50\n50,50\n", "column 'size_inch' has unit None; name one of m, mm, um"),
        ("Chord length (um),counts\n20,50\n50,50\n", "line 1: chord lengths (FBRM) are not diameters"),
    ],
)
def test_a_header_that_may_mean_two_things_is_refused(read, text: str, says: str) -> None:
    with pytest.raises(CsdError) as caught:
        read(text)
    assert says in str(caught.value)


# --- what the shares are of


@pytest.mark.parametrize("name", ["number_fraction", "number_percent", "counts", "Number (%)", "Anzahl", "p0 [%]"])
def test_numbers_become_volumes(read, name: str) -> None:
    factor = {"number_fraction": 1.0, "counts": 1234.0}.get(name, 100.0)
    csd = read(f"size_um,{name}\n10,{0.9 * factor}\n50,{0.1 * factor}\n")
    assert csd.sum_x_over_d2 == pytest.approx(1.045e9, rel=1e-3)
    assert csd.number_fraction == pytest.approx([0.9, 0.1], rel=1e-12)
    assert "x ~ number d^3" in csd.understood


def test_surfaces_become_volumes(read) -> None:
    csd = read("size_um,surface_percent\n10,50\n50,50\n")
    assert csd.volume_fraction == pytest.approx([1 / 6, 5 / 6])


def test_the_volume_is_taken_where_numbers_stand_beside_it(read) -> None:
    csd = read("size_um,number_fraction,volume_fraction,truncated_volume_fraction\n10,0.9,0.4,0\n50,0.1,0.6,1\n")
    assert csd.volume_fraction == pytest.approx([0.4, 0.6])


def test_percent_without_the_word_is_said(read) -> None:
    assert (
        "% by volume, though the header does not say so" in read("size_um,volume_fraction\n30,40\n60,60\n").understood
    )
    with pytest.raises(CsdError, match=r"sum to 0\.01"):
        read("size_um,volume_fraction_percent\n30,0.4\n60,0.6\n")


# --- edges


BETWEEN = [f"{a}-{b}" for a, b in pairwise(EDGES)]
ACROSS = ",".join(map(str, SHARES))


@pytest.mark.parametrize(
    "text",
    [
        rows(EDGES, [*SHARES, ""], header="size_um,volume_fraction_percent"),
        rows(EDGES, ["", *SHARES], header="size_um,volume_fraction_percent"),
        rows(EDGES[::-1], ["", *SHARES[::-1]], header="size_um,volume_fraction_percent"),
        rows(EDGES, [*SHARES, 0], header="size_from_um,volume_percent"),
        rows(EDGES, [0, *SHARES], header="upper size (um),volume (%)"),
        rows(EDGES[:-1], EDGES[1:], SHARES, header="size_from_um,size_to_um,volume_percent"),
        rows(EDGES[1:], EDGES[:-1], SHARES, header="to [um],from [um],volume [%]"),
        rows(BETWEEN, SHARES, header="size_um,volume_percent"),
        rows([cell.replace("-", " – ") for cell in BETWEEN], SHARES, header="size class (um);mass (%)", part=";"),
        rows([cell.replace("-", " to ") for cell in BETWEEN], SHARES, header="size (um);mass (%)", part=";").replace(
            ".", ","
        ),
        rows(EDGES, below(), header="size_um,undersize_volume_percent"),
        rows(EDGES, [s / 100 for s in below()], header="size_um,cumulative_volume_fraction"),
        rows(EDGES, [100 - s for s in below()], header="size_um,cumulative volume (%)"),
        rows(EDGES, [100 - s for s in below()], header="size_um,mass oversize (%)"),
        rows(EDGES, below(), header="sieve (um),passing (%)"),
        rows(EDGES[::-1], [*SHARES[::-1], 0][-1:] + list(SHARES[::-1]), header="mesh_um,retained_g"),
        rows(EDGES[:-1], EDGES[1:], below()[1:], header="lower (um),upper (um),volume below (%)"),
        rows(EDGES[:-1], EDGES[1:], below()[:-1], header="lower (um),upper (um),volume below (%)"),
        rows(EDGES, ["", *SHARES], below(), header="Particle diameter [um],Volume [%],Undersize Volume [%]"),
        rows(EDGES, [0, *SHARES], below(), header="Particle diameter [um],Volume [%],Undersize Volume [%]"),
        rows(EDGES, [*SHARES, 0], below(), header="Particle diameter [um],Volume [%],Undersize Volume [%]"),
        f"Sample,Result type,Between user sizes (sizes in um)\n,,{','.join(map(str, EDGES))},\nb 3,Volume,,{ACROSS},\n",
        f"Sample,Between User Sizes (Sizes in µm)\n,{','.join(map(str, EDGES))}\nb,,{ACROSS}\n".replace(",", ";"),
        "Sample\tResult Below User Sizes (Sizes in mm)\n\t"
        + "\t".join(str(edge / 1000) for edge in EDGES)
        + "\nb\t"
        + "\t".join(map(str, below()))
        + "\n",
        f"size_um,{','.join(map(str, EDGES))}\nvolume_percent,{ACROSS}\n",
    ],
)
def test_classes_between_edges_have_their_geometric_middles(read, text: str) -> None:
    csd = read(text)
    assert csd.size.size == 8
    assert csd.sum_x_over_d2 == pytest.approx(1.525e9, rel=1e-3)
    assert csd.sauter_mean / UM == pytest.approx(27.41, abs=0.01)
    assert "class edges, geometric middles" in csd.understood


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e3])
def test_lower_edges_alone_are_asked_about(read, unit: float) -> None:
    name = {1.0: "um", 1e-3: "mm", 1e3: "nm"}[unit]
    edges = [f"{edge * unit:.6g}" for edge in EDGES]
    for sizes in (edges[:-1], edges[1:]):
        with pytest.raises(
            CsdError, match=r"line 2: sizes 1.* look like edges of classes.*if these are lower edges, add"
        ):
            read(rows(sizes, SHARES, header=f"size_{name},volume_fraction_percent"))
    middles = [math.sqrt(a * b) * unit for a, b in pairwise(EDGES)]
    csd = read(rows(middles, SHARES, header=f"size_{name},volume_fraction_percent"))
    assert csd.sum_x_over_d2 == pytest.approx(1.525e9, rel=1e-3)
    assert read(rows(edges[:-1], SHARES, header=f"size_middle_{name},volume_percent")).sum_x_over_d2 > 1.9e9


def test_a_density_is_integrated(read) -> None:
    widths = [b - a for a, b in pairwise(EDGES)]
    density = [share / width for share, width in zip(SHARES, widths, strict=True)]
    csd = read(rows(EDGES[:-1], EDGES[1:], density, header="from_um,to_um,volume density (%/um)"))
    assert csd.volume_fraction == pytest.approx(np.array(SHARES) / 100)
    per_log = [share / math.log10(b / a) for share, a, b in zip(SHARES, EDGES[:-1], EDGES[1:], strict=True)]
    csd = read(rows(EDGES[:-1], EDGES[1:], per_log, header="from_um,to_um,dV/dlogD (%)"))
    assert csd.volume_fraction == pytest.approx(np.array(SHARES) / 100)
    with pytest.raises(CsdError, match=r"integrates to 0\.1, not to 1 or 100 %"):
        read(rows(EDGES[:-1], EDGES[1:], [d / 1000 for d in density], header="from_um,to_um,volume density (%/um)"))


def test_a_density_at_points_gives_back_a_lognormal(read) -> None:
    # sum x/d^2 of a lognormal by volume: D50^-2 exp(2 ln^2 s)
    size, spread = np.geomspace(5, 300, 200), 0.4
    density = np.exp(-0.5 * (np.log(size / 40) / spread) ** 2) / (size * spread * math.sqrt(2 * math.pi))
    csd = read(rows(size, density, header="diameter_um,volume_density_per_um"))
    assert csd.sum_x_over_d2 == pytest.approx((40 * UM) ** -2 * math.exp(2 * spread**2), rel=2e-3)
    under = ndtr(np.log(size / 40) / spread)
    csd = read(rows(size, under, header="size_um,cumulative_undersize_volume_fraction"))
    assert csd.sum_x_over_d2 == pytest.approx((40 * UM) ** -2 * math.exp(2 * spread**2), rel=2e-3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            rows(EDGES[:-1], SHARES, header="size_from_um,volume_percent"),
            "line 9: 7.0 at 50.12 um, the largest of lower",
        ),
        (rows(EDGES[1:], SHARES, header="size_to_um,volume_percent"), "line 2: 1.0 at 12.59 um, the smallest of upper"),
        (rows(EDGES[:-1], SHARES, header="size class (um),volume (%)"), "look like edges"),
        (
            rows(EDGES[1:], below()[1:], header="size_um,undersize_volume_percent"),
            "0.01 of the whole is smaller than 12.59",
        ),
        (
            rows(EDGES[:-1], below()[:-1], header="size_um,undersize_volume_percent"),
            "line 9: 0.07 of the whole is larger than 50.12 um",
        ),
        (
            "size_um,undersize_volume_percent\n10,0\n20,60\n30,50\n40,100\n",
            "line 4: 'undersize_volume_percent' turns back",
        ),
        ("size_um,volume_percent\n10-20,50\n15-30,50\n", "line 3: the class 15 to 30 um overlaps"),
        ("size_um,volume_percent\n20-10,50\n20-30,50\n", "line 2: a class from 20 to 10: must be from small to large"),
        ("a,Between sizes (sizes in um),\n,1,2\nx,,100\ny,,100\n", "line 4: 2 results under one row of classes"),
        ("a,Between sizes (sizes in um),\n,1,2,3\nx,20,30,50\n", "3 edges with as many shares"),
    ],
)
def test_edges_that_do_not_add_up_are_refused(read, text: str, says: str) -> None:
    with pytest.raises(CsdError) as caught:
        read(text)
    assert says in str(caught.value)


# --- the pan, empty classes, totals


@pytest.mark.parametrize(("pan", "line"), [("0,2", 2), ("0-26.5,2", 2), ("<26.5,2", 2), ("pan,2", 2), ("0.0,2.0", 2)])
def test_the_pan_is_refused_with_advice(read, pan: str, line: int) -> None:
    for text in (f"{pan}\n26.5,20\n37.5,45\n53,33\n", f"26.5,20\n37.5,45\n53,33\n{pan}\n"):
        if "-" in pan or "<" in pan:
            text = text.replace("26.5,20", "26.5-37.5,20").replace("37.5,45", "37.5-53,45").replace("53,33", "53-75,33")
        with pytest.raises(CsdError, match=r"line [25]: .*the pan.*give it a size"):
            read("size_um,volume_fraction_percent\n" + text)


@pytest.mark.parametrize("head", ["", "0,0\n", "pan,0\n"])
@pytest.mark.parametrize(
    "tail", ["", "75,0\n", "total,100\n", ",100\n", "Sum,100\n\nMeasured by N. N.\n", "\nd50,38\n"]
)
def test_empty_classes_totals_and_footers_are_left_out(read, head: str, tail: str) -> None:
    csd = read(f"size_um,volume_fraction_percent\n{head}26.5,22\n37.5,45\n53,33\n{tail}")
    assert csd.size.size == 3
    assert csd.sum_x_over_d2 == pytest.approx(7.508e8, rel=1e-3)
    assert csd.sauter_mean / UM == pytest.approx(37.70, abs=0.01)


def test_what_was_understood_is_said(read) -> None:
    text = rows([5.0, *EDGES, 80.0], [0, *SHARES, 0, ""], header="size_um;volume_percent", part=";")
    assert read(text, "cp1252").understood == (
        "class edges, geometric middles; % by volume; semicolons; 8 classes, 2 empty ones dropped"
    )
    assert read("size_um,volume_fraction\n20,0.5\n50,0.5\n").understood == (
        "sizes as middles of classes; fractions by volume; 2 classes"
    )
    assert "spans a factor of 10" in read("size_um,volume_percent\n1-10,50\n10-20,50\n").understood


# --- instruments

GLASS_BEADS = (0.012362, 0.42421, 2.158819, 6.105918, 12.005703, 17.790159, 20.449133)
GLASS_BEADS += (18.41713, 12.907406, 6.753966, 2.47866, 0.46569, 0.030843)
"""Shares in %, from 30.2 um on; their instrument gives D[3,2] 72.289 and D[4,3] 77.278 um (example of PSD-Analyser)."""


def test_a_mastersizer_2000_of_glass_beads(read) -> None:
    grid = [round(10 ** (-2 + 0.06 * k), 6) for k in range(101)]
    shares = dict(
        zip(
            range(58, 58 + len(GLASS_BEADS)),
            GLASS_BEADS,
            strict=True,
        )
    )
    names = ["Sample Name", '"D [4, 3] - Volume weighted mean"', "Result transform type", "d (0.5)"]
    header = [*names, "Result Between User Sizes (Sizes in um)", *[""] * 100, "Operator Notes"]
    values = ["16 Averaged Result", "77.278", "Volume", "74.796", "", *(str(shares.get(k, 0)) for k in range(100)), "-"]
    csd = read("\n".join(",".join(map(str, line)) for line in (header, [*[""] * 4, *grid, ""], values)) + "\n")
    assert csd.sauter_mean / UM == pytest.approx(72.289, rel=2e-3)
    assert float(csd.volume_fraction @ csd.size) / UM == pytest.approx(77.278, rel=2e-3)
    assert csd.understood.startswith("class edges, geometric middles; % by volume; line 3; 13 classes, 87 empty")


@pytest.mark.parametrize("one_line", [True, False])
def test_a_mastersizer_3000(read, one_line: bool) -> None:
    names = ("Particle diameter", "Size distribution", "Undersize", "Size distribution", "Undersize")
    of = ("", "Volume weighted", "Volume weighted", "Number weighted", "Number weighted")
    units = ("[µm]", "[%]", "[%]", "[%]", "[%]")
    parts = zip(names, of, units, strict=True)
    lines = [[" ".join(part).replace("  ", " ") for part in parts]] if one_line else [names, of, units]
    for size, share, under in zip(EDGES, [0, *SHARES], below(), strict=True):
        lines.append([f"{number:.2f}".replace(".", ",") for number in (size, share, under, 7.7, 8.8)])
    csd = read("Mastersizer 3000\tv3.81\n\n" + "\n".join("\t".join(line) for line in lines), "utf-16")
    assert csd.sum_x_over_d2 == pytest.approx(1.525e9, rel=1e-3)
    assert "tabs, decimal commas" in csd.understood and "UTF-16" in csd.understood


@pytest.mark.parametrize(
    "columns", [("p3 [%]", "Q3 [%]"), ("Q3 [%]", "p3 [%]"), ("Q3 [%]",), ("p3 [%]",), ("1-Q3 [%]",)]
)
@pytest.mark.parametrize("size", ["Size class [mm]\t", "x_u [mm]\tx_o [mm]"])
def test_a_camsizer(read, columns: tuple[str, ...], size: str) -> None:
    values = {"p3 [%]": SHARES, "Q3 [%]": below()[1:], "1-Q3 [%]": [100 - s for s in below()[1:]]}
    lines = ["CAMSIZER X2", "Measuring time: 3 min", "\t".join([size, *columns, "SPHT3"])]
    for k, (a, b) in enumerate(pairwise(EDGES)):
        lines.append("\t".join(map(str, [a / 1000, b / 1000, *(values[name][k] for name in columns), 0.9])))
    csd = read("\r\n".join(lines), "utf-16")
    assert csd.sum_x_over_d2 == pytest.approx(1.525e9, rel=1e-3)
