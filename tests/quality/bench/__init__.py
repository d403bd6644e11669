"""Kinematic tasks with known answers, written as data, which show whether the learner finds the right program."""
