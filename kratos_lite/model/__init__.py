"""What is analyzed: loads, supports, checks and mass properties of a structure."""
