"""One solver a file: a cost and a start in, a solution out."""
