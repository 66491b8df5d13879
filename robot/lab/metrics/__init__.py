"""Measures of how a robot drives. Pure: logs in, numbers out."""
