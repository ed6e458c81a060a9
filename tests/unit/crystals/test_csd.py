"""Crystal size distributions against closed forms and the paper's Table 2."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import gammainc

from filtercake.crystals.csd import (
    CrystalSizeDistribution,
    discretise,
    from_table,
    kept_classes,
    kept_volume,
    mixture,
    read_csd,
    read_table,
    to_table,
    truncate,
)
from filtercake.errors import CsdError
from filtercake.units import split_header

UM = 1e-6

# Table 2 of the paper (um) and the volume each truncation keeps (physics.md, section 2)
TABLE_2 = {15: (32.5, 543.3, 0.981), 30: (37.6, 613.4, 0.979), 45: (42.6, 653.4, 0.977), 60: (42.5, 688.2, 0.976)}
G_TAU = {15: 58.417e-6, 30: 67.103e-6, 45: 72.771e-6, 60: 77.081e-6}


@st.composite
def distributions(draw: st.DrawFn) -> CrystalSizeDistribution:
    """Between one and eight distinct sizes from 1 um to 1 mm."""
    sizes = draw(st.lists(st.integers(1, 1000), min_size=1, max_size=8, unique=True))
    weights = draw(st.lists(st.integers(1, 1000), min_size=len(sizes), max_size=len(sizes)))
    return CrystalSizeDistribution.from_classes(np.array(sizes) * UM, np.array(weights) / sum(weights))


# --- moments -------------------------------------------------------------------------------------------------------


def test_number_fraction_of_a_pair_by_hand() -> None:
    # equal volumes: numbers go as 1/d^3, 50^3 : 20^3 = 125000 : 8000
    csd = mixture([20 * UM, 50 * UM], [0.5, 0.5])
    assert csd.number_fraction == pytest.approx([125 / 133, 8 / 133], rel=1e-14)


def test_number_fraction_converts_back_to_volume() -> None:
    csd = mixture([20 * UM, 35 * UM, 50 * UM], [0.2, 0.3, 0.5])
    volume = csd.number_fraction * csd.size**3
    assert volume / volume.sum() == pytest.approx(csd.volume_fraction, rel=1e-14)


def mean_size(csd: CrystalSizeDistribution, p: int, q: int) -> float:
    """Mean diameter d_pq, m, from the numbers: d10 is the number mean, d43 the volume mean."""
    upper, lower = (float(np.sum(csd.number_fraction * csd.size**order)) for order in (p, q))
    return (upper / lower) ** (1.0 / (p - q))


def test_moments_of_a_pair_by_hand() -> None:
    csd = mixture([20 * UM, 50 * UM], [0.5, 0.5])
    assert csd.sum_x_over_d == pytest.approx(0.5 / 20e-6 + 0.5 / 50e-6, rel=1e-14)
    assert csd.sum_x_over_d2 == pytest.approx(0.5 / 20e-6**2 + 0.5 / 50e-6**2, rel=1e-14)
    assert csd.sauter_mean == pytest.approx(1.0 / 35_000.0, rel=1e-12)  # 28.57 um
    assert mean_size(csd, 4, 3) == pytest.approx(35e-6, rel=1e-12)  # volume-weighted mean of 20 and 50
    assert mean_size(csd, 1, 0) == pytest.approx((125 * 20 + 8 * 50) / 133 * UM, rel=1e-12)
    assert (csd.smallest, csd.largest) == (20 * UM, 50 * UM)


def test_sauter_mean_is_d32_from_the_numbers() -> None:
    csd = mixture([20 * UM, 35 * UM, 50 * UM], [0.2, 0.3, 0.5])
    assert mean_size(csd, 3, 2) == pytest.approx(csd.sauter_mean, rel=1e-13)


def test_mean_particle_volume_is_one_over_the_number_per_volume() -> None:
    csd = mixture([20 * UM, 50 * UM], [0.25, 0.75])
    per_volume = 0.25 / (np.pi / 6 * 20e-6**3) + 0.75 / (np.pi / 6 * 50e-6**3)
    assert csd.mean_particle_volume == pytest.approx(1.0 / per_volume, rel=1e-13)


@given(distributions(), st.floats(0.01, 100.0))
def test_scaling_the_sizes_scales_the_moments(csd: CrystalSizeDistribution, k: float) -> None:
    scaled = CrystalSizeDistribution.from_classes(csd.size * k, csd.volume_fraction)
    assert scaled.sauter_mean == pytest.approx(k * csd.sauter_mean, rel=1e-12)
    assert mean_size(scaled, 4, 3) == pytest.approx(k * mean_size(csd, 4, 3), rel=1e-12)
    assert scaled.sum_x_over_d2 == pytest.approx(csd.sum_x_over_d2 / k**2, rel=1e-12)
    assert scaled.number_fraction == pytest.approx(csd.number_fraction, rel=1e-9)


@given(distributions(), st.randoms(use_true_random=False))
def test_the_order_of_the_classes_does_not_matter(csd: CrystalSizeDistribution, random: object) -> None:
    order = list(range(csd.size.size))
    random.shuffle(order)  # type: ignore[attr-defined]
    shuffled = CrystalSizeDistribution.from_classes(csd.size[order], csd.volume_fraction[order])
    assert np.array_equal(shuffled.size, csd.size)
    assert shuffled.volume_fraction == pytest.approx(csd.volume_fraction, rel=1e-14)


@given(distributions())
def test_the_means_are_ordered_and_inside_the_sizes(csd: CrystalSizeDistribution) -> None:
    # d10 <= d32 <= d43 for every distribution (power means), all between the extremes
    tolerance = 1.0 + 1e-12
    means = [csd.smallest, mean_size(csd, 1, 0), csd.sauter_mean, mean_size(csd, 4, 3), csd.largest]
    assert all(a <= b * tolerance for a, b in pairwise(means))


# --- classes -------------------------------------------------------------------------------------------------------


def test_equal_sizes_are_merged_and_empty_classes_dropped() -> None:
    csd = CrystalSizeDistribution.from_classes([50 * UM, 20 * UM, 50 * UM, 70 * UM], [0.2, 0.5, 0.3, 0.0])
    assert csd.size == pytest.approx([20 * UM, 50 * UM])
    assert csd.volume_fraction == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("total", [0.9901, 1.0099])
def test_a_sum_within_one_percent_is_normalised(total: float) -> None:
    csd = CrystalSizeDistribution.from_classes([20 * UM, 50 * UM], [0.25 * total, 0.75 * total])
    assert csd.volume_fraction == pytest.approx([0.25, 0.75], rel=1e-14)


@pytest.mark.parametrize(
    ("sizes", "fractions", "says"),
    [
        ([], [], "no class"),
        ([20 * UM], [0.5, 0.5], "1 sizes but 2 volume fractions"),
        ([-20 * UM, 50 * UM], [0.5, 0.5], "size -20 um: sizes must be positive"),
        ([0.0, 50 * UM], [0.5, 0.5], "size 0 um: sizes must be positive"),
        ([np.nan, 50 * UM], [0.5, 0.5], "size nan um: sizes must be positive and finite"),
        ([np.inf, 50 * UM], [0.5, 0.5], "size inf um: sizes must be positive and finite"),
        ([20 * UM, 50 * UM], [np.nan, 0.5], "volume fraction nan: fractions must be finite"),
        ([20 * UM, 50 * UM], [np.inf, 0.5], "volume fraction inf: fractions must be finite"),
        ([20 * UM, 50 * UM], [-0.1, 1.1], "volume fraction -0.1: fractions must be finite and not negative"),
        ([20 * UM, 50 * UM], [0.5, 0.51001], "sum to 1.01001; they must sum to 1 within 0.01"),
        ([20 * UM, 50 * UM], [0.5, 0.48999], "sum to 0.98999; they must sum to 1 within 0.01"),
        ([20 * UM, 50 * UM], [0.0, 0.0], "sum to 0;"),
    ],
)
def test_bad_classes_are_refused_in_words(sizes: list[float], fractions: list[float], says: str) -> None:
    with pytest.raises(CsdError) as caught:
        CrystalSizeDistribution.from_classes(sizes, fractions)
    assert says in str(caught.value)


# --- whole numbers of spheres --------------------------------------------------------------------------------------


@given(distributions(), st.integers(1, 200_000))
def test_class_counts_add_up_and_stay_within_one_of_ideal(csd: CrystalSizeDistribution, particles: int) -> None:
    counts = csd.class_counts(particles)
    assert counts.sum() == particles
    assert np.all(np.abs(counts - csd.number_fraction * particles) < 1.0)


def test_class_counts_give_the_spare_sphere_to_the_largest_remainder() -> None:
    # ideal 93.98 and 6.015 of 100: the 0.98 wins
    assert mixture([20 * UM, 50 * UM], [0.5, 0.5]).class_counts(100).tolist() == [94, 6]


# --- discretisation and truncation ---------------------------------------------------------------------------------


@pytest.mark.parametrize("minutes", sorted(TABLE_2))
def test_table_2_of_the_paper(alum, minutes: int) -> None:
    smallest, largest, kept = TABLE_2[minutes]
    _, cut = alum(minutes)
    assert cut.csd.smallest / UM == pytest.approx(smallest, abs=0.1)
    assert cut.csd.largest / UM == pytest.approx(largest, abs=0.1)
    assert cut.kept_volume == pytest.approx(kept, abs=0.001)  # three decimals given, of which 15 min is rounded down


@pytest.mark.parametrize("minutes", sorted(TABLE_2))
def test_the_full_distribution_has_the_analytic_sum_x_over_d2(alum, minutes: int) -> None:
    # integral of w/L^2 = 1/(6 a^2); bins of 5 um about their centres are within 1 % of it, the more so the larger a
    full, _ = alum(minutes)
    assert full.sum_x_over_d2 == pytest.approx(1.0 / (6.0 * G_TAU[minutes] ** 2), rel=1e-2)


@pytest.mark.parametrize("minutes", sorted(TABLE_2))
def test_truncation_lowers_sum_x_over_d2_by_about_eight_percent(alum, minutes: int) -> None:
    full, cut = alum(minutes)
    assert cut.csd.sum_x_over_d2 / full.sum_x_over_d2 == pytest.approx(0.92, abs=0.01)


def test_the_midpoint_rule_converges_to_the_analytic_sum() -> None:
    a = G_TAU[15]
    exact = 1.0 / (6.0 * a**2)
    errors = [
        abs(discretise(lambda size: gammainc(4, size / a), 30 * a, width).sum_x_over_d2 / exact - 1.0)
        for width in (4 * UM, 2 * UM, 1 * UM)
    ]
    assert errors[0] > 3.0 * errors[1] > 3.0**2 * errors[2]  # second order (4), but for a logarithm near L = 0
    assert errors[2] < 5e-4


def test_bin_centres_and_volumes_of_a_uniform_distribution() -> None:
    csd = discretise(lambda size: size / (10 * UM), upper=10 * UM, bin_width=2.4 * UM)
    # int(10 / 2.4) = 4 bins of 2.5 um
    assert csd.size / UM == pytest.approx([1.25, 3.75, 6.25, 8.75])
    assert csd.volume_fraction == pytest.approx([0.25] * 4)


@pytest.mark.parametrize(
    ("cumulative", "width", "says"),
    [
        (lambda size: size / (10 * UM), 11 * UM, "leaves no bin"),
        (lambda size: np.zeros_like(size), 2 * UM, "no volume"),
        (lambda size: np.full_like(size, np.nan), 2 * UM, "no volume"),
    ],
)
def test_discretisation_refuses_what_leaves_nothing(cumulative, width: float, says: str) -> None:
    with pytest.raises(CsdError, match=says):
        discretise(cumulative, 10 * UM, width)


def test_truncation_drops_small_classes_and_renormalises() -> None:
    cut = truncate(mixture([10 * UM, 20 * UM, 30 * UM], [0.0009, 0.001, 0.9981]), 0.001)
    assert cut.csd.size / UM == pytest.approx([20, 30])  # a class of exactly the share stays
    assert cut.csd.volume_fraction.sum() == pytest.approx(1.0, abs=1e-15)
    assert cut.kept_volume == pytest.approx(0.9991, abs=1e-12)


def test_truncation_that_leaves_nothing_is_refused() -> None:
    with pytest.raises(CsdError, match=r"leaves no class: the largest class holds 0\.5"):
        truncate(mixture([10 * UM, 20 * UM], [0.5, 0.5]), 0.51)


def test_truncation_by_size_keeps_both_ends() -> None:
    csd = mixture([10 * UM, 20 * UM, 30 * UM, 40 * UM], [0.1, 0.2, 0.3, 0.4])
    cut = truncate(csd, smallest=0.02e-3, largest=30 * UM)  # 0.02 mm is the 20 um
    assert cut.csd.size / UM == pytest.approx([20, 30])
    assert cut.csd.volume_fraction == pytest.approx([0.4, 0.6])
    assert cut.kept_volume == pytest.approx(0.5)
    assert truncate(csd, 0.25, largest=30 * UM).csd.size / UM == pytest.approx([30])  # shares are of the whole
    assert (truncate(csd).csd.volume_fraction == csd.volume_fraction).all()


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"smallest": 41 * UM}, r"none is between 41 and inf um; the sizes run from 10 to 40 um"),
        ({"largest": 9 * UM}, r"none is between 0 and 9 um"),
        ({"smallest": 12 * UM, "largest": 19 * UM}, r"none is between 12 and 19 um"),
        ({"smallest_share": 0.3, "largest": 20 * UM}, r"the largest class between 0 and 20 um holds 0\.2;"),
    ],
)
def test_truncation_by_size_that_leaves_nothing_is_refused(limits: dict[str, float], says: str) -> None:
    with pytest.raises(CsdError, match=says):
        truncate(mixture([10 * UM, 20 * UM, 40 * UM], [0.1, 0.2, 0.7]), **limits)


@given(distributions(), st.floats(0.0, 0.3))
def test_truncation_keeps_what_it_says(csd: CrystalSizeDistribution, share: float) -> None:
    if csd.volume_fraction.max() < share:
        return
    cut = truncate(csd, share)
    kept = csd.volume_fraction[csd.volume_fraction >= share]
    assert cut.kept_volume == pytest.approx(kept.sum(), rel=1e-12)
    assert cut.csd.volume_fraction * cut.kept_volume == pytest.approx(kept, rel=1e-12)


# --- tables --------------------------------------------------------------------------------------------------------


@given(distributions(), st.floats(0.0, 0.2))
def test_table_round_trip(csd: CrystalSizeDistribution, share: float) -> None:
    if csd.volume_fraction.max() < share:
        return
    truncated = truncate(csd, share).csd
    full_again, truncated_again = from_table(to_table(csd, truncated))
    for before, after in ((csd, full_again), (truncated, truncated_again)):
        assert after.size == pytest.approx(before.size, rel=1e-14)
        assert after.volume_fraction == pytest.approx(before.volume_fraction, rel=1e-12)


def test_a_table_keeps_what_the_classes_add_to_the_sums(tmp_path: Path) -> None:
    # between 0 and 10 um, uniform in volume: sum x/d diverges at 0, so that these sums are made up
    sums = (lambda size: 3e5 * size / (10 * UM), lambda size: 4e10 * (size / (10 * UM)) ** 2)
    csd = discretise(lambda size: size / (10 * UM), 10 * UM, 2.5 * UM, lambda size: (sums[0](size), sums[1](size)))
    assert (csd.sum_x_over_d, csd.sum_x_over_d2) == pytest.approx((3e5, 4e10), rel=1e-14)
    to_table(csd, truncate(csd, largest=8 * UM).csd).to_csv(tmp_path / "csd.csv", index=False)
    full, truncated = read_table(tmp_path / "csd.csv")
    assert full.x_over_d2 == pytest.approx(csd.x_over_d2)
    assert (full.sum_x_over_d, full.sum_x_over_d2) == pytest.approx((3e5, 4e10), rel=1e-14)
    assert truncated.x_over_d is None
    assert truncated.sum_x_over_d == pytest.approx(float(np.sum(1.0 / 3.0 / truncated.size)), rel=1e-12)


def test_table_lists_left_out_classes_with_zero() -> None:
    full = mixture([10 * UM, 20 * UM], [0.01, 0.99])
    table = to_table(full, truncate(full, 0.1).csd)
    assert table["size_um"].tolist() == pytest.approx([10.0, 20.0])
    assert table["truncated_volume_fraction"].tolist() == [0.0, 1.0]
    assert table["truncated_number_fraction"].tolist() == [0.0, 1.0]
    assert table["number_fraction"].sum() == pytest.approx(1.0, abs=1e-15)
    assert table["x_over_d_1_m"].sum() == pytest.approx(full.sum_x_over_d, rel=1e-14)
    assert table["x_over_d2_1_m2"].sum() == pytest.approx(full.sum_x_over_d2, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "size_um,volume_fraction\n",
        "size_um\n20,0.5\n",
        "size_um,volume_fraction\n20\n30,1\n",
        "size_um\nx\n",
        "size_um\n20\n",
    ],
)
def test_a_damaged_table_is_refused_by_its_name(tmp_path: Path, text: str) -> None:
    (tmp_path / "csd.csv").write_text(text, encoding="utf-8")
    with pytest.raises(CsdError, match=r"csd\.csv: "):
        read_table(tmp_path / "csd.csv")


def test_the_same_table_on_disk_is_the_same_distribution(tmp_path: Path, alum) -> None:
    # the packing reads what the csd rule wrote: the cloud's seed hashes 13 digits of it
    full, cut = alum(15)
    to_table(full, cut.csd).to_csv(tmp_path / "csd.csv", index=False)
    full_again, first = read_table(tmp_path / "csd.csv")
    to_table(full_again, first).to_csv(tmp_path / "again.csv", index=False)
    again = read_table(tmp_path / "again.csv")[1]
    assert first.size.size == cut.csd.size.size
    assert first.volume_fraction == pytest.approx(cut.csd.volume_fraction, rel=1e-12)
    assert again.volume_fraction == pytest.approx(first.volume_fraction, rel=1e-12)


# --- CSV files -----------------------------------------------------------------------------------------------------

GOOD = [(20e-6, 0.25), (50e-6, 0.75)]


@pytest.mark.parametrize(
    "text",
    [
        "size_um,volume_fraction\n20,0.25\n50,0.75\n",
        "size_um,volume_fraction\n50,0.75\n20,0.25\n",  # any order of rows
        "volume_fraction,size_um\n0.25,20\n0.75,50\n",  # and of columns
        "size (um),volume_fraction\n20,0.25\n50,0.75\n",
        "size [um],volume_fraction\n20,0.25\n50,0.75\n",
        "size (µm),volume_fraction\n20,0.25\n50,0.75\n",  # micro sign
        "size (μm),volume_fraction\n20,0.25\n50,0.75\n",  # Greek mu
        "size_µm,volume_fraction\n20,0.25\n50,0.75\n",
        "size_mm,volume_fraction\n0.020,0.25\n0.050,0.75\n",
        "size (m),volume_fraction\n20e-6,0.25\n5e-5,0.75\n",
        "size_nm,volume_fraction\n20000,0.25\n50000,0.75\n",
        "size_um,volume_fraction_percent\n20,25\n50,75\n",
        "size_um,volume_fraction (%)\n20,25\n50,75\n",
        "Size (um), Volume fraction \n 20 , 0.25 \n 50 , 0.75 \n",
        "\ufeffsize_um,volume_fraction\n20,0.25\n50,0.75\n",  # byte order mark
        "\n\nsize_um,volume_fraction\n\n20,0.25\n , \n50,0.75\n\n",  # blank lines
        "size_um,volume_fraction\r\n20,0.25\r\n50,0.75\r\n",  # Windows
        "size_um,volume_fraction\n20,0.25\n50,0.75",  # no newline at the end
        '"size_um","volume_fraction"\n"20","0.25"\n"50","0.75"\n',
        "size_um,volume_fraction,remark\n20,0.25,small\n50,0.75,\n",  # further columns are the user's business
        "size_um,volume_fraction\n20,0.2520\n50,0.7560\n",  # sums to 1.008: normalised
        "size_um,volume_fraction\n20,0.10\n50,0.75\n20,0.15\n",  # equal sizes merge
        "size_um,volume_fraction\n20,0.25\n35,0\n50,0.75\n",  # empty class
    ],
)
def test_csv_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "csd.csv"
    path.write_bytes(text.encode("utf-8"))
    csd = read_csd(path)
    assert csd.size == pytest.approx([size for size, _ in GOOD], rel=1e-12)
    assert csd.volume_fraction == pytest.approx([share for _, share in GOOD], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("size_um,share\n20,1\n", "needs exactly one column 'volume_fraction'"),
        ("length_um,volume_fraction\n20,1\n", "needs exactly one column 'size'"),
        ("size_um,size_mm,volume_fraction\n20,0.02,1\n", "needs exactly one column 'size'"),
        ("20,0.5\n50,0.5\n", "needs exactly one column 'size'"),  # no header
        ("size,volume_fraction\n20,1\n", "column 'size' has unit None; name one of m, mm, um"),
        ("size (inch),volume_fraction\n20,1\n", "column 'size' has unit 'inch'; name one of"),
        ("size_um,volume_fraction (ppm)\n20,1\n", "column 'volume_fraction' has unit 'ppm'"),
        ("size_um,volume_fraction\n20,0.5\nfifty,0.5\n", "line 3: 'fifty' is not a number"),
        ("size_um,volume_fraction\n20,0.5\n50\n", "line 3: '' is not a number"),
        ("size_um,volume_fraction\n20,5,1\n", "line 2: 3 values under 2 columns (decimal commas? use points"),
        ("size_um,volume_fraction\n-20,0.5\n50,0.5\n", "size -20 um: sizes must be positive"),
        ("size_um,volume_fraction\n0,0.5\n50,0.5\n", "size 0 um: sizes must be positive"),
        ("size_um,volume_fraction\nnan,0.5\n50,0.5\n", "line 2: 'nan' is not a number"),
        ("size_um,volume_fraction\n1e999,0.5\n50,0.5\n", "size inf um"),
        ("size_um,volume_fraction\n20,nan\n50,0.5\n", "line 2: 'nan' is not a number"),
        ("size_um,volume_fraction\n20,1e999\n50,0.5\n", "volume fraction inf"),
        ("size_um,volume_fraction\n20,-0.5\n50,1.5\n", "volume fraction -0.5"),
        ("size_um,volume_fraction\n20,0.5\n50,0.48\n", "sum to 0.98; they must sum to 1"),
        ("size_um,volume_fraction\n20,50\n50,52\n", "sum to 102; they must sum to 1"),
        ("", "holds no class"),
        ("\n \n,\n", "holds no class"),
        ("size_um,volume_fraction\n", "holds no class"),
    ],
)
def test_a_bad_csv_is_refused_with_its_name(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "user.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CsdError) as caught:
        read_csd(path)
    message = str(caught.value)
    assert says in message
    assert message.startswith(str(path))
    assert message.count(str(path)) == 1


@pytest.mark.parametrize(
    "content", [bytes(range(256)) * 8, b"\x89PNG\r\n\x1a\n\x00\x00", b"\x00" * 64, b"\xff\xfe" * 40]
)
def test_a_binary_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "user.csv"
    path.write_bytes(content)
    with pytest.raises(CsdError, match=r"user\.csv: "):
        read_csd(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CsdError, match=r"nowhere\.csv: cannot be read \(No such file"):
        read_csd(tmp_path / "nowhere.csv")
    with pytest.raises(CsdError, match="cannot be read"):
        read_csd(tmp_path)


def test_unquoted_decimal_commas_are_never_read_as_another_distribution(tmp_path: Path) -> None:
    # 20,1 and 50,0 um with 100 % and 0 %... meant: 20.1 um 0.5, 50.0 um 0.5
    path = tmp_path / "user.csv"
    path.write_text("size_um,volume_fraction\n20,1,0,5\n50,0,0,5\n", encoding="utf-8")
    with pytest.raises(CsdError):
        read_csd(path)


def test_the_line_number_of_an_error_counts_blank_lines(tmp_path: Path) -> None:
    path = tmp_path / "user.csv"
    path.write_text("size_um,volume_fraction\n\n\n20,0.5\nfifty,0.5\n", encoding="utf-8")
    with pytest.raises(CsdError, match="line 5: 'fifty'"):
        read_csd(path)


@given(st.binary(max_size=300))
def test_any_bytes_are_a_distribution_or_a_csd_error(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(content)
    try:
        csd = read_csd(path)
    except CsdError:
        return
    assert csd.volume_fraction.sum() == pytest.approx(1.0)


@given(st.lists(st.tuples(st.text(max_size=8), st.text(max_size=8)), max_size=5))
def test_any_rows_are_a_distribution_or_a_csd_error(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[str, str]]
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    text = "size_um,volume_fraction\n" + "".join(f"{a},{b}\n" for a, b in rows)
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        csd = read_csd(path)
    except CsdError:
        return
    assert np.all(csd.size > 0.0)


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("size_um", ("size", "um")),
        ("size (mm)", ("size", "mm")),
        (" Size [µm] ", ("size", "µm")),
        ("volume_fraction", ("volume_fraction", None)),
        ("Volume fraction (%)", ("volume_fraction", "%")),
        ("volume_fraction_percent", ("volume_fraction", "percent")),
        ("", ("", None)),
        ("size ( um )", ("size", "um")),
    ],
)
def test_headers_are_split_into_name_and_unit(header: str, expected: tuple[str, str | None]) -> None:
    assert split_header(header) == expected


def test_kept_classes_survive_the_rounding_of_a_change_of_unit() -> None:
    full = mixture([10 * UM, 20 * UM, 30 * UM, 40 * UM], [0.1, 0.2, 0.3, 0.4])
    truncated = mixture([30 * UM * (1.0 + 2e-16), 20 * UM * (1.0 - 1e-15)], [0.5, 0.5])
    assert kept_classes(full, truncated).tolist() == [False, True, True, False]
    assert kept_volume(full, truncated) == pytest.approx(0.5)
