"""The laws of an arm: where its tool is for given joints, and which joints bring it where."""
