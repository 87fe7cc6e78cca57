"""A problem file and its MJCF: read, checked, compiled and instrumented."""
