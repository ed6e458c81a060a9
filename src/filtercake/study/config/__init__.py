"""The typed model of a study and of the workflow's configuration: one module per section of the file.

The one source of defaults, ranges, units and descriptions: the JSON schemas, the template of a study and the reference
of its keys are generated from it.
"""
