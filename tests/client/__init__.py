"""A random client of every route, message, command and fault; see `python -m tests.client`."""
