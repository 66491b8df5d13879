"""Pilots that are not people. They drive through the same commands as a phone."""
