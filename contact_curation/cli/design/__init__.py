"""The verb `design`."""
