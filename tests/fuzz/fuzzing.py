"""Feed spoilt inputs of every kind to the code that reads them, and count what becomes of them: ``make fuzz``."""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import multiprocessing
import os
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import loading
import mutation
import watch as watching

KINDS = (*loading.KINDS, "command line")
SHARE_OF_BYTES = 0.3
"""Inputs spoilt byte by byte; the others keep most of their structure."""


class Campaign:
    """Inputs of every kind, each known by its kind, the seed and a number."""

    def __init__(self, scratch: Path, seed: int) -> None:
        self.scratch, self.seed = scratch, seed
        loading.make_scratch(scratch)
        os.chdir(scratch)
        self.watch = watching.Watch.install()
        self.before = {
            base: (scratch / base).read_bytes() for kind in loading.KINDS.values() for base in (*kind.bases, kind.file)
        }

    def make(self, kind: str, number: int) -> bytes | list[str]:
        """Make an input: a file's content, or the words of a command."""
        chance = random.Random(f"{self.seed} {kind} {number}")
        if kind == "command line":
            return loading.spoil_command(chance)
        about = loading.KINDS[kind]
        base = self.before[chance.choice(about.bases)]
        if chance.random() < SHARE_OF_BYTES:
            return mutation.spoil_bytes(base, chance)
        return about.spoil(base, chance)

    def run(self, kind: str, content: bytes | list[str]) -> tuple[str, str]:
        """Run an input: its outcome, and what was said."""
        # a command may write below the working folder; to read a file is to write nothing
        self.watch.allowed = str(self.scratch if isinstance(content, list) else self.scratch / "nothing")
        if isinstance(content, list):
            return watching.outcome_of(lambda: loading.run_command(content), self.watch, ("filtercake: ",), content)
        about = loading.KINDS[kind]
        target = self.scratch / about.file
        target.write_bytes(content)
        try:
            return watching.outcome_of(about.load, self.watch, (target.name, "config.yaml", "options"))
        finally:
            target.write_bytes(self.before[about.file])


def run_part(part: tuple[range, tuple[str, ...], int, Path | None, float]) -> dict[str, Counter[str]]:
    """Run the inputs of some numbers, kind after kind in turn, and count the outcomes of each kind."""
    numbers, kinds, seed, failures, end = part
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in kinds}
    with tempfile.TemporaryDirectory() as folder:
        campaign = Campaign(Path(folder).resolve() / "scratch", seed)
        for number in numbers:
            if time.time() > end:
                break
            kind = kinds[number % len(kinds)]
            content = campaign.make(kind, number)
            outcome, said = campaign.run(kind, content)
            counts[kind][outcome] += 1
            if outcome in watching.BAD:
                print(f"\n{kind} {number}: {outcome}: {said[:1500]}", flush=True)
                if failures:
                    failures.mkdir(parents=True, exist_ok=True)
                    shown = content if isinstance(content, bytes) else repr(content).encode()
                    (failures / f"{kind.replace(' ', '_')}_{number}").write_bytes(shown)
        os.chdir("/")
    return counts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000, help="inputs, over all kinds (default 10000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=math.inf, help="stop after this time, whatever is left")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only this kind")
    parser.add_argument("--output", type=Path, help="write the counts to this CSV")
    parser.add_argument("--failures", type=Path, help="keep the inputs that came to a bad end in this folder")
    options = parser.parse_args()
    kinds, failures = tuple(options.kind or KINDS), options.failures and options.failures.resolve()
    stop = time.time() + 60.0 * options.minutes
    ends = [options.count * k // options.processes for k in range(options.processes + 1)]
    parts = [(range(*pair), kinds, options.seed, failures, stop) for pair in itertools.pairwise(ends)]
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        found = pool.map(run_part, parts)
    counts = {kind: sum((part[kind] for part in found), Counter()) for kind in kinds}
    columns = ("kind", "inputs", *watching.GOOD, *watching.BAD)
    rows = [
        {"kind": kind, "inputs": of.total(), **{name: of[name] for name in columns[2:]}} for kind, of in counts.items()
    ]
    rows.append({"kind": "all", **{name: sum(row[name] for row in rows) for name in columns[1:]}})
    for stream in [sys.stdout, *([options.output.open("w", encoding="utf-8", newline="")] if options.output else [])]:
        writer = csv.DictWriter(stream, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return int(any(rows[-1][outcome] for outcome in watching.BAD))


if __name__ == "__main__":
    sys.exit(main())
