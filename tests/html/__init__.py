"""HTML of programs, trees, tables, strips and curves."""
