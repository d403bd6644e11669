"""Stages, with tiny budgets."""
