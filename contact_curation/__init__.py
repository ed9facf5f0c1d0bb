"""Online curation of contact-rich robot tosses: which tosses teach, which to keep, what to throw next."""

__version__ = "0.1.0"
