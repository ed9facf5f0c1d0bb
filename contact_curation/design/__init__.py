"""Throws that teach most: where they may lie, what each is expected to teach, and which to make next."""
