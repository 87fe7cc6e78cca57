"""Pages, figures and films of results, made from records.

To add a figure: write a function in ``figures/`` that takes records and returns a Matplotlib figure, and add
a `Picture` with its title and caption to the page that shows it.
"""
