"""Support of one number: what it rests on, what would change it, and what it says of a claim."""
