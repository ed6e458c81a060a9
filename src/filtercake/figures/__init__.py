"""One module per family of figures: each takes tables and returns a matplotlib figure.

Imports from calibration, results and the rooms below them; the catalogues say which figures a study has.
"""
