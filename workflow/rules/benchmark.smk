# Benchmarks: targets of their own, never part of a study.
