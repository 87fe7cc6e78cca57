"""Figures: records in, Matplotlib figures out."""
