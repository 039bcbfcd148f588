"""Tasks: what a method is given, random ones, and data sets of them."""
