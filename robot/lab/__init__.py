"""The paper's experiments and further ones: protocols, runs, tables, report."""
