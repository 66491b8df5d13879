"""The paper's experiments, and those beyond it: protocols, runs, tables, report."""
