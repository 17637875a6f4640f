"""A virtual lathe with bearing clearance that cuts, chatters and is recorded in real time."""

__version__ = '0.1.0'
