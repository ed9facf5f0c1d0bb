"""Inputs of the commands: from bags, folders and files to tosses."""
