"""Rounds of packings of a made-up truth: what is packed next, and when it ends."""

from __future__ import annotations

import numpy as np
import pytest
from search_problems import LEVELS, belief, best_time, plant, problem

from filtercake.design.belief import Belief
from filtercake.design.confirm import BATCHES, Candidate, Found, Round, choose, learnt
from filtercake.design.plant import Limits
from filtercake.design.search import INTERIOR, Problem, find

CANDIDATES = [Candidate(f"l{k}b{batch}", k, batch, 3) for batch in range(BATCHES) for k in range(len(LEVELS))]


def pack(names: tuple[str, ...], truth: np.ndarray, scatter: float, seed: int) -> dict[str, np.ndarray]:
    """Make packings of some names."""
    rng = np.random.default_rng(seed)
    known = {item.name: item for item in CANDIDATES}
    return {
        name: truth[known[name].level] + scatter * rng.standard_normal((known[name].replicates, 1)) for name in names
    }


def run(
    task: Problem, prior: Belief, truth: np.ndarray, budget: int = 200, candidates: list[Candidate] = CANDIDATES
) -> tuple[Found, list[Round]]:
    """Go through the rounds to the last one."""
    found, rounds = Found({}, 0), []
    while not rounds or not rounds[-1].finished:
        rounds.append(choose(task, prior, candidates, found, budget))
        made = pack(rounds[-1].packings, truth, 0.002, len(rounds))
        found = Found({**found.porosity, **made}, found.made + 3 * len(made))
        assert len(rounds) < 60
    return found, rounds


def test_an_answer_never_stands_on_the_estimate_alone() -> None:
    prior = belief(1e-4)
    assert find(problem(), prior).kind == INTERIOR
    first = choose(problem(), prior, CANDIDATES, Found({}, 0), 200)
    nearest = int(np.argmin(np.abs(np.log(np.array(LEVELS) / best_time(0.6)))))
    assert first.packings == (f"l{nearest}b0",) and not first.finished
    found = Found(pack(first.packings, np.full(13, 0.4), 0.002, 1), 3)
    assert choose(problem(), prior, CANDIDATES, found, 200).finished


@pytest.mark.parametrize("seed", range(3))
def test_the_rounds_end_with_the_true_optimum_in_the_interval(seed: int) -> None:
    task, prior = problem(target=0.12, tolerance=1e-4), belief(0.012)
    curve = prior.mean[:, 0] + prior.deviation[:, 0] * prior.draws(3, 77)[seed]
    truth = curve[list(prior.levels)]
    exact = find(task, Belief(prior.position, prior.levels, curve[:, None], prior.covariance * 1e-8, prior.scatter))
    found, rounds = run(task, prior, truth)
    last = find(task, learnt(prior, CANDIDATES, found))
    assert last.settled and rounds[-1].packings == ()
    assert last.low <= exact.residence_time * 1.03 and exact.residence_time / 1.03 <= last.high
    assert last.high - last.low < find(task, prior).high - find(task, prior).low
    # a level's further sets come after its first
    names = [name for item in rounds for name in item.packings]
    assert all(f"{name[:-1]}{int(name[-1]) - 1}" in names[: names.index(name)] for name in names if name[-1] != "0")
    assert len(names) == len(set(names))


def test_packings_are_made_where_they_tell_most() -> None:
    """Far from the optimum nothing is learnt of it: packings stay near."""
    task, prior = problem(target=0.03, tolerance=1e-6), belief(0.01)
    _, rounds = run(task, prior, np.full(13, 0.4), budget=30)
    best = np.log(best_time(0.6))
    levels = [int(name[1:].partition("b")[0]) for item in rounds for name in item.packings]
    assert len(levels) == 10
    assert all(abs(np.log(LEVELS[level]) - best) < np.log(4.0) for level in levels)


def test_the_packings_allowed_are_not_exceeded_and_it_is_said() -> None:
    task = problem(target=1e-3, tolerance=1e-7)
    found, rounds = run(task, belief(0.012), np.full(13, 0.4), budget=10)
    assert found.made == 9
    assert "the 10 packings allowed are made" in rounds[-1].why


def test_it_ends_where_everything_is_packed() -> None:
    task = problem(target=1e-4, tolerance=1e-9)
    few = [item for item in CANDIDATES if item.level in (0, 6, 12)]
    found, rounds = run(task, belief(0.012), np.full(13, 0.4), budget=10_000, candidates=few)
    assert found.made == 3 * len(few)
    assert f"every level has its {BATCHES} sets" in rounds[-1].why


def test_packings_that_failed_are_made_anew_with_other_seeds() -> None:
    prior = belief(1e-4)
    first = choose(problem(), prior, CANDIDATES, Found({}, 0), 200)
    failed = Found({first.packings[0]: np.empty((0, 1))}, 3)
    second = choose(problem(), prior, CANDIDATES, failed, 200)
    assert second.packings == (first.packings[0].replace("b0", "b1"),)


def test_no_packing_is_made_where_no_design_keeps_to_the_limits() -> None:
    task = problem(plant=plant(limits=Limits(largest_area=1e-3)))
    first = choose(task, belief(0.004), CANDIDATES, Found({}, 0), 200)
    assert first.finished and "no design keeps to the limits" in first.why
