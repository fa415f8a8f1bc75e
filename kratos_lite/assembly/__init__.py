"""Assembly: from elements to global matrices and vectors."""
