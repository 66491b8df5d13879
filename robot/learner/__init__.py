"""Online learners: numpy alone, importing nothing else of the project."""
