"""The EV3 brick: its devices, and the connection to a remote brick."""
