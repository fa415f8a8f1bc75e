"""One model over many processes (ranks): communication, subdomains of a mesh, and its equations in PETSc."""
