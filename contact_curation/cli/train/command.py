"""`train INPUT... --out CHECKPOINT`: a model learns from all tosses, from the kept ones of a manifest, or from the best K."""

import argparse

from contact_curation.cli.train.options import add_train_options


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Trains a model on every toss that passes the gates, on those that `rank` kept, or on the best K, which can be "
        "selected again while it learns. Some tosses are held out and never learned from; their loss is watched. Ctrl-C "
        "stops after the gradient step in progress and stores a checkpoint; the same command with --resume goes on."
    )
    add_train_options(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads, trains, stores, and says how it went.

    Raises:
        ContactCurationError: there is nothing to train on, the checkpoint belongs to another one, or a loss was not finite.
        KeyboardInterrupt: it was stopped; the checkpoint is stored.
    """
    from contact_curation.cli.train.run import run_training  # torch takes over a second, which --help need not wait for

    return run_training(arguments)
