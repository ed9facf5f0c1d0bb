"""Calls of the compiled kernel, with its structures field by field."""
