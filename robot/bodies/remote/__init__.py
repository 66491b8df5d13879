"""Robots of any kind, over one page of protocol (docs/reference/robot-protocol.md)."""
