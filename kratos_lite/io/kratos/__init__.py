"""Kratos run files, and what the data of Kratos mean.

A run file is read by `run_file`; its processes are rows of `processes.PROCESSES`, its expected values rows of
`expected_values.COMPARISONS`.  `to_model` makes a model of a document: `variables` says which variable is
which load or support, `properties` which is which constant of a material; the names of Kratos' laws are
aliases of our materials.  `to_document` is the way back.
"""
