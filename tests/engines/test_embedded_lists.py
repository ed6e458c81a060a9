"""The lists of pairs of the embedded engine: none that touches is missing, however spheres move."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from filtercake.crystals.csd import CrystalSizeDistribution, mixture
from filtercake.packing.cloud import make_cloud
from filtercake.packing.engines import embedded_bed, pair_kernels
from filtercake.packing.engines.embedded_bed import Bed
from filtercake.packing.scene import Scene


def scene_of(csd, particles, **changed):
    values = {
        "initial_void_fraction": 0.65,
        "settling_velocity": 0.01,
        "density": 1180.0,
        "youngs_modulus": 5e6,
        "poisson_ratio": 0.2,
        "restitution": 0.9,
        "friction": 0.0,
        "cohesion": 0.0,
        "time_step": 1e-7,
        "engine": "embedded",
    }
    return Scene(csd=csd, particles=particles, **{**values, **changed}).with_time_step(changed.get("fraction", 0.3))


def touching(bed):
    """Pairs of spheres of the bed whose surfaces overlap, by an independent search."""
    n, length = bed.count, bed.length
    place = bed.position[:n].copy()
    place[:, :2] %= length
    place[place[:, :2].max(axis=1) >= length, :2] = 0.0
    high = 10.0 * (abs(place[:, 2]).max() + length)
    place[:, 2] += 0.5 * high
    tree = cKDTree(place, boxsize=[length, length, high])
    i, j = tree.query_pairs(2.0 * bed.radius[:n].max(), output_type="ndarray").T
    away = place[i] - place[j]
    away[:, :2] -= length * np.round(away[:, :2] / length)
    close = np.sum(away**2, axis=1) < (bed.radius[i] + bed.radius[j]) ** 2
    return set(zip(i[close].tolist(), j[close].tolist(), strict=True))


def near(bed):
    """Pairs that the time loop works on at present, none of them twice."""
    pairs, images = bed.pairs, []
    for part in range(bed.threads):
        begin = pairs.bounds[part]
        if begin == pairs.bounds[part + 1]:
            continue
        here = slice(int(pairs.first[begin]), int(pairs.near_end[part]))
        owner, named = pairs.near_owner[here].astype(int), pairs.near_neighbour[here].astype(int)
        other, image = named & int(pair_kernels.INDEX_MASK), named >> int(pair_kernels.IMAGE_SHIFT)
        # from the other sphere the image lies on the other side
        image = np.where(owner < other, image, 2 * int(pair_kernels.SAME_IMAGE) - image)
        images += zip(np.minimum(owner, other).tolist(), np.maximum(owner, other).tolist(), image.tolist(), strict=True)
    assert len(set(images)) == len(images)
    return {(i, j) for i, j, _ in images}


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("threads", [1, 2])
def test_every_contact_of_a_falling_bed_is_listed(friction, threads):
    scene = scene_of(mixture([10e-6, 50e-6], [0.5, 0.5]), 1500, friction=friction, settling_velocity=0.3)
    cloud = make_cloud(scene.csd, 1500, 0.65, 1)
    bed = Bed.from_cloud(cloud, scene, threads)
    seen = 0
    for steps in np.random.default_rng(1).integers(1, 170, size=60):
        bed.advance(int(steps))
        if bed.count:
            contacts = touching(bed)
            assert contacts <= near(bed)
            seen += len(contacts)
    assert seen > 1000


@given(speed=st.floats(0.05, 3.0), seed=st.integers(0, 1000), size=st.sampled_from([10e-6, 20e-6, 50e-6]))
@settings(max_examples=15)
def test_a_bullet_through_a_cloud_at_rest_meets_what_it_meets(speed, seed, size):
    scene = scene_of(mixture([20e-6, 50e-6], [0.5, 0.5]), 300)
    cloud = make_cloud(scene.csd, 300, 0.65, seed)
    position = np.vstack([cloud.position, [0.5 * cloud.length, 0.5 * cloud.length, -60e-6]])
    velocity = np.zeros_like(position)
    velocity[-1] = [0.3 * speed, 0.1 * speed, speed]
    scene = scene_of(CrystalSizeDistribution.from_classes([10e-6], [1.0]), 301)
    position[:, 2] += 500e-6
    bed = Bed(position, velocity, np.append(cloud.radius, 0.5 * size), cloud.length, scene, 0.0)
    for _ in range(25):
        bed.advance(37)
        assert touching(bed) <= near(bed)


def test_a_sphere_that_crosses_the_box_meets_every_image():
    """Again and again through a narrow box while a list may last, past a sphere that lies a little aside."""
    side, radius, speed = 60e-6, 10e-6, 20.0
    position = np.array([[15e-6, 30e-6, 60e-6], [45e-6, 30e-6, 60e-6 + 1.99 * radius]])
    velocity = np.array([[speed, 0.0, 0.0], [0.0, 0.0, 0.0]])
    scene = scene_of(CrystalSizeDistribution.from_classes([20e-6], [1.0]), 2)
    bed = Bed(position, velocity, np.full(2, radius), side, scene, gravity=0.0)
    bed.mass *= 1e6  # so that meeting turns it aside by nothing
    assert speed * scene.time_step * embedded_bed.LISTING_STEPS > 2.0 * side
    laps = set()
    for step in range(embedded_bed.LISTING_STEPS):
        bed.advance(1)
        assert touching(bed) <= near(bed)
        laps |= {int(speed * step * scene.time_step / side) for _ in touching(bed)}
    assert len(laps) > 3


def test_few_that_fly_about_do_not_shorten_the_list_of_those_at_rest():
    side, n = 400e-6, 8
    grid = (np.array([(x, y, z) for z in range(n) for y in range(n) for x in range(n)]) + 0.5) * side / n
    position = np.vstack([grid, [0.5 * side, 0.5 * side, 2.0 * side]])
    velocity = np.zeros_like(position)
    velocity[-1, 0] = 1.0
    scene = scene_of(CrystalSizeDistribution.from_classes([40e-6], [1.0]), len(position))
    bed = Bed(position, velocity, np.full(len(position), 20e-6), side, scene, gravity=0.0)
    bed.advance(1)
    bed.advance(embedded_bed.LISTING_STEPS // 2)
    assert bed.listed_at == 0 and bed.room[:-1].max() < 0.1 * bed.room.max()
    assert np.abs(bed.velocity[-1, 0] * bed.step * scene.time_step) > bed.room[:-1].max()


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_parts_give_their_forces_to_the_spheres_of_the_others(friction):
    side, n = 400e-6, 10
    coarse = (np.array([(x, y, z) for z in range(n) for y in range(n) for x in range(n)]) + 0.5) * side / n
    # fine ones between four coarse ones: they list those below them, too
    place = np.vstack([coarse, coarse + np.array([0.5, 0.5, 0.0]) * side / n])
    radius = np.repeat([20.05e-6, 8.28e-6], n**3)
    velocity = np.random.default_rng(1).uniform(-0.01, 0.01, place.shape)
    scene = scene_of(mixture([16e-6, 40e-6], [0.1, 0.9]), radius.size, friction=friction, cohesion=2e4)
    one, two = (Bed(place, velocity, radius, side, scene, gravity=0.0, threads=threads) for threads in (1, 2))
    for bed in (one, two):
        bed.spin[:] = np.random.default_rng(2).uniform(-300.0, 300.0, place.shape)
        bed.advance(25)
    pairs, middle = two.pairs, two.pairs.bounds[1]
    upper = slice(int(pairs.first[middle]), int(pairs.near_end[1]))
    assert (pairs.near_neighbour[upper] & pair_kernels.INDEX_MASK < middle).any()
    assert not two.force[1:].any() and not two.torque[1:].any()
    for name in ("spheres", "force", *(("spin", "torque") if friction else ())):
        first, other = (
            (getattr(bed, name)[0] if name in ("force", "torque") else getattr(bed, name))[np.argsort(bed.identity)]
            for bed in (one, two)
        )
        assert np.allclose(first, other, rtol=1e-7, atol=1e-9 * np.abs(first).max()), name
