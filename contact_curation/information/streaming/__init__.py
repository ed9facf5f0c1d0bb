"""Selection from a stream of scored tosses, one toss at a time."""
