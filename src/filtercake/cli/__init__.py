"""The command line: one module of commands, one of options, fields of the model in words, and the generated schemas.

Imports from every room but validation.
"""
