"""Exact answers of the algorithms."""
