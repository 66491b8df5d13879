"""The teacher's board of a class: asks the robots' own servers, and shows all on one page."""
