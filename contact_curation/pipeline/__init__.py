"""Recordings to tosses, scored pool, ranking and manifest: one way for all callers."""
