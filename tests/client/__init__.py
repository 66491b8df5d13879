"""One random client over every route, message, command and fault; see `python -m tests.client`."""
