"""Time, memory and error of kratos_lite and of other programs on the same meshes; see README.md."""
