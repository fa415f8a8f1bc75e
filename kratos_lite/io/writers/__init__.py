"""What results become in files."""
