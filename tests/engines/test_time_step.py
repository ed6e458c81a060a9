"""Why frictional beds take a shorter time step: at the frictionless one, strong cohesion keeps them moving."""

from dataclasses import replace

import pytest

from filtercake.crystals.csd import mixture
from filtercake.errors import PackingRejected
from filtercake.packing import contact_law
from filtercake.packing.pack import pack
from filtercake.packing.scene import PackingSpec
from filtercake.study.limits import FRICTIONAL_TIME_STEP, FRICTIONLESS_TIME_STEP

CSD = mixture([20e-6, 50e-6], [0.5, 0.5])
RAYLEIGH = contact_law.rayleigh_time_step(10e-6, 1180.0, 5e6, 0.2)
SCENE = PackingSpec(
    particles=1000,
    initial_void_fraction=0.65,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.05,
    cohesion=100e3,
    time_step=FRICTIONAL_TIME_STEP * RAYLEIGH,
    engine="embedded",
    max_fall_times=2.0,
)


@pytest.mark.slow
def test_a_frictional_bed_rests_at_its_own_time_step_and_is_refused_at_the_longer_one(tmp_path):
    packing = pack(SCENE, CSD, 0, tmp_path)
    assert packing.diagnostics["settled"]
    with pytest.raises(PackingRejected, match="lower packing"):
        pack(replace(SCENE, time_step=FRICTIONLESS_TIME_STEP * RAYLEIGH), CSD, 0, tmp_path)
