"""The teacher's board of a class: it queries the robots' servers and shows all robots on a page."""
