"""What a crystallizer and a filter cost, for choosing between them.

Imports from the study's types of values, and all below; never from packings that are running or from figures.
"""
