"""Turns a pose stream into tosses: segmenting, smoothing, quality checks, transitions."""
