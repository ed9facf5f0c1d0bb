"""Readers of the file formats of bags, a file each."""
