"""Demonstrations in the formats of other programs."""
