"""Families of tasks. Every file here is one: it registers itself, nothing else names it."""
