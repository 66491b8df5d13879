"""The paper's experiments and further experiments: protocols, runs, tables, report."""
