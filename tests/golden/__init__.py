"""Texts that must not change by accident."""
