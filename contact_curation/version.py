"""The version of the package, as in package.xml."""

__version__ = "0.2.0"
