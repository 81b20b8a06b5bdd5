"""Vision-based control of cable-driven parallel robots with sagging cables, in Drake."""

__version__ = "0.1.0"
