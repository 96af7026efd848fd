"""A variable-stiffness foot prosthesis and the person who walks with it, in Drake."""

from importlib.metadata import version

__version__ = version("vsf-drake")
