"""Static figures and the report of a session."""
