"""What `runner.py` runs is for several processes alone."""

collect_ignore_glob = ["ranks_*.py", "runner.py"]
