"""Speed, measured beside other environments and libraries in the same run: ``make bench``."""
