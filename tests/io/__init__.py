"""Files: demonstrations, saved programs, atomic writes."""
