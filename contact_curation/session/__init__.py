"""The closed loop as processes: supervision, records, report."""
