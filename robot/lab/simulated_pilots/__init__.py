"""Simulated pilots, which send the same commands as a phone."""
