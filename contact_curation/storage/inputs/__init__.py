"""Reads the inputs of the commands: from bags, folders and files to tosses."""
