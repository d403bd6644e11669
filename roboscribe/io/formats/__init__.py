"""Demonstrations in the formats of other programs: LeRobot, robomimic, Minari, CSV and NumPy archives.

A format (one file each, listed in `table.py`) reads columns of numbers and writes trajectories; `mapping.py` says which
columns hold which attributes of a task, `suggest.py` writes a first mapping, `transfer.py` puts all of it together.
None of the other programs has to be installed.
"""
