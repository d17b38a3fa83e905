"""Ways that are clear of what is known, and smooth motions along them."""
