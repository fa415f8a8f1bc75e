"""Readers: what each format of a run says, as a `Case`."""
