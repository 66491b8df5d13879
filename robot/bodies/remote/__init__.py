"""Robots of any kind, over a one-page protocol (docs/reference/robot-protocol.md)."""
