"""Simulated pilots. They drive by the same commands as a phone."""
