"""The command line: one module of commands, one of options, and the schemas of the configuration files.

Imports from every room but validation.
"""
