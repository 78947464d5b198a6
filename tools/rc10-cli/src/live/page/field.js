// The field from above, and the mechanisms.
