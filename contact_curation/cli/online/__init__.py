"""The verb `online`."""
