"""Experiments of the paper and of this project, and the verb `reproduce`."""
