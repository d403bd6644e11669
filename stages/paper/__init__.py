"""Reports of the paper's experiments: rows, statistics, tables, figures, and what the paper itself says."""
