"""Runs every benchmark in turn, the one that takes half an hour last: `make bench`."""

from __future__ import annotations

import runpy

for name in (
    "bench_engine",
    "bench_drawer",
    "bench_table_top",
    "bench_learners",
    "bench_predicate_search",
    "bench_guard_search",
    "bench_synthesis",
):
    print(f"\n== {name}", flush=True)
    runpy.run_module(f"tests.benchmarks.{name}", run_name="__main__")
