"""The command line: arguments in, printed reports out. One file per verb; only `main` catches errors."""
