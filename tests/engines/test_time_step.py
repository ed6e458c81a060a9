"""Why frictional beds take a shorter time step: at the frictionless one, strong cohesion keeps them moving."""

import pytest

from filtercake.crystals.csd import mixture
from filtercake.errors import PackingRejected
from filtercake.packing.pack import pack
from filtercake.packing.scene import Scene
from filtercake.study.limits import FRICTIONAL_TIME_STEP, FRICTIONLESS_TIME_STEP

SCENE = Scene(
    csd=mixture([20e-6, 50e-6], [0.5, 0.5]),
    particles=1000,
    initial_void_fraction=0.65,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.05,
    cohesion=100e3,
    time_step=0.0,
    engine="embedded",
    max_fall_times=2.0,
).with_time_step(FRICTIONAL_TIME_STEP)


@pytest.mark.slow
def test_a_frictional_bed_rests_at_its_own_time_step_and_is_refused_at_the_longer_one(tmp_path):
    packing = pack(SCENE, 0, tmp_path)
    assert packing.diagnostics["settled"]
    with pytest.raises(PackingRejected, match="lower packing"):
        pack(SCENE.with_time_step(FRICTIONLESS_TIME_STEP), 0, tmp_path)
