"""Control nodes and decorators of trees, one file each: class, XML form, symbol, label and helper."""
