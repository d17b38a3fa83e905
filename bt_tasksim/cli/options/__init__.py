"""Options that several commands share: one typed group a file."""
