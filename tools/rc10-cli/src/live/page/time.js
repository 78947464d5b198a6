// The time bar: where the window stands in what is known, and playing it.
