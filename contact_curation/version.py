"""The version of the package, as in package.xml."""

__version__ = "0.1.0"
