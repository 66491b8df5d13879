"""Drivelesson on Windows' own Python, under Wine: `make test-windows`."""
