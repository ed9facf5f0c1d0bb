"""The batched cone problem that gives the impulses, its certificate, and the compiled kernel."""
