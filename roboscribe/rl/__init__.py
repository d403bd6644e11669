"""Learners: what a controller sees, skills, cloning, PPO, SAC, inverse dynamics, TRAINPROGRAM (Sec. 4.3.3)."""

import os

os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # rsl-rl's logger imports git, which insists on a git binary
