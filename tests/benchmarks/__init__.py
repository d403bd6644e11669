"""Benchmarks: what is fast, and how fast; run with `make bench`."""
