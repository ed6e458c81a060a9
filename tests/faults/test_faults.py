"""Every family of the fault campaign, a few faults each: nothing lost, nothing wrong accepted, nothing left."""

import random

import campaign
import pytest
from sweep import Sweep

from filtercake.packing.engines.liggghts import find_executable

FEW = {"killed_programs": 6, "failing_programs": 16, "damage": 10, "clocks": 4, "two_runs": 3}

pytestmark = pytest.mark.faults


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A sweep with an undisturbed run, by engine."""
    made = {}

    def make(engine):
        if engine not in made:
            made[engine] = Sweep.make(tmp_path_factory.mktemp("faults") / engine, engine)
        return made[engine]

    return make


@pytest.mark.parametrize("name", campaign.FAMILIES)
def test_one_command_resumes(name, sweep):
    engine = campaign.FAMILIES[name][1][0]
    if engine == "liggghts" and find_executable() is None:
        pytest.skip("LIGGGHTS is not installed")
    if name in campaign.SELF_JUDGED and not campaign.may_mount():
        pytest.skip("only root may mount a disk")
    faults = campaign.run_family(name, sweep(engine), FEW.get(name, 2), random.Random(name))
    assert faults
    for fault in faults:
        assert (fault.lost, fault.accepted, fault.left, fault.commands, fault.equal) == (0, 0, 0, 1, True), fault


@pytest.mark.parametrize("way", campaign.FAKES)
def test_one_failure_of_liggghts_alone_is_got_over(way, sweep):
    if find_executable() is None:
        pytest.skip("LIGGGHTS is not installed")
    made = sweep("liggghts")
    made.targets = campaign.TABLES_ONLY
    made.clear()
    trial = campaign.Trial(made, random.Random(way), "failing_programs")
    campaign.fail_with(trial, [way])
    (fault,) = trial.judge()
    assert (fault.kind, fault.lost, fault.accepted, fault.left, fault.commands, fault.equal) == (way, 0, 0, 0, 1, True)


def test_the_campaign_sees_one_other_digit(sweep):
    made = sweep(campaign.FAMILIES["clocks"][1][0])
    assert made.differing() == [] and made.wrong() == 0
    table = made.results / "replicates.csv"
    text = table.read_text()
    table.write_text(text.replace("0.4", "0.5", 1) if "0.4" in text else text.replace("0.3", "0.5", 1))
    try:
        assert made.differing() == ["replicates.csv"] and made.wrong() == 1
    finally:
        table.write_text(text)
