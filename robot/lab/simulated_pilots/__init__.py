"""Simulated pilots, which drive by the same commands as a phone."""
