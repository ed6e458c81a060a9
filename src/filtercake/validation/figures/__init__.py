"""Figures of the pages that prove the product; each module takes tables and returns a figure."""

import filtercake.figures  # noqa: F401 - before matplotlib: it sees to a backend that is not there
