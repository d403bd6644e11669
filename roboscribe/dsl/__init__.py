"""The language (Fig. 5 and 12): syntax, types, meaning, rewriting, printing, parsing and running of programs."""
