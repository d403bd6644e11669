"""Tests of layouts, trajectories and names."""
