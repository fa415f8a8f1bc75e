"""Single changes of formulas, each of which a test must notice; ``python -m tests.mutations`` shows it."""
