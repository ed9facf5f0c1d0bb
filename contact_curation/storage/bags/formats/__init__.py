"""Readers of the file formats of bags, one module each."""
