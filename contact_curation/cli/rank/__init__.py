"""The verb `rank`."""
