"""Reads public datasets, and writes them as recordings."""
