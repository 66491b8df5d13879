"""Measures and tables that several houses share."""
