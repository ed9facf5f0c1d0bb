"""The command line: one module or package per verb, with its options and what it prints. Only `main` catches errors."""
