"""The paper's experiments as flows of cells, and their commands."""
