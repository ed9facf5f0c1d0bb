"""The command line: arguments in, printed reports out. One file per verb; only the door in `main` catches errors."""
