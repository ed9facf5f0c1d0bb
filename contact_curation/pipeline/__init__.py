"""Turns recordings into tosses, a scored pool, a ranking and a manifest, in the same way for all callers."""
