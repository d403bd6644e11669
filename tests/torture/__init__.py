"""Everything that must not break, tried often: `python -m tests.torture`."""
