"""The teacher's board of a class: queries the robots' servers and shows all on one page."""
