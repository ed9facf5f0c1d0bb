"""The manifest of a ranking and its file formats."""
