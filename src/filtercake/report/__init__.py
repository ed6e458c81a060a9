"""The report: captions, pages and words around a study's figures and tables.

Imports from figures and the rooms below it.
"""
